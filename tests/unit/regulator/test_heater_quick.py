"""The watch over a heater that warms by kelvins in a second: a block with a bath around it."""

import numpy as np
import pytest

from thermoctl.regulator.heater.check import HeaterCheck
from thermoctl.regulator.heater.known import KnownHeater
from thermoctl.regulator.heater.response import Gain
from thermoctl.regulator.heater.watch import HeaterWatch
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.supervisor import Supervisor
from thermoctl.signals import Measurement, State

LIMITS = Limits(200.0, -50.0, -50.0, 200.0)
LEARNT_S = 1200
ROSE_K = (0.2, 2.4, 6.4, 10.5, 11.6, 10.8, 9.6, 8.3, 7.1, 6.1, 5.3, 4.4, 3.6, 3.0, 2.4, 1.9)
"""What a block shows of three seconds of full power, in a bath that soon has all of it."""


def test_a_rise_before_the_power_went_is_no_rise_without_power():
    told = []
    supervisor = Supervisor(LIMITS, lambda name, **_: told.append(name))
    watch = HeaterWatch(HeaterCheck(), 1.0, supervisor, lambda name, **_: told.append(name))
    rng, block_c, shown_c, applied = np.random.default_rng(1), 40.0, 40.0, 0.0
    for second in range(LEARNT_S + 60):
        block_c += 0.5 * applied - 0.075
        shown_c += (block_c - shown_c) / 2.0
        since_s = second - LEARNT_S
        extra_k = ROSE_K[since_s] if 0 <= since_s < len(ROSE_K) else 0.0
        watch.observe(float(second), 1.0, shown_c + extra_k + 0.05 * rng.standard_normal(), applied)
        asked = 0.6 * (second % 120 < 30) if since_s < -1 else float(since_s < 2)
        applied = 0.0 if watch.asks or supervisor.state is not State.RUN else asked
    assert "heater.questioned" in told
    assert "heater.stuck_on" not in told


def test_a_heater_of_which_more_was_needed_has_not_become_stronger():
    known = KnownHeater()
    known.recall(Gain(0.01, 0.001, 3))
    known.accept(Gain(0.03, 0.001, 3), more=False)  # the door has just been opened
    assert known.gain.mean == 0.01
    known.accept(Gain(0.004, 0.0003, 3), more=False)
    assert known.gain.mean == 0.004
    known.accept(Gain(0.01, 0.001, 3))
    assert known.gain.mean == 0.01


@pytest.mark.parametrize("cools", [1.2, 1.5, 2.0, 3.0])
def test_what_falls_with_every_heat_and_stops_with_it_is_the_heater_s_doing(cools):
    told = []
    supervisor = Supervisor(LIMITS, lambda name, **_: told.append(name))
    watch = HeaterWatch(HeaterCheck(), 1.0, supervisor, lambda name, **_: told.append(name))
    rng, lag, water_c, applied = np.random.default_rng(1), [0.0, 0.0], 40.0, 0.0
    for second in range(6000):
        turned = second >= 2400  # by now it cools, and more than it has ever heated
        lag[0] += (applied - lag[0]) / 10.0
        lag[1] += (lag[0] - lag[1]) / 10.0
        water_c += (-cools if turned else 1.0) * 0.006 * lag[1] - 0.0015
        reading_c = water_c + 0.02 * rng.standard_normal()
        supervisor.judge(Measurement(float(second), reading_c), float(second), 1.0)
        watch.observe(float(second), 1.0, reading_c, applied)
        state = supervisor.rule(float(second), 0.0)
        asked = 1.0 if turned or second % 400 < 100 else 0.0
        applied = 0.0 if watch.asks or state is not State.RUN else asked
    assert supervisor.state is State.LATCHED
    assert "heater.reversed" in told
