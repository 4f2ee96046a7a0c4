"""The PID with a heater and a cooler behind one signed power: it reckons in heat."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.control.pid import Pid
from thermoctl.control.pid.terms import TOLERANCE
from thermoctl.estimation import start
from thermoctl.ports import Situation

NO_PAST = np.empty(0)
SETPOINT_C = 20.0


def at(temperature_c, applied=0.0, commanded=math.nan, setpoint_c=SETPOINT_C):
    return Situation(0.0, 1.0, temperature_c, setpoint_c, applied, start(1), NO_PAST, NO_PAST,
                     temperature_c, commanded=commanded)  # fmt: skip


def fixed(ratio, gain_per_k=0.5, integral_s=100.0):
    return Pid(gain_per_k, integral_s, tuning="fixed", action="heat-cool", cooling_ratio=ratio)


class Loop:
    """A law in charge of a signed power that somebody may limit."""

    def __init__(self, law, low=-1.0, high=1.0):
        self.law, self.belief, self.low, self.high = law, law.start(), low, high
        self.applied, self.asked = 0.0, math.nan

    def sample(self, temperature_c, setpoint_c=SETPOINT_C):
        situation = at(temperature_c, self.applied, self.applied, setpoint_c)
        self.belief = self.law.observe(self.belief, situation)
        self.belief, self.asked = self.law.decide(self.belief, situation)
        self.applied = min(max(self.asked, self.low), self.high)
        return self.asked


class Plant:
    """An integrator behind a lag, with a cooler of `ratio` times the heater and a load."""

    def __init__(self, ratio, water_c=SETPOINT_C, lag_s=20.0, noise_k=0.0):
        self.ratio, self.water_c, self.lag_s, self.noise_k = ratio, water_c, lag_s, noise_k
        self.heat, self.load, self.rng = 0.0, 0.0, np.random.default_rng(5)

    def after(self, power):
        heat = power * self.ratio if power < 0.0 else power
        self.heat += (heat - self.heat) / self.lag_s
        self.water_c += 0.04 * (self.heat + self.load)
        return self.water_c + self.noise_k * self.rng.standard_normal()


# -- the law ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.02, 0.2, 1.0, 5.0])
def test_power_below_zero_is_heat_over_the_ratio_and_above_it_is_heat(ratio):
    told, as_strong = (Loop(fixed(r), -math.inf, math.inf) for r in (ratio, 1.0))
    for temperature_c in 20.0 + 2.0 * np.sin(np.arange(200) / 15.0):
        power, heat = told.sample(temperature_c), as_strong.sample(temperature_c)
        assert power == pytest.approx(heat / ratio if heat < 0.0 else heat, abs=1e-12)
    assert power != 0.0


def test_with_a_cooler_as_strong_as_the_heater_it_is_the_law_that_heats_to_the_last_bit():
    both = Loop(Pid(0.5, 100.0, tuning="fixed", action="heat-cool"))
    heats = Loop(Pid(0.5, 100.0, tuning="fixed"))
    assert both.law.cooling_ratio == 1.0
    for temperature_c in 20.0 + 3.0 * np.sin(np.arange(400) / 15.0):
        assert both.sample(temperature_c) == heats.sample(temperature_c)


# -- what was applied ------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.1, 0.2, 1.0, 4.0])
@pytest.mark.parametrize("power", [-1.0, -0.35, -0.02, 0.0, 0.4])
@pytest.mark.parametrize("temperature_c", [18.0, 20.0, 25.0])
def test_it_takes_over_at_the_power_that_was_applied(temperature_c, power, ratio):
    law = fixed(ratio)
    belief = law.start()
    for _ in range(5):
        belief = law.observe(belief, at(temperature_c, power, power))
    assert law.decide(belief, at(temperature_c, power, power))[1] == pytest.approx(power, abs=1e-9)


@pytest.mark.parametrize(
    ("applied", "taken"),
    [(-0.55, -0.6), (-0.65, -0.6), (-0.2, -0.2)],
    ids=("a little less", "more", "limited"),
)
def test_how_exact_a_cooler_is_goes_by_its_power_however_weak_it_is(applied, taken):
    law = fixed(0.1)
    belief = law.start()
    for _ in range(5):
        belief = law.observe(belief, at(22.0, applied, -0.6))
    belief = replace(belief, ahead_s=0.0)
    assert law.decide(belief, at(22.0, applied, -0.6))[1] == pytest.approx(taken)


# -- limits ----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.1, 0.2, 1.0, 4.0])
@pytest.mark.parametrize("low", [-1.0, -0.5])
def test_an_hour_at_the_limit_of_the_cooler_leaves_no_trace(low, ratio):
    limited, fresh = Loop(fixed(ratio), low), Loop(fixed(ratio), low)
    for _ in range(3600):
        limited.sample(30.0)
    fresh.sample(30.0)
    for loop in (limited, fresh):
        loop.sample(SETPOINT_C - 0.1)
    assert limited.applied >= fresh.applied - 1e-12
    assert limited.applied > 0.0


@pytest.mark.parametrize("ratio", [0.2, 4.0])
def test_an_integral_beyond_what_the_cooler_may_comes_back_to_that_heat(ratio):
    law = fixed(ratio)
    loop = Loop(law)
    for _ in range(2):
        loop.belief = law.observe(loop.belief, at(SETPOINT_C, -0.9, -0.9))
    loop.applied, loop.low = -0.9, -0.3
    for _ in range(1500):
        loop.sample(SETPOINT_C)
    assert loop.asked == pytest.approx(-0.3, abs=1.1 * TOLERANCE / ratio)


def test_a_load_that_only_the_cooler_can_take_leaves_less_behind_where_the_ratio_is_told():
    largest_k, last_k = {}, {}
    for ratio in (1.0, 0.2):
        loop, plant, errors_k = Loop(fixed(ratio, 0.4, 240.0)), Plant(0.2), []
        for second in range(1800):
            plant.load = 0.1 if second >= 60 else 0.0
            loop.sample(plant.after(loop.applied))
            errors_k.append(abs(plant.water_c - SETPOINT_C))
        largest_k[ratio], last_k[ratio] = max(errors_k), max(errors_k[-900:])
    print(largest_k, last_k)
    assert largest_k[0.2] < 0.5 * largest_k[1.0]
    assert last_k[0.2] < 0.01 < last_k[1.0]


# -- tests are made with the heater ----------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("tuning", ["simc", "relay"])
def test_what_is_tuned_is_what_a_law_that_heats_finds(tuning):
    gains = []
    for options in ({}, {"action": "heat-cool", "cooling_ratio": 0.2}):
        loop, plant = Loop(Pid(tuning=tuning, **options), low=0.0), Plant(0.2, 12.0, noise_k=0.005)
        plant.load = -0.15
        while "controller.tuned" not in loop.law.remarks(loop.belief):
            loop.sample(plant.after(loop.applied))
            assert not loop.law.remarks(loop.belief).keys() & {"controller.tuning_failed"}
        loop.low = -1.0 if options else 0.0
        gains.append(loop.law.gains(loop.belief))
    assert gains[0] == gains[1]


def test_a_step_that_somebody_else_ends_with_the_cooler_tells_the_same_heater():
    law, plant, power = Pid(action="heat-cool", cooling_ratio=0.2), Plant(0.2, noise_k=0.002), 0.0
    belief, second = law.start(), 0
    while "controller.tuned" not in law.remarks(belief):
        seen = at(plant.after(power), power, power, setpoint_c=SETPOINT_C + 20.0)
        belief, _ = law.decide(law.observe(belief, seen), seen)
        second += 1
        assert second < 300
        power = 1.0 if second < 70 else -1.0
    print(second, law.remarks(belief))
    assert second > 100  # half a minute of the cooler
    assert law.beliefs(belief, seen).gain == pytest.approx(0.04, rel=0.1)
