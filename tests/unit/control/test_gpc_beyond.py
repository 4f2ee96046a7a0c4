"""The cost beyond the horizon of GPC is that of a model whose lag is over."""

import numpy as np
import pytest

from thermoctl.control.gpc.beyond import Beyond
from thermoctl.control.gpc.model import ChangeModel

MODEL = ChangeModel(3, 3, 1)
THETA = np.array([-0.6, 0.08, 0.06, 0.1, 0.04, 0.05])
LENGTH = 40


def foreseen_k(changes_k, past, powers):
    """Return how far a model without shortcuts has moved after two, three and four horizons."""
    moved, sums = 0.0, []
    for j in range(4 * LENGTH):
        power = powers[min(j, len(powers) - 1)]
        change = MODEL.foreseen(THETA, changes_k, past, power, 1)[0]
        changes_k = np.concatenate(((change,), changes_k))
        past = np.concatenate(((power,), past))
        moved += change
        sums.append(moved)
    return np.array(sums[2 * LENGTH - 1 :: LENGTH])


@pytest.mark.parametrize("moves", [1, 2, 3])
def test_its_cost_is_that_of_going_through_the_model_to_the_end(moves):
    rng = np.random.default_rng(4)
    changes_k, past = rng.normal(0.0, 0.1, 3), rng.uniform(0.0, 0.8, 3)
    gain_k, holding = MODEL.gain_k(THETA), MODEL.holding(THETA)
    rest_k = 1.3 - MODEL.under_way_k(THETA, changes_k, past - holding)
    H, g = Beyond(LENGTH, moves).cost(rest_k, gain_k * holding, gain_k)

    def whole(powers):
        # what the last power has still to do at the end of its way counts as well
        under_way_k = gain_k * MODEL.lag(THETA) * (powers[-1] - holding)
        errors_k = foreseen_k(changes_k, past, powers) + under_way_k - 1.3
        return LENGTH * float(errors_k @ errors_k)

    for powers in rng.uniform(0.0, 1.0, (5, moves)):
        ours = float(powers @ H @ powers - 2.0 * g @ powers)
        assert ours == pytest.approx(whole(powers) - whole(np.zeros(moves)), rel=1e-6)


def test_at_rest_it_asks_for_the_power_that_holds():
    holding, gain_k = MODEL.holding(THETA), MODEL.gain_k(THETA)
    at_rest_k = MODEL.under_way_k(THETA, np.zeros(3), np.full(3, holding) - holding)
    H, g = Beyond(LENGTH, 1).cost(-at_rest_k, gain_k * holding, gain_k)
    assert g / H[0] == pytest.approx([holding])
