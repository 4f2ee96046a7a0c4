"""Self-tuning minimum variance: the law as printed, its guards, and what it believes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.control.minimum_variance import SelfTuningMinimumVariance
from thermoctl.estimation import Identifier, RandomWalkKalman, start
from thermoctl.model.arx import Arx, KnownGain
from thermoctl.ports import Situation

B = 0.0449


def situation(theta, temperature_c=37.0, setpoint_c=37.5, y=(37.0,), u=(0.2,), P0=1e-12, h=1.0):
    return Situation(
        t_s=0.0,
        interval_s=h,
        temperature_c=temperature_c,
        setpoint_c=setpoint_c,
        applied=u[0],
        estimate=start(len(theta), P0, theta),
        y_past_c=np.array(y),
        u_past=np.array(u),
    )


def power(law, *args, **kwargs):
    return law.decide(law.start(), situation(*args, **kwargs))[1]


def test_with_a_known_gain_the_power_is_that_of_the_paper():
    law = SelfTuningMinimumVariance(KnownGain(B))
    assert power(law, [0.98]) == pytest.approx((37.5 - 0.98 * 37.0) / B)  # O21 (23), (27)


def test_the_general_law_is_that_of_the_paper():
    law = SelfTuningMinimumVariance(Arx(3, 3))
    a, b = (-1.2, 0.3, 0.05), (0.4, 0.2, 0.1)
    y, u = (37.0, 36.8, 36.1), (0.25, 0.5, 0.75)
    printed = (a[0] * y[0] + a[1] * y[1] + a[2] * y[2] - b[1] * u[0] - b[2] * u[1] + 37.5) / b[
        0
    ]  # O21 (23)
    assert power(law, [*a, *b], y=y, u=u) == pytest.approx(printed)


def test_centre_and_scales_do_not_change_the_power():
    plain, scaled = Arx(1, 2), Arx(1, 2, y_scale_k=8.0, u_scale=0.25)
    expected = power(SelfTuningMinimumVariance(plain), [-0.98, 0.04, 0.02], u=(0.3, 0.1))
    theta = [-0.98, 0.04 * 0.25 / 8.0, 0.02 * 0.25 / 8.0]
    assert power(SelfTuningMinimumVariance(scaled), theta, u=(0.3, 0.1)) == pytest.approx(expected)
    centred = SelfTuningMinimumVariance(replace(scaled, y_centre_c=20.0))
    moved = power(centred, theta, 57.0, 57.5, y=(57.0,), u=(0.3, 0.1))
    shifted = power(SelfTuningMinimumVariance(scaled), theta, u=(0.3, 0.1))
    assert moved == pytest.approx(shifted)


def test_the_model_given_that_power_predicts_the_reference():
    identifier = Identifier(Arx(2, 2), RandomWalkKalman(), theta0=[-1.4, 0.45, 0.3, 0.1])
    belief = identifier.start()
    for temperature_c, applied in ((36.0, 0.1), (36.4, 0.3), (36.9, 0.6)):
        belief = identifier.update(belief, temperature_c, applied)
    law = SelfTuningMinimumVariance(identifier.structure, reference_time_s=20.0)
    asked = law.decide(
        None,
        Situation(0.0, 2.0, 36.9, 37.5, 0.6, belief.estimate, belief.y_past_c, belief.u_past),
    )[1]
    assert identifier.predict(belief, asked) == pytest.approx(36.9 + 0.6 * 2.0 / 20.0)


def test_a_reference_time_asks_for_a_share_of_the_error_only():
    law = SelfTuningMinimumVariance(KnownGain(B), reference_time_s=50.0)
    assert power(law, [1.0], h=2.0) == pytest.approx(0.5 * 2.0 / 50.0 / B)
    assert power(law, [1.0], h=80.0) == pytest.approx(0.5 / B)


def test_the_power_is_not_bounded_here():
    law = SelfTuningMinimumVariance(KnownGain(B))
    assert power(law, [1.0], 25.0) > 100.0
    assert power(law, [1.0], 90.0) < -100.0


def test_a_missing_newest_sample_is_replaced_by_the_temperature_given_for_it():
    law = SelfTuningMinimumVariance(Arx(2, 1))
    theta = [-1.5, 0.52, 0.1]
    ridden = power(law, theta, 37.2, y=(math.nan, 36.9))
    assert ridden == pytest.approx(power(law, theta, 37.2, y=(37.2, 36.9)))


def test_a_reading_that_is_missing_in_the_past_is_taken_to_have_been_this_one():
    law, theta = SelfTuningMinimumVariance(Arx(3, 1)), [-1.5, 0.42, 0.1, 0.1]
    gap = power(law, theta, 37.2, y=(37.2, math.nan, 36.9))
    assert gap == pytest.approx(power(law, theta, 37.2, y=(37.2, 37.2, 36.9)))


def test_before_the_start_no_power_was_given():
    law, theta = SelfTuningMinimumVariance(Arx(1, 3)), [-0.9, 0.1, 0.05, 0.02]
    first = power(law, theta, u=(0.3, math.nan))
    assert first == pytest.approx(power(law, theta, u=(0.3, 0.0)))


@pytest.mark.parametrize(
    "unknown",
    [
        {"temperature_c": math.nan},
        {"setpoint_c": math.nan},
        {"u": (0.1,), "theta": [-0.9, 0.1, 0.05, 0.02]},
        {"theta": [-0.9, 0.0, 0.0]},
    ],
)
def test_the_power_is_nan_while_something_is_not_known(unknown):
    unknown = {"theta": [-0.9, 0.1, 0.05]} | unknown
    structure = Arx(1, len(unknown["theta"]) - 1)
    assert math.isnan(power(SelfTuningMinimumVariance(structure), **unknown))


def test_a_gain_below_its_bound_or_of_the_wrong_sign_is_projected():
    law = SelfTuningMinimumVariance(Arx(1, 1), gain_min_k=0.01)
    expected = (37.5 - 0.98 * 37.0) / 0.01
    for b in (0.005, 0.0, -0.04):
        assert power(law, [-0.98, b]) == pytest.approx(expected)
    assert power(law, [-0.98, 0.02]) == pytest.approx(expected / 2)


def steady(law, structure, theta, steps):
    """Return the powers asked for when the plant is the model and nothing is bounded."""
    y, u = [30.0] * structure.n, [0.0] * structure.u_memory
    asked = []
    for _ in range(steps):
        asked.append(power(law, theta, y[0], 40.0, y=tuple(y), u=tuple(u)))
        u = [asked[-1], *u[:-1]]
        phi = structure.regressor(np.array(y), np.array(u))
        y = [float(phi @ np.array(theta)), *y[:-1]]
    return np.array(asked), y[0]


def test_zeros_outside_the_unit_circle_are_not_cancelled():
    structure, theta = Arx(1, 2), [-0.95, 0.1, 0.2]
    asked, _ = steady(
        SelfTuningMinimumVariance(structure, zero_radius=math.inf), structure, theta, 40
    )
    assert np.abs(asked).max() > 1e9
    detuned = SelfTuningMinimumVariance(structure, reference_time_s=5.0)
    asked, last_c = steady(detuned, structure, theta, 200)
    assert np.abs(asked).max() < 20.0
    assert last_c == pytest.approx(40.0, abs=0.01)


def test_a_first_input_without_effect_is_a_zero_that_cannot_be_cancelled():
    law = SelfTuningMinimumVariance(Arx(1, 2))
    assert power(law, [-0.9, 0.0, 0.1], u=(7.0, 7.0)) == pytest.approx((37.5 - 0.9 * 37.0) / 0.1)


def test_zeros_inside_the_unit_circle_are_cancelled():
    structure, theta = Arx(1, 3), [-0.95, 0.2, 0.1, 0.01]
    law = SelfTuningMinimumVariance(structure)
    asked, last_c = steady(law, structure, theta, 3)
    assert last_c == pytest.approx(40.0, abs=1e-9)
    assert np.isfinite(asked).all()


def test_switching_to_it_gives_the_power_it_would_have_given_all_along():
    structure = Arx(1, 2)
    identifier = Identifier(structure, RandomWalkKalman(1e-4, 0.01), theta0=[-0.98, 0.05, 0.02])
    law = SelfTuningMinimumVariance(structure, reference_time_s=30.0)
    rng, others, asked = np.random.default_rng(0), [], []
    belief, y = identifier.start(), 37.0
    for _ in range(20):  # somebody else steers; this law looks on, and then is asked at once
        u = float(rng.uniform())
        y = 0.98 * y + 0.05 * u + 0.6
        belief = identifier.update(belief, y, u)
        here = Situation(0.0, 1.0, y, 37.5, u, belief.estimate, belief.y_past_c, belief.u_past)
        others.append(law.decide(law.start(), here)[1])
        asked.append(u)
    assert law.decide(law.start(), here)[1] == others[-1]
    changed = replace(here, u_past=here.u_past + 0.1)  # what was applied is what counts
    moved = law.decide(law.start(), changed)[1] - others[-1]
    b1, b2 = belief.estimate.theta[1:]
    assert moved == pytest.approx(-0.1 * b2 / b1)


def test_beliefs_of_a_known_gain_are_the_learned_pole_and_the_given_gain():
    law = SelfTuningMinimumVariance(KnownGain(B))
    believed = law.beliefs(None, situation([0.9997], P0=4e-12, h=2.0))
    assert believed.gain == pytest.approx(B / 2.0)
    assert believed.gain_sd is None
    assert believed.a == 0.9997
    assert believed.a_sd == pytest.approx(2e-6)
    assert believed.holding_power == pytest.approx(0.0003 * 37.5 / B)


def test_beliefs_of_a_first_order_model_are_its_gain_and_pole_with_their_errors():
    law = SelfTuningMinimumVariance(Arx(1, 2, y_centre_c=20.0, y_scale_k=10.0, u_scale=0.5))
    P0 = np.diag([1e-8, 4e-8, 9e-8])
    believed = law.beliefs(None, situation([-0.99, 0.01, 0.02], P0=P0, h=2.0))
    assert believed.gain == pytest.approx(0.03 * 10.0 / 0.5 / 2.0)
    assert believed.gain_sd == pytest.approx(math.sqrt(13e-8) * 10.0 / 0.5 / 2.0)
    assert believed.a == 0.99
    assert believed.a_sd == pytest.approx(1e-4)
    assert believed.holding_power == pytest.approx(0.01 * 1.75 / 0.03 * 0.5)


def test_holding_power_keeps_the_model_at_its_set_point():
    structure = Arx(2, 2, y_centre_c=20.0)
    law, theta = SelfTuningMinimumVariance(structure), [-1.5, 0.51, 0.3, 0.1]
    held = law.beliefs(None, situation(theta)).holding_power
    phi = structure.regressor(np.full(2, 37.5), np.full(2, held))
    assert structure.temperature(phi @ np.array(theta), np.full(2, held)) == pytest.approx(37.5)


def test_the_error_of_the_holding_power_is_that_of_its_linearisation():
    law = SelfTuningMinimumVariance(Arx(1, 1, y_centre_c=20.0))
    theta, P0 = np.array([-0.99, 0.5]), np.diag([1e-6, 1e-3])
    h = lambda v: (1.0 + v[0]) * 17.5 / v[1]  # noqa: E731
    slope = [(h(theta + d) - h(theta - d)) / 2e-6 for d in 1e-6 * np.eye(2)]
    sd = math.sqrt(slope @ P0 @ np.array(slope))
    just, too_vague = (P0 * (0.05 / sd) ** 2 * factor for factor in (0.999, 1.001))
    assert law.beliefs(None, situation(theta, P0=just)).holding_power is not None
    assert law.beliefs(None, situation(theta, P0=too_vague)).holding_power is None


@pytest.mark.parametrize(
    ("structure", "theta"), [(KnownGain(B), [0.9997]), (Arx(1, 1), [-0.99, 0.04])]
)
def test_holding_power_is_not_told_while_the_model_is_vague(structure, theta):
    law = SelfTuningMinimumVariance(structure)
    assert law.beliefs(None, situation(theta, P0=1.0)).holding_power is None


def test_holding_power_is_a_power():
    law = SelfTuningMinimumVariance(KnownGain(B))
    assert law.beliefs(None, situation([1.01])).holding_power == 0.0
    assert law.beliefs(None, situation([0.9])).holding_power == 1.0


@pytest.mark.parametrize(("reference_time_s", "ride_s"), [(0.0, 0.0), (40.0, 40.0), (90.0, 60.0)])
def test_it_may_steer_without_a_sensor_for_three_lags_up_to_a_minute(reference_time_s, ride_s):
    law = SelfTuningMinimumVariance(KnownGain(B), reference_time_s)
    assert law.ride_s(law.start()) == ride_s


@pytest.mark.parametrize(
    ("error", "name", "arguments"),
    [
        (TypeError, "structure", {"structure": "arx"}),
        (ValueError, "structure", {"structure": Arx(1, 0)}),
        *(
            (ValueError, "reference_time_s", {"reference_time_s": v})
            for v in (-1.0, math.nan, math.inf)
        ),
        *((ValueError, "gain_min_k", {"gain_min_k": v}) for v in (-1.0, math.nan, math.inf)),
        *((ValueError, "on_zeros", {"on_zeros": v}) for v in ("cancel", None, True)),
        *((ValueError, "zero_radius", {"zero_radius": v}) for v in (0.0, -1.0, math.nan, None)),
    ],
)
def test_a_constructor_names_the_argument_that_is_wrong(error, name, arguments):
    with pytest.raises(error, match=name):
        SelfTuningMinimumVariance(**{"structure": KnownGain(B)} | arguments)
