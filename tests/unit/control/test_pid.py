"""The PID with gains as they are given: its loop, its limits, and whom it takes over from."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.control.pid import Pid
from thermoctl.control.pid.simc import Gains
from thermoctl.control.pid.terms import PidTerms, Terms
from thermoctl.estimation import start
from thermoctl.ports import Situation
from thermoctl.signals import Beliefs

NO_PAST = np.empty(0)
SETPOINT_C = 40.0


def at(temperature_c, applied=0.0, setpoint_c=SETPOINT_C, t_s=0.0, interval_s=1.0):
    return Situation(
        t_s,
        interval_s,
        temperature_c,
        setpoint_c,
        applied,
        start(1),
        NO_PAST,
        NO_PAST,
        temperature_c,
    )


def fixed(gain_per_k=0.5, integral_s=100.0, **other):
    return Pid(gain_per_k=gain_per_k, integral_s=integral_s, tuning="fixed", **other)


class Loop:
    """A law in charge of a power that somebody may limit."""

    def __init__(self, law, low=0.0, high=1.0):
        self.law, self.belief, self.applied = law, law.start(), 0.0
        self.low, self.high, self.asked = low, high, math.nan

    def sample(self, temperature_c, setpoint_c=SETPOINT_C, interval_s=1.0):
        situation = at(temperature_c, self.applied, setpoint_c, interval_s=interval_s)
        self.belief = self.law.observe(self.belief, situation)
        self.belief, self.asked = self.law.decide(self.belief, situation)
        self.applied = min(max(self.asked, self.low), self.high)
        return self.asked

    def watch(self, temperature_c, applied, setpoint_c=SETPOINT_C):
        """Let somebody else give `applied`, and show the law what comes of it."""
        self.applied = applied
        self.belief = self.law.observe(self.belief, at(temperature_c, applied, setpoint_c))


# -- the law ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("damping", [0.5, 0.7, 1.0, 1.5])
@pytest.mark.slow
def test_a_plant_of_first_order_gets_the_poles_the_gains_were_placed_for(damping):
    gain_k, lag_s, natural, h = 30.0, 200.0, 0.02, 0.05
    gain_per_k = (2.0 * damping * natural * lag_s - 1.0) / gain_k
    integral_s = gain_per_k * gain_k / (natural**2 * lag_s)
    loop = Loop(fixed(gain_per_k, integral_s, setpoint_weight=0.0), -math.inf, math.inf)
    loop.sample(0.0, 0.0, h)
    y, seen = 0.0, []
    for _ in range(int(400.0 / h)):
        loop.sample(y, 1.0, h)
        y += (gain_k * loop.applied - y) * -math.expm1(-h / lag_s)
        seen.append(y)
    s = np.roots([1.0, 2.0 * damping * natural, natural**2]).astype(complex)
    s[1] += 1e-9 * (s[0] == s[1])
    t_s = h * np.arange(1, len(seen) + 1)
    textbook = 1.0 - (s[1] * np.exp(s[0] * t_s) - s[0] * np.exp(s[1] * t_s)) / (s[1] - s[0])
    assert np.array(seen) == pytest.approx(textbook.real, abs=2e-3)


def test_the_integral_of_a_steady_error_grows_by_the_gain_in_each_integral_time():
    loop = Loop(fixed(0.1, 50.0))
    first = loop.sample(SETPOINT_C - 1.0)
    for _ in range(50):
        last = loop.sample(SETPOINT_C - 1.0)
    assert last - first == pytest.approx(0.1)


@pytest.mark.parametrize("weight", [0.0, 0.4, 1.0])
def test_a_step_of_the_set_point_meets_the_power_by_its_weight_and_no_derivative(weight):
    loop = Loop(fixed(0.1, 1e6, derivative_s=500.0, setpoint_weight=weight), -math.inf, math.inf)
    for _ in range(3):
        before = loop.sample(SETPOINT_C - 1.0)
    after = loop.sample(SETPOINT_C - 1.0, SETPOINT_C + 2.0)
    assert after - before == pytest.approx(0.1 * weight * 2.0, abs=1e-5)


def test_the_derivative_is_that_of_a_ramp_behind_its_filter():
    gain, derivative_s, n = 0.1, 30.0, 5.0
    with_it = Loop(fixed(gain, 1e9, derivative_s=derivative_s, derivative_filter=n), -1e9, 1e9)
    without = Loop(fixed(gain, 1e9), -1e9, 1e9)
    difference = [without.sample(20.0 + 0.01 * k) - with_it.sample(20.0 + 0.01 * k)
                  for k in range(200)]  # fmt: skip
    assert difference[0] == 0.0
    assert difference[-1] == pytest.approx(gain * derivative_s * 0.01, rel=0.1)
    filter_s = derivative_s / n
    settling = gain * n * 0.01 * math.exp(-1.0 / filter_s) / -math.expm1(-1.0 / filter_s)
    assert difference[-1] == pytest.approx(settling, rel=1e-9)


@pytest.mark.parametrize("seconds", [0.5, 3.0, 20.0])
def test_a_longer_interval_counts_for_its_length(seconds):
    long, short = Loop(fixed(0.1)), Loop(fixed(0.1))
    for loop in (long, short):
        loop.sample(39.0)
    for _ in range(int(seconds / 0.5)):
        after_short = short.sample(39.5, interval_s=0.5)
    assert long.sample(39.5, interval_s=seconds) == pytest.approx(after_short)


def test_after_a_gap_longer_than_the_integral_time_it_goes_on_from_what_was_applied():
    loop = Loop(fixed(0.1, 100.0))
    for _ in range(20):
        loop.sample(38.0)
    held = loop.applied
    assert loop.sample(36.0, interval_s=500.0) == pytest.approx(held)


# -- no wind-up ------------------------------------------------------------------------------------


@pytest.mark.parametrize("high", [1.0, 0.6, 0.25])
def test_an_hour_at_any_limit_leaves_no_trace(high):
    limited, fresh = Loop(fixed(), high=high), Loop(fixed(), high=high)
    for _ in range(3600):
        limited.sample(30.0)
    fresh.sample(30.0)
    for loop in (limited, fresh):
        loop.sample(SETPOINT_C + 0.1)
    assert limited.applied <= fresh.applied + 1e-12
    assert limited.applied == 0.0


def test_an_hour_too_hot_does_not_delay_the_power_that_is_needed():
    loop = Loop(fixed())
    for _ in range(3600):
        loop.sample(45.0)
    loop.sample(SETPOINT_C - 0.2)
    assert loop.applied >= 0.1


def test_an_integral_that_was_true_survives_a_disturbance_that_saturates():
    loop = Loop(fixed())
    for _ in range(2):
        loop.watch(SETPOINT_C, 0.3)
    loop.sample(SETPOINT_C)
    for _ in range(600):
        loop.sample(SETPOINT_C - 5.0)
    assert loop.applied == 1.0
    first_of_them = 0.5 * 5.0 / 100.0
    assert loop.sample(SETPOINT_C) == pytest.approx(0.3 + first_of_them, abs=1e-9)


def test_an_integral_above_what_somebody_allows_comes_down_to_it():
    loop = Loop(fixed())
    loop.watch(SETPOINT_C, 0.8)
    loop.watch(SETPOINT_C, 0.8)
    loop.high = 0.2
    for _ in range(1500):
        loop.sample(SETPOINT_C)
    assert loop.asked == pytest.approx(0.2, abs=0.011)


def test_more_power_than_it_asked_for_is_somebody_elses_and_is_followed():
    loop = Loop(fixed(), low=0.3)
    loop.watch(SETPOINT_C, 0.1)
    loop.watch(SETPOINT_C, 0.1)
    assert loop.sample(SETPOINT_C) == pytest.approx(0.1)
    assert loop.sample(SETPOINT_C - 0.2) == pytest.approx(0.3)


def test_an_hour_too_hot_leaves_the_power_that_holds():
    loop = Loop(fixed())
    for _ in range(2):
        loop.watch(SETPOINT_C, 0.3)
    loop.sample(SETPOINT_C)
    for _ in range(3600):
        loop.sample(45.0)
    last_of_them = 0.5 * 5.0 / 100.0
    assert loop.sample(SETPOINT_C) == pytest.approx(0.3 - last_of_them, abs=1e-9)


def test_a_debt_from_taking_over_far_away_is_paid_on_the_way_and_no_more():
    loop = Loop(fixed())
    for _ in range(2):
        loop.watch(30.0, 0.0)
    for _ in range(1000):
        loop.sample(30.0)
    assert loop.applied == 1.0
    assert loop.sample(SETPOINT_C) == pytest.approx(0.0, abs=1e-9)


# -- bumpless --------------------------------------------------------------------------------------


@pytest.mark.parametrize("weight", [0.3, 1.0])
@pytest.mark.parametrize("power", [0.0, 0.07, 0.5, 1.0])
@pytest.mark.parametrize("temperature_c", [20.0, 39.5, 41.0])
def test_it_takes_over_from_a_person_at_the_power_that_person_gave(power, temperature_c, weight):
    loop = Loop(fixed(derivative_s=10.0, setpoint_weight=weight))
    for k in range(20):
        loop.watch(temperature_c + 0.1 * math.sin(k), power)
    loop.belief, asked = loop.law.decide(loop.belief, at(temperature_c, power))
    assert asked == pytest.approx(power, abs=1e-9)


def test_in_charge_from_the_first_sample_on_it_begins_with_the_proportional_term():
    assert Loop(fixed(0.1)).sample(SETPOINT_C - 2.0) == pytest.approx(0.2, abs=1e-9)


def test_it_steers_the_same_after_it_was_away_as_somebody_who_saw_only_the_end():
    long, short = Loop(fixed()), Loop(fixed())
    for k in range(500):
        long.sample(39.0 + 0.001 * k)
    for loop in (long, short):
        for _ in range(3):
            loop.watch(39.5, 0.4)
    assert long.sample(39.6) == pytest.approx(short.sample(39.6))


# -- what is not known -----------------------------------------------------------------------------


@pytest.mark.parametrize("unknown", [at(math.nan), at(30.0, setpoint_c=math.nan), at(math.inf)])
def test_it_asks_for_no_number_while_something_is_not_known(unknown):
    law = fixed()
    belief = law.observe(law.start(), unknown)
    assert math.isnan(law.decide(belief, unknown)[1])


def test_readings_that_are_missing_change_nothing_but_time():
    loop = Loop(fixed())
    for _ in range(5):
        before = loop.sample(39.8)
    for _ in range(10):
        loop.watch(math.nan, loop.applied)
    assert loop.sample(39.8) == pytest.approx(before, abs=1e-6)


def test_it_believes_nothing_remarks_nothing_and_does_not_ride():
    loop = Loop(fixed())
    loop.sample(30.0)
    assert loop.law.beliefs(loop.belief, at(30.0)) == Beliefs()
    assert loop.law.remarks(loop.belief) == {}
    assert loop.law.ride_s(loop.belief) == 0.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("gain_per_k", value) for value in (0.0, -1.0, math.nan, "1")),
        *(("integral_s", value) for value in (0.0, math.inf)),
        ("derivative_s", -1.0),
        ("derivative_filter", 0.5),
        ("setpoint_weight", 1.5),
        ("tuning", "magic"),
        ("tuned_form", "p"),
        ("tuning_limit_s", 0.0),
        ("relay_amplitude", 0.6),
        ("period_s", 0.0),
    ],
)
def test_a_constructor_names_the_argument_that_is_wrong(name, value):
    with pytest.raises(ValueError, match=name):
        replace(Pid(), **{name: value})


@pytest.mark.parametrize(("keeps", "least", "most"), [(True, 0.09, 0.12), (False, 0.8, 0.8)])
def test_a_block_that_cools_down_is_no_other_law_that_steers(keeps, least, most):
    law = PidTerms(Gains(0.1, 100.0))
    terms = replace(law.at_rest(law.see(Terms(), 41.0, 1.0), 40.0, 0.2), asked=0.1)
    after = law.integrate(terms, 40.0, 0.8, 1.0, keeps=keeps)
    assert least - 1e-9 <= law.power(after, 40.0) <= most + 1e-9
