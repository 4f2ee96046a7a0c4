"""A watch that begins in the middle of things: heat may be on its way that it has not seen."""

import math
from collections import deque

import numpy as np
import pytest

from thermoctl.regulator.heat_past import FirstReadings
from thermoctl.regulator.heater_watch import HeaterCheck, HeaterWatch
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.supervisor import Supervisor
from thermoctl.signals import Measurement, State

LIMITS = Limits(200.0, -50.0, -50.0, 200.0)


class Vessel:
    """A watch that is put to work anew, on a plant that is not: a gain behind two equal poles."""

    def __init__(self, gain=0.045, lag_s=45.0, loss=0.009, seed=1):
        self.gain, self.pole_s, self.loss = gain, 0.5 * lag_s, loss
        self.rng = np.random.default_rng(seed)
        self.t_s, self.water_c, self.applied = 0.0, 25.0, 0.0
        self.first = self.second = 0.0
        self.does = lambda power: power
        self.begin()

    def begin(self):
        self.events = deque()
        self.supervisor = Supervisor(LIMITS, self.emit)
        self.watch = HeaterWatch(HeaterCheck(), 1.0, self.supervisor, self.emit)
        self.applied = 0.0
        return self

    def emit(self, name, **fields):
        self.events.append((name, fields))

    def names(self):
        return [name for name, _ in self.events if name.startswith("heater.")]

    def pass_by(self, seconds):
        """Let time pass with nobody at the wheel, and no power."""
        for _ in range(seconds):
            self._flow(0.0)

    def warm_up(self, seconds, to_c=37.5):
        """Give full power below `to_c`, and none above."""
        for _ in range(seconds):
            self._flow(self.does(self.applied))
            reading_c = self.water_c + 0.03 * self.rng.standard_normal()
            self.supervisor.judge(Measurement(self.t_s, reading_c), self.t_s, 1.0)
            self.watch.observe(self.t_s, 1.0, reading_c, self.applied)
            free = self.supervisor.rule(self.t_s, 0.0) is State.RUN and not self.watch.asks
            self.applied = 1.0 if free and reading_c < to_c else 0.0
        return self

    def _flow(self, power):
        self.first += (power - self.first) / self.pole_s
        self.second += (self.first - self.second) / self.pole_s
        self.water_c += self.gain * self.second - self.loss
        self.t_s += 1.0


@pytest.mark.parametrize("lag_s", [10.0, 20.0, 45.0, 90.0])
@pytest.mark.parametrize("down_s", [0, 3, 10])
def test_heat_from_before_a_quick_restart_is_no_heater_that_is_stuck_on(lag_s, down_s):
    for began_s in (90, 180, 270):
        vessel = Vessel(lag_s=lag_s).warm_up(began_s)
        vessel.pass_by(down_s)
        vessel.begin().warm_up(900)
        assert vessel.names() == [], began_s
        assert vessel.supervisor.state is State.RUN


def test_the_lag_that_seemed_to_be_none_is_learnt_from_the_first_move_of_the_power():
    vessel = Vessel().warm_up(150).begin().warm_up(60)
    assert vessel.watch._known.lag_s < 10.0
    vessel.warm_up(600)
    assert vessel.watch._known.lag_s == 45.0
    assert abs(vessel.watch._known.mean / vessel.gain - 1.0) < 0.3


def test_a_slope_that_nobody_can_tell_proves_nothing():
    vessel = Vessel().warm_up(900)
    known = vessel.watch._known
    vessel.watch._known = known._replace(place=0, mean=0.2 * known.mean)
    vessel.watch._rows.clear()
    vessel.watch._doubt._extra_k = math.inf
    vessel.applied = 0.0
    vessel.warm_up(12, to_c=0.0)
    assert "nan" not in " ".join(str(fields.get("text")) for _, fields in vessel.events)


def seen(readings_c, sd_k=0.01, powers=None):
    first = FirstReadings()
    for n, reading_c in enumerate(readings_c):
        power = 1.0 if powers is None else powers[n]
        first.observe(power, reading_c, sd_k)
    return first


def test_a_reading_that_rises_from_the_first_second_on_rises_with_heat_from_before():
    first = seen([20.0 + 0.18 * n for n in range(8)], powers=[0.75] + 7 * [0.9])
    assert first.power == 0.9
    assert first.rate == pytest.approx(0.18)


@pytest.mark.parametrize("lag_s", [4.0, 9.0, 20.0, 45.0, 150.0])
def test_a_start_from_cold_bends(lag_s):
    pole_s = 0.5 * lag_s
    at_s = [4.0 * n + 2.0 for n in range(70)]
    rises_k = [0.05 * (t - lag_s + math.exp(-t / pole_s) * (t + lag_s)) for t in at_s]
    assert math.isnan(seen([20.0 + rise_k for rise_k in rises_k]).power)


def test_a_reading_at_rest_or_falling_says_nothing_of_heat():
    assert math.isnan(seen([37.5 + 0.005 * (n % 3) for n in range(100)]).power)
    assert math.isnan(seen([37.5 - 0.2 * n for n in range(100)]).power)
    assert math.isnan(seen([math.nan] * 100).power)
