"""Cycles to feed a view with, one made from the other by `dataclasses.replace`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from thermoctl.app.live.model import Facts, LiveModel
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

MakeCycle = Callable[..., Cycle]


def cycle_at(
    t_s: float,
    temperature_c: float = 37.49,
    *,
    quality: Quality = Quality.GOOD,
    state: State = State.RUN,
    mode: Mode = Mode.AUTO,
    setpoint_c: float = 37.5,
    accepted_power: float = 0.231,
    innovation: float = 0.01,
    beliefs: Beliefs | None = None,
    alarms: tuple[Alarm, ...] = (),
    events: tuple[Event, ...] = (),
) -> Cycle:
    """Return a plausible cycle of the loop `tank` at loop time `t_s`."""
    measured_c = temperature_c if quality in (Quality.GOOD, Quality.STALE) else math.nan
    step = Step(
        t_s=t_s,
        measurement=Measurement(t_s, measured_c, quality),
        mode=mode,
        state=state,
        setpoint_c=setpoint_c,
        command=Command(accepted_power, t_s + 3.0, "control"),
        controller="self-tuning-mv",
        estimate=Estimate(np.array([0.9996]), np.eye(1), innovation, 1e-4, 1.0),
        beliefs=beliefs or Beliefs(0.0403, 0.001, 0.9996, 0.0006, 0.19),
        alarms=alarms,
        events=events,
    )
    return Cycle("tank", step, accepted_power, tick_us=78.0)


@pytest.fixture
def make_cycle() -> MakeCycle:
    return cycle_at


@pytest.fixture
def facts() -> Facts:
    return Facts("tank", 1.0, 5.0, 60.0, datetime(2026, 3, 1, 14, 0, 0), speed=60.0)


@pytest.fixture
def model(facts: Facts) -> LiveModel:
    return LiveModel(facts)


@pytest.fixture
def sixty(model: LiveModel) -> LiveModel:
    """A minute of quiet regulation."""
    first = cycle_at(0.0)
    for k in range(60):
        model.feed(replace(first, step=replace(first.step, t_s=float(k))))
    return model
