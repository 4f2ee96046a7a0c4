"""The cost of GPC, and the powers at which it is least."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.control.gpc.model import ChangeModel
from thermoctl.control.gpc.moves import best_powers, bounded_minimum
from thermoctl.control.minimum_variance import SelfTuningMinimumVariance
from thermoctl.estimation import start
from thermoctl.model.arx import Arx
from thermoctl.ports import Situation

MODEL = ChangeModel(3, 3, 2)
THETA = np.array([-0.6, 0.1, 0.05, 0.2, 0.1, 0.06])


def moved(changes_k, powers, given):
    """Return how far the temperature moves under the powers `given`, from (1) word by word."""
    a, b, loss = THETA[:2], THETA[2:5], THETA[5]
    dy, u, sums, y = list(changes_k), list(powers), [], 0.0
    for power in given:
        u.insert(0, power)
        change = -a[0] * dy[0] - a[1] * dy[1] - loss
        change += sum(b[i] * u[MODEL.delay - 1 + i] for i in range(3))
        dy.insert(0, change)
        y += change
        sums.append(y)
    return np.array(sums)


def cost(error_k, changes_k, powers, moves, length, weight):
    given = np.concatenate((moves, np.full(length - len(moves), moves[-1])))
    steps = np.diff(np.concatenate((powers[:1], moves)))
    errors_k = moved(changes_k, powers, given) - error_k
    return float(errors_k @ errors_k + weight * steps @ steps)


@pytest.mark.parametrize("error_k", [-2.0, -0.1, 0.3, 1.0, 8.0])
@pytest.mark.parametrize(("moves", "weight"), [(1, 0.1), (2, 0.0), (3, 0.5), (4, 5.0)])
def test_no_other_powers_within_bounds_cost_less(error_k, moves, weight):
    rng = np.random.default_rng(7)
    changes_k, powers, length, most = rng.normal(0, 0.1, 3), rng.uniform(0, 0.8, 5), 12, 0.8
    free = np.array(MODEL.foreseen(THETA, changes_k, powers, 0.0, length))
    step_k = np.array(MODEL.step_response(THETA, length))
    best = best_powers(error_k - free, step_k, moves, weight, float(powers[0]), most)
    assert best.min() >= 0.0
    assert best.max() <= most
    least = cost(error_k, changes_k, powers, best, length, weight)
    anywhere = rng.uniform(0.0, most, (300, moves))
    nearby = np.clip(best + rng.normal(0.0, 0.01, (300, moves)), 0.0, most)
    for other in (*anywhere, *nearby):
        assert cost(error_k, changes_k, powers, other, length, weight) >= least - 1e-12


@settings(max_examples=200, deadline=None)
@given(st.integers(1, 6), st.integers(0, 10**6), st.floats(-2.0, 4.0))
def test_the_bounded_minimum_satisfies_the_conditions_of_optimality(size, seed, scale):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size + 2, size))
    H, g = root.T @ root + 1e-3 * np.eye(size), 10.0**scale * rng.normal(size=size)
    x, slope = bounded_minimum(H, g, 1.0), None
    slope = H @ x - g
    close = 1e-7 * (np.abs(g).max() + np.abs(H).max())
    assert (x >= 0.0).all()
    assert (x <= 1.0).all()
    assert np.abs(slope[(x > 0.0) & (x < 1.0)]).max(initial=0.0) <= close
    assert (slope[x == 0.0] >= -close).all()
    assert (slope[x == 1.0] <= close).all()


def test_a_bound_on_one_move_changes_the_others():
    H, g = np.array([[2.0, 1.5], [1.5, 2.0]]), np.array([4.0, 2.9])
    clipped = np.clip(np.linalg.solve(H, g), 0.0, 1.0)
    assert clipped == pytest.approx([1.0, 0.0], abs=0.01)
    assert bounded_minimum(H, g, 1.0) == pytest.approx([1.0, 0.7])


@pytest.mark.parametrize("delay", [1, 2, 4])
def test_without_weight_and_no_farther_than_the_delay_it_is_minimum_variance(delay):
    a, b, r, rng = -0.7, (0.3, 0.1), 41.0, np.random.default_rng(3)
    y_c = 37.3 + rng.normal(0.0, 0.02, 4)
    u = rng.uniform(0.2, 0.6, 8)
    model = ChangeModel(2, 2, delay)
    theta = np.array([a, *b, 0.0])
    free = np.array(model.foreseen(theta, y_c[:-1] - y_c[1:], u, 0.0, delay))
    step_k = np.array(model.step_response(theta, delay))
    ours = best_powers(r - y_c[0] - free, step_k, 1, 0.0, 0.0, 1e9)
    structure = Arx(2, 2, delay)  # the same plant with its temperatures, (1 - q^-1)(1 + a q^-1)
    law = SelfTuningMinimumVariance(structure, zero_radius=np.inf)
    told = start(4, 1.0, (a - 1.0, -a, *b))
    situation = Situation(0.0, 1.0, y_c[0], r, u[0], told, y_c, u, y_c[0])
    assert ours[0] == pytest.approx(law.decide(law.start(), situation)[1], rel=1e-9)
