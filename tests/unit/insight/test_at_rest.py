"""When a loop is at rest, and whether there is anything to learn."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.insight.gate import GateWatch
from thermoctl.insight.rest import Rest
from thermoctl.insight.values import Gate
from thermoctl.signals import (
    Command,
    Estimate,
    Measurement,
    Mode,
    PlantBelief,
    Quality,
    State,
    Step,
)

PLANT = PlantBelief(
    gain_k_per_s=0.044,
    gain_sd_k_per_s=0.001,
    loss_k_per_s=0.009,
    loss_sd_k_per_s=0.0005,
    holding_power=0.2,
    holding_power_sd=0.01,
    lag_s=18.0,
    lag_low_s=14.0,
    lag_high_s=21.0,
    coasting_c=37.5,
    noise_sd_k=0.02,
    learning=False,
    jumped=False,
)


def step_at(t_s, reading_c=37.5, **changed):
    """Return a step of a loop in auto."""
    good = math.isfinite(reading_c)
    measurement = Measurement(t_s, reading_c, Quality.GOOD if good else Quality.MISSING)
    step = Step(
        t_s=t_s,
        measurement=measurement,
        mode=Mode.AUTO,
        state=State.RUN,
        setpoint_c=37.5,
        command=Command(0.2, t_s + 3.0, "control"),
        controller="adaptive",
        estimate=Estimate(np.zeros(1), np.eye(1)),
        tell=lambda: PLANT,
    )
    return replace(step, **changed)


def test_a_loop_that_is_held_is_at_rest_since_it_came_there():
    rest = Rest()
    for t_s, reading_c in ((0.0, 30.0), (1.0, 37.3), (2.0, 37.6), (12.0, 37.5)):
        rest.after(step_at(t_s, reading_c), 0.02)
    assert rest.since_s == 1.0
    assert rest.lasts_s(12.0) == 11.0
    assert rest.moved_s == 0.0


@pytest.mark.parametrize(
    "changed",
    [{"setpoint_c": 37.6}, {"mode": Mode.MANUAL}, {"state": State.HOLD}],
)
def test_another_set_point_mode_or_state_is_a_move(changed):
    rest = Rest()
    assert rest.after(step_at(0.0), 0.02)
    assert not rest.after(step_at(100.0), 0.02)
    assert rest.after(step_at(200.0, **changed), 0.02)
    assert rest.moved_s == 200.0


def test_a_ramp_is_one_move_from_its_begin():
    rest = Rest()
    rest.after(step_at(0.0), 0.02)
    for k in range(100):
        rest.after(step_at(200.0 + k, setpoint_c=37.5 + 0.03 * k, reading_c=37.5 + 0.03 * k), 0.02)
    assert rest.moved_s == pytest.approx(200.0, abs=3.0)
    assert rest.lasts_s(299.0) < 3.0


def test_water_that_was_poured_in_ends_the_rest_and_is_no_move():
    rest = Rest()
    rest.after(step_at(0.0), 0.02)
    assert not rest.after(step_at(1.0, 34.0), 0.02)
    assert rest.lasts_s(1.0) == 0.0


def test_a_noisy_reading_is_at_rest_within_its_noise():
    rest = Rest()
    rest.after(step_at(0.0, 38.5), 0.2)
    assert rest.since_s == 0.0


def test_a_missing_reading_changes_nothing():
    rest = Rest()
    rest.after(step_at(0.0), 0.02)
    assert not rest.after(step_at(1.0, math.nan), 0.02)
    assert rest.since_s == 0.0


def test_the_gate_says_learning_for_a_while_after_the_last_evidence():
    gate = GateWatch()
    assert gate.after(0.0, PLANT) is Gate.UNKNOWN
    assert gate.after(1.0, replace(PLANT, learning=True)) is Gate.LEARNING
    assert gate.after(20.0, PLANT) is Gate.LEARNING
    assert gate.after(40.0, PLANT) is Gate.PAUSED


def test_a_jump_holds_the_gate_for_five_lags():
    gate = GateWatch()
    assert gate.after(0.0, replace(PLANT, jumped=True, learning=True)) is Gate.HELD
    assert gate.after(89.0, PLANT) is Gate.HELD
    assert gate.after(91.0, PLANT) is Gate.PAUSED
