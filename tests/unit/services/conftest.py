"""Cycles as the loop publishes them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from thermoctl.signals import (
    Alarm,
    Beliefs,
    Command,
    Cycle,
    Estimate,
    Event,
    Measurement,
    Mode,
    Quality,
    State,
    Step,
)


def _cycle(
    t_s: float,
    *,
    loop: str = "tank",
    temperature_c: float = 40.0,
    events: tuple[Event, ...] = (),
    alarms: tuple[Alarm, ...] = (),
    **truth: float,
) -> Cycle:
    quality = Quality.MISSING if math.isnan(temperature_c) else Quality.GOOD
    step = Step(
        t_s=t_s,
        measurement=Measurement(t_s, temperature_c, quality),
        mode=Mode.AUTO,
        state=State.RUN,
        setpoint_c=41.0,
        command=Command(0.25, t_s + 3.0, "control"),
        controller="self-tuning-mv",
        estimate=Estimate(np.zeros(2), np.eye(2), innovation=0.125, innovation_var=0.5),
        beliefs=Beliefs(gain=0.04, gain_sd=0.001, a=0.99),
        alarms=alarms,
        events=events,
    )
    return Cycle(loop, step, accepted_power=0.24, tick_us=80.0, late_s=0.001, truth=truth)


@pytest.fixture(scope="session")
def cycle_at() -> Callable[..., Cycle]:
    """Return a maker of finished cycles: ``cycle_at(t_s, temperature_c=..., loop=...)``."""
    return _cycle


class WallClock:
    """A wall clock that a test sets."""

    def __init__(self, utc_s: float = 1.7e9) -> None:
        self.utc_s = utc_s

    def __call__(self) -> float:
        return self.utc_s


@pytest.fixture
def wall_clock() -> WallClock:
    return WallClock()
