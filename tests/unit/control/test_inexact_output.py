"""Outputs that give something else than was commanded, and say so."""

import math

import numpy as np
import pytest

from thermoctl.control.adaptive import Adaptive
from thermoctl.control.pid import Pid
from thermoctl.estimation import start
from thermoctl.ports import Situation

NOTHING = start(n=1)
PAST = np.zeros(1)
SETPOINT_C = 40.0

LAWS = {
    "adaptive": Adaptive(),
    "pid": Pid(gain_per_k=0.3, integral_s=120.0, tuning="fixed"),
    "pid, tuned": Pid(tuning="simc"),
}
OUTPUTS = {
    "more by a share": lambda power: 1.05 * power,
    "more by much": lambda power: 1.2 * power,
    "more by as much always": lambda power: power + 0.03,
    "less by a share": lambda power: 0.8 * power,
    "less by as much always": lambda power: power - 0.02,
    "rounded up to fiftieths": lambda power: math.ceil(50.0 * power) / 50.0,
    "rounded down to fiftieths": lambda power: math.floor(50.0 * power) / 50.0,
}


class Relay:
    """An output that is on or off, for at least so many samples, and right in the mean."""

    def __init__(self, least):
        self.least, self.since, self.on, self.owed = least, least, 0.0, 0.0

    def __call__(self, power):
        if self.since >= self.least and (self.owed + power >= 0.5) is not bool(self.on):
            self.on, self.since = 1.0 - self.on, 0
        self.owed += power - self.on
        self.since += 1
        return self.on


class Tank:
    """Water behind a heater of 8 s and a sensor of 6 s, in a room of 20 degC."""

    def __init__(self):
        self.water_c = self.sensor_c = 35.0
        self.heat = 0.0
        self.random = np.random.default_rng(3)

    def after(self, power):
        self.heat += (power - self.heat) / 8.0
        self.water_c += 0.04 * self.heat - 4e-4 * (self.water_c - 20.0)
        self.sensor_c += (self.water_c - self.sensor_c) / 6.0
        return self.sensor_c + 0.01 * self.random.standard_normal()


def held(law, output, seconds=2400, most=1.0):
    """Return the errors of the water while `law` holds it with `output`, in K."""
    tank, belief, command, applied, errors_k = Tank(), law.start(), 0.0, 0.0, []
    for _ in range(seconds):
        y_c = tank.after(applied)
        situation = Situation(
            0.0, 1.0, y_c, SETPOINT_C, applied, NOTHING, PAST, PAST, y_c, commanded=command
        )
        belief, asked = law.decide(law.observe(belief, situation), situation)
        command = min(max(asked, 0.0), most)
        applied = min(max(output(command), 0.0), 1.0) if command > 0.0 else 0.0
        errors_k.append(tank.water_c - SETPOINT_C)
    return np.array(errors_k)


@pytest.mark.slow
@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("law", LAWS)
def test_what_an_output_adds_or_leaves_out_is_made_up_for(law, output):
    errors_k = held(LAWS[law], OUTPUTS[output])
    assert abs(errors_k[-1000:].mean()) < 0.005
    assert np.abs(errors_k[-1000:]).max() < 0.1


@pytest.mark.parametrize("law", LAWS)
def test_an_output_that_is_limited_winds_nothing_up(law):
    exact, limited = (
        held(LAWS[law], output, 900) for output in (lambda p: p, lambda p: min(p, 0.5))
    )
    assert limited.max() < exact.max()


@pytest.mark.slow
@pytest.mark.parametrize("law", ["pid", "pid, tuned", "adaptive"])
@pytest.mark.parametrize("least", [2, 5])
def test_a_relay_that_leaves_out_what_it_gave_too_much_is_not_limited(law, least):
    errors_k = held(LAWS[law], Relay(least), 4800)
    assert abs(errors_k[-2400:].mean()) < 0.01


def test_an_output_that_was_ahead_is_limited_once_it_has_left_that_out():
    law = Pid(gain_per_k=0.3, integral_s=120.0, tuning="fixed", setpoint_weight=1.0)
    belief, integrals, command = law.start(), [], 0.5
    for applied in (0.5, *[1.0] * 5, *[0.0] * 60):
        y_c = SETPOINT_C - 2.0
        situation = Situation(
            0.0, 1.0, y_c, SETPOINT_C, applied, NOTHING, PAST, PAST, y_c, commanded=command
        )
        belief, command = law.decide(law.observe(belief, situation), situation)
        integrals.append(belief.terms.integral)
    grows = np.diff(integrals) > 0.0
    assert belief.ahead_s == 0.0
    assert grows[:8].all()  # five pulses of .4 beyond, left out in less than four samples of .6
    assert not grows[10:].any()


def test_who_asks_for_no_power_commands_none_whatever_the_output_has_left_out():
    law, asked = LAWS["adaptive"], []
    belief = law.start()
    for second in range(120):
        y_c = SETPOINT_C + (0.05 if second < 80 else 4.0)
        situation = Situation(
            0.0, 1.0, y_c, SETPOINT_C, 0.1, NOTHING, PAST, PAST, y_c, commanded=0.15
        )
        belief, power = law.decide(law.observe(belief, situation), situation)
        asked.append(power)
    assert belief.inexact.more == pytest.approx(-0.05, abs=0.002)
    assert max(asked[100:]) == 0.0
