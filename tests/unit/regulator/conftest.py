"""A regulator on a small plant with lag, driven second by second."""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.regulator import Regulator
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
