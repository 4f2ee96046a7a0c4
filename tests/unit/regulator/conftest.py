"""A regulator on a small plant with lag, driven second by second."""

import copy
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.regulator import Regulator
from thermoctl.regulator.heater.check import HeaterCheck
from thermoctl.regulator.heater.watch import HeaterWatch
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.supervisor import Supervisor
from thermoctl.signals import Measurement, Quality, State, Step

LOOP = {"setpoint_c": 37.5, "trip_above_c": 60.0, "trip_below_c": 0.0, "mode": "auto"}


@dataclass
class Drive:
    """A regulator and the plant it heats: an integrator with loss behind a lag of 20 s."""

    regulator: Regulator
    t_s: float = 0.0
    water_c: float = 37.5
    heat: float = 0.2
    power: float = 0.0
    steps: list[Step] = field(default_factory=list)

    def step(self, quality: Quality = Quality.GOOD, offset_k: float = 0.0) -> Step:
        """Advance one second and show the regulator the water, or what `quality` leaves of it."""
        self.heat += (self.power - self.heat) / 20.0
        self.water_c += 0.0449 * self.heat - 0.009
        self.t_s += 1.0
        good = quality in (Quality.GOOD, Quality.STALE)
        temperature_c = self.water_c + offset_k if good else math.nan
        return self.see(Measurement(self.t_s, temperature_c, quality))

    def see(self, measurement: Measurement) -> Step:
        """Show the regulator `measurement` as it is."""
        step = self.regulator.step(measurement)
        self.power = step.command.power
        self.steps.append(step)
        return step

    def run(self, seconds: int, quality: Quality = Quality.GOOD) -> Step:
        """Advance `seconds` and return the last step."""
        return [self.step(quality) for _ in range(seconds)][-1]

    def seconds_to_power_0(self, quality: Quality, at_most: int = 120) -> int:
        """Return how many seconds of `quality` pass until the command is 0."""
        for seconds in range(1, at_most + 1):
            if self.step(quality).command.power == 0.0:
                return seconds
        raise AssertionError(f"power is still {self.power} after {at_most} s of {quality}")


@pytest.fixture
def drive_with() -> Callable[..., Drive]:
    """Return a function that makes a `Drive` from changed keys of the loop."""

    def make(water_c: float = 37.5, **keys: Any) -> Drive:
        return Drive(regulator_for(load({"loops": {"tank": LOOP | keys}})), water_c=water_c)

    return make


@pytest.fixture(scope="session")
def held() -> Drive:
    """A regulator that has held its set point for five minutes, to be copied and not driven."""
    drive = Drive(regulator_for(load({"loops": {"tank": LOOP}})))
    drive.run(300)
    assert drive.steps[-1].state is State.RUN
    assert 0.05 < drive.power < 0.6
    del drive.steps[:-1]  # most of what would be copied
    return drive


@pytest.fixture
def warm(held: Drive) -> Drive:
    """A regulator that has held its set point for five minutes."""
    return copy.deepcopy(held)


class Vessel:
    """A watch over what loses more the hotter it is.

    `asks_for` is the power, `shows` what is read of it, `left` the share of the heater that is left
    at a temperature, and `poured` the share of the water for which cold water comes in a second.
    """

    def __init__(self, gain=0.02, cools_per_s=4e-4, lag_s=20.0, seed=1, **check):
        self.gain, self.cools_per_s, self.pole_s = gain, cools_per_s, 0.5 * lag_s
        self.events = deque()
        self.supervisor = Supervisor(Limits(200.0, -50.0, -50.0, 200.0), self.emit)
        check = HeaterCheck(**check)
        self.watch = HeaterWatch(check, 1.0, self.supervisor, self.emit)
        self.asks_for = check.power_max
        self.rng, self.shows = np.random.default_rng(seed), lambda water_c: water_c
        self.left, self.poured = lambda water_c: 1.0, lambda t_s: 0.0
        self.t_s, self.water_c, self.applied, self.given_s = 0.0, 20.0, 0.0, 0.0
        self.first = self.second = 0.0

    def emit(self, name, **fields):
        self.events.append(name)

    def names(self):
        return [name for name in self.events if name.startswith("heater.")]

    def run(self, seconds):
        """Give all the power that is asked for wherever nobody forbids it."""
        for _ in range(round(seconds)):
            self.first += (self.applied - self.first) / self.pole_s
            self.second += (self.first - self.second) / self.pole_s
            self.water_c += self.gain * self.second * self.left(self.water_c)
            self.water_c -= self.cools_per_s * (self.water_c - 20.0)
            self.water_c -= self.poured(self.t_s) * (self.water_c - 5.0)
            self.t_s += 1.0
            reading_c = self.shows(self.water_c) + 0.01 * self.rng.standard_normal()
            self.supervisor.judge(Measurement(self.t_s, reading_c), self.t_s, 1.0)
            self.watch.observe(self.t_s, 1.0, reading_c, self.applied)
            runs = self.supervisor.rule(self.t_s, 0.0) is State.RUN
            self.applied = self.asks_for * (runs and not self.watch.asks)
            self.given_s += self.applied
        return self


@pytest.fixture
def vessel_with() -> Callable[..., Vessel]:
    """Return what makes a `Vessel`."""
    return Vessel
