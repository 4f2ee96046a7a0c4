"""Estimates whose theta and P lie in one array."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.estimation import CorrectedKalman, Guarded, start
from thermoctl.estimation.stack import Stacked, stack
from thermoctl.signals import Estimate

LAW = CorrectedKalman(1e-3, 0.5)
PHI, Y = np.array([0.3, -1.2]), 0.7


def learned() -> Stacked:
    """Return a belief that has met twenty samples."""
    rng, belief = np.random.default_rng(3), start(2)
    for _ in range(20):
        belief = LAW.update(belief, rng.normal(size=2), float(rng.normal()))
    assert isinstance(belief, Stacked)
    return belief


def assert_same(one: Estimate, other: Estimate) -> None:
    """Check that two estimates agree to the last bit."""
    assert one.theta.tolist() == other.theta.tolist()
    assert one.P.tolist() == other.P.tolist()
    assert (one.innovation, one.innovation_var) == (other.innovation, other.innovation_var)


def test_theta_and_p_are_the_rows_of_the_stack():
    belief = learned()
    assert np.shares_memory(belief.theta, belief.rows)
    assert stack(belief).tolist() == [belief.theta.tolist(), *belief.P.tolist()]


def test_what_an_update_returns_cannot_be_written_to():
    belief = learned()
    for values in (belief.theta, belief.P, belief.rows):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0


def test_an_estimate_put_together_by_hand_learns_what_a_stacked_one_learns():
    belief = learned()
    by_hand = Estimate(belief.theta, belief.P)
    assert_same(LAW.update(by_hand, PHI, Y), LAW.update(belief, PHI, Y))


def test_a_belief_with_another_theta_or_p_learns_from_that_one():
    belief = learned()
    for change in ({"theta": np.array([5.0, 6.0])}, {"P": 3.0 * np.eye(2)}):
        changed = replace(belief, **change)
        by_hand = Estimate(changed.theta, changed.P)
        assert_same(LAW.update(changed, PHI, Y), LAW.update(by_hand, PHI, Y))


@pytest.mark.parametrize(
    "copied", [copy.deepcopy, lambda belief: pickle.loads(pickle.dumps(belief))]
)
def test_a_copied_belief_learns_what_the_first_one_learns(copied):
    belief = learned()
    assert_same(LAW.update(copied(belief), PHI, Y), LAW.update(belief, PHI, Y))


def test_a_refused_sample_leaves_the_belief_as_it_was():
    belief = learned()
    refused = LAW.update(belief, PHI, np.nan)
    assert refused.rejected
    assert_same(LAW.update(refused, PHI, Y), LAW.update(belief, PHI, Y))


def test_a_stack_learns_what_the_estimate_in_it_learns_and_is_read_only():
    belief = learned()
    rows, innovation, innovation_var, _ = LAW.learn(stack(belief), PHI, Y)
    after = LAW.update(belief, PHI, Y)
    assert rows.tolist() == stack(after).tolist()
    assert (innovation, innovation_var) == (after.innovation, after.innovation_var)
    with pytest.raises(ValueError, match="read-only"):
        rows[0] = 1.0
    assert LAW.learn(stack(belief), PHI, np.nan) is None


@pytest.mark.parametrize("n", [1, 2])
def test_the_stack_of_a_guarded_estimate_holds_the_covariance_that_was_capped(n):
    belief = Guarded(LAW, covariance_max=0.5).update(start(n, 9.0), np.full(n, 0.1), 0.3)
    assert belief.P.diagonal() == pytest.approx(np.full(n, 0.5))
    assert stack(belief).tolist() == [belief.theta.tolist(), *belief.P.tolist()]
    assert not belief.rows.flags.writeable


@pytest.mark.parametrize("law", [LAW, Guarded(LAW, covariance_max=0.1)])
def test_what_was_learnt_goes_into_the_next_update_without_a_copy(law):
    rng, belief = np.random.default_rng(4), law.update(start(2), PHI, Y)
    for _ in range(3):
        assert stack(belief) is belief.rows
        belief = law.update(belief, rng.normal(size=2), Y)
