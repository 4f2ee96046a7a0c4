"""The identifier: gaps, unknown pasts, prediction."""

import math

import numpy as np
import pytest

from thermoctl.estimation import CorrectedKalman, Identifier, RecursiveLeastSquares
from thermoctl.model.arx import Arx, KnownGain

TRUTH = np.array([-1.6, 0.63, 0.2, 0.1])  # a1, a2, b1, b2


def plant(T, delay=1):
    """Return temperatures and the power applied BEFORE each of them."""
    u = np.random.default_rng(8).uniform(size=T)
    y = np.full(T, 20.0)
    for t in range(delay + 2, T):
        past = np.array([-y[t - 1], -y[t - 2], u[t - delay + 1], u[t - delay]])
        y[t] = past @ TRUTH
    return y, u


def fed(identifier, y, u, belief=None):
    belief = identifier.start() if belief is None else belief
    for temperature, applied in zip(y, u, strict=True):
        belief = identifier.update(belief, float(temperature), float(applied))
    return belief


@pytest.mark.parametrize("delay", [1, 3])
def test_the_parameters_of_a_noiseless_plant_are_found(delay):
    identifier = Identifier(Arx(2, 2, delay), RecursiveLeastSquares(), P0=1e8)
    y, u = plant(200, delay)
    belief = fed(identifier, y[10:], u[10:])
    np.testing.assert_allclose(belief.estimate.theta, TRUTH, atol=1e-6)


def test_prediction_is_the_plant_s_next_temperature():
    identifier = Identifier(Arx(2, 2), RecursiveLeastSquares(), theta0=TRUTH)
    y, u = plant(60)
    belief = fed(identifier, y[5:50], u[5:50])
    assert identifier.predict(belief, float(u[50])) == pytest.approx(y[50], abs=1e-9)


def test_the_newest_sample_and_power_stand_first_in_the_past():
    belief = fed(Identifier(Arx(2, 2), CorrectedKalman()), [20.0, 21.0, 22.0], [0.1, 0.2, 0.3])
    assert belief.y_past_c.tolist() == [22.0, 21.0]
    assert belief.u_past.tolist() == [0.3, 0.2]
    assert not belief.y_past_c.flags.writeable
    assert not belief.u_past.flags.writeable


def test_nothing_is_learned_before_the_past_is_whole():
    identifier = Identifier(Arx(2, 2, delay=2), CorrectedKalman())
    belief, used = identifier.start(), []
    for _ in range(5):
        belief = identifier.update(belief, 30.0, 0.5)
        used.append(not belief.estimate.rejected)
    # u(t-2) and u(t-3) are known at the third sample, y(t-2) is too.
    assert used == [False, False, True, True, True]


def test_a_missing_sample_pauses_learning_until_it_has_left_the_regressor():
    identifier = Identifier(Arx(2, 1), CorrectedKalman())
    belief = fed(identifier, [20.0, 20.5, 21.0, 21.2], [0.5] * 4)
    theta, used = belief.estimate.theta, []
    for temperature in (math.nan, 22.0, 22.1, 22.3):
        before = belief.estimate.theta
        belief = identifier.update(belief, temperature, 0.5)
        used.append(belief.estimate.theta is not before)
    assert used == [False, False, False, True]
    assert np.isfinite(belief.estimate.theta).all()
    assert not np.array_equal(theta, belief.estimate.theta)


def test_a_gap_teaches_nothing_wrong():
    identifier = Identifier(Arx(2, 2), RecursiveLeastSquares(), P0=1e8)
    y, u = plant(200)
    y[60], y[61], u[120] = math.nan, math.nan, math.nan
    np.testing.assert_allclose(fed(identifier, y[3:], u[3:]).estimate.theta, TRUTH, atol=1e-6)


def test_prediction_is_not_known_while_the_past_is_not():
    identifier = Identifier(KnownGain(0.04), CorrectedKalman(), theta0=[1.0])
    belief = identifier.start()
    assert math.isnan(identifier.predict(belief, 0.5))
    belief = identifier.update(belief, 30.0, math.nan)
    assert identifier.predict(belief, 0.5) == pytest.approx(30.02)
    assert math.isnan(identifier.predict(belief, math.nan))
    assert math.isnan(identifier.predict(identifier.update(belief, math.nan, 0.5), 0.5))


def test_an_update_leaves_the_belief_before_it_as_it_was():
    identifier = Identifier(Arx(1, 1), CorrectedKalman())
    before = fed(identifier, [20.0, 21.0], [0.0, 0.5])
    y_past_c, u_past, theta = (
        before.y_past_c.copy(),
        before.u_past.copy(),
        before.estimate.theta.copy(),
    )
    identifier.update(before, 25.0, 1.0)
    assert np.array_equal(before.y_past_c, y_past_c)
    assert np.array_equal(before.u_past, u_past)
    assert np.array_equal(before.estimate.theta, theta)


@pytest.mark.parametrize("wrong", [None, "20", 1j, [20.0], True])
def test_a_reading_and_a_power_that_are_no_numbers_are_named(wrong):
    identifier = Identifier(KnownGain(0.04), CorrectedKalman())
    with pytest.raises(ValueError, match=r"^temperature_c must be a"):
        identifier.update(identifier.start(), wrong, 0.5)
    with pytest.raises(ValueError, match=r"^applied must be a"):
        identifier.update(identifier.start(), 20.0, wrong)


@pytest.mark.parametrize(("name", "value"), [("theta0", [1.0, 2.0]), ("P0", np.eye(2))])
def test_a_start_that_does_not_fit_the_structure_is_named(name, value):
    with pytest.raises(ValueError, match=name):
        Identifier(KnownGain(0.04), CorrectedKalman(), **{name: value})
