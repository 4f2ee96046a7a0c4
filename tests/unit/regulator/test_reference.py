"""A set point is approached no faster than allowed, and nothing runs away or jumps meanwhile."""

import math

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.control.adaptive.coasting import ahead
from thermoctl.errors import Refused
from thermoctl.regulator.reference import Pace, Reference, accept_rate, pace_in
from thermoctl.signals import Measurement, Mode, Quality, SetPoint, State

RATE = 0.02


def followed(reference, targets, measured_c=30.0, pace=Pace.RUNNING):
    """Return what is followed while the set point is each of `targets` for a second."""
    values = []
    for target_c in targets:
        reference = reference.after(target_c, RATE, measured_c, 1.0, pace)
        values.append(reference.value_c)
    return np.array(values)


def test_without_a_limit_the_reference_is_the_set_point():
    reference = Reference().after(60.0, math.inf, 20.0, 1.0, Pace.RUNNING)
    assert (reference.value_c, reference.rate_k_per_s) == (60.0, 0.0)


def test_a_ramp_begins_where_the_plant_is_and_ends_at_the_set_point():
    reference = Reference().after(31.0, RATE, 30.0, 1.0, Pace.RUNNING)
    assert reference == Reference(30.0, 0.0, 31.0)
    values = followed(reference, [31.0] * 60)
    assert np.diff(values)[:49] == pytest.approx(RATE)
    assert values[-1] == 31.0


def test_a_set_point_that_flips_every_second_moves_the_reference_at_its_rate():
    values = followed(Reference(30.0, 0.0, 30.0), [20.0, 90.0] * 50)
    assert np.abs(np.diff(values)) == pytest.approx(RATE)
    assert np.abs(values - 30.0).max() <= RATE + 1e-12


def test_a_new_set_point_is_approached_from_the_reference_that_is_followed():
    on_its_way = Reference(30.5, RATE, 40.0)
    assert followed(on_its_way, [20.0])[0] == pytest.approx(30.5 - RATE)


def test_and_from_the_plant_where_it_does_not_follow():
    run_ahead = Reference(60.0, RATE, 80.0)
    assert followed(run_ahead, [40.0])[0] == pytest.approx(30.0 + RATE)
    assert followed(run_ahead.anew(), [80.0])[0] == pytest.approx(30.0 + RATE)


def test_it_waits_while_held_and_goes_with_the_plant_while_idle():
    on_its_way = Reference(30.5, RATE, 40.0)
    assert followed(on_its_way, [40.0] * 9, pace=Pace.HELD)[-1] == 30.5
    assert followed(on_its_way, [40.0] * 9, measured_c=27.0, pace=Pace.IDLE)[-1] == 27.0
    blind = on_its_way.after(40.0, RATE, math.nan, 1.0, Pace.IDLE)
    assert blind.value_c == 30.5


def test_it_moves_only_while_a_controller_steers():
    paces = {
        (mode, state): pace_in(mode, state) for mode in (Mode.OFF, Mode.AUTO) for state in State
    }
    assert [key for key, pace in paces.items() if pace is Pace.RUNNING] == [(Mode.AUTO, State.RUN)]
    held = {state for (_, state), pace in paces.items() if pace is Pace.HELD}
    assert held == {State.RIDE, State.HOLD}


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan, math.inf, "fast", True])
def test_a_rate_that_is_none_is_refused(rate):
    with pytest.raises(Refused, match="expected a rate above 0"):
        accept_rate(rate, math.inf)


def test_nobody_goes_faster_than_is_configured():
    assert accept_rate(None, 0.05) == 0.05
    assert accept_rate(3.0, 0.05) == pytest.approx(0.05)
    with pytest.raises(Refused, match="at most 3 K/min, in K/min, got 4"):
        accept_rate(4.0, 0.05)


def test_the_end_of_a_ramp_is_foreseen():
    assert ahead(30.0, 0.1, 40.0, 20.0) == (32.0, 0.1)
    assert ahead(39.0, 0.1, 40.0, 20.0) == (40.0, 0.0)
    assert ahead(31.0, -0.1, 30.0, 20.0) == (30.0, 0.0)


# -- in a loop ------------------------------------------------------------------------------------


def test_a_request_has_a_rate_of_its_own_and_the_next_one_that_of_the_configuration(warm):
    warm.regulator.request(SetPoint(40.0, 3.0))
    step = warm.run(20)
    assert step.setpoint_c == 40.0
    assert step.reference_c == pytest.approx(38.5, abs=0.06)
    assert step.events == ()
    warm.regulator.request(SetPoint(39.0))
    assert warm.step().reference_c == 39.0


def test_a_refused_rate_changes_nothing(warm):
    with pytest.raises(Refused):
        warm.regulator.request(SetPoint(40.0, -1.0))
    assert warm.step().setpoint_c == 37.5


def test_a_loop_that_was_safe_goes_on_from_where_the_plant_is(drive_with):
    drive = drive_with(water_c=30.0, setpoint_rate_k_per_min=1.0)
    drive.run(120)
    before_c = drive.steps[-1].reference_c
    held = drive.run(2, Quality.MISSING)
    assert held.state in (State.HOLD, State.RIDE)
    assert held.reference_c == pytest.approx(before_c, abs=1.5 / 60.0)
    step = drive.run(300, Quality.OPEN)
    assert step.state is State.SAFE
    while step.state is State.SAFE:
        step = drive.step()
    assert step.reference_c == pytest.approx(drive.water_c, abs=0.05)
    assert drive.run(60).reference_c == pytest.approx(step.reference_c + 1.0, abs=0.02)


def test_an_idle_loop_keeps_its_reference_at_the_plant(drive_with):
    drive = drive_with(water_c=30.0, mode="off", setpoint_rate_k_per_min=1.0)
    assert drive.run(100).reference_c == pytest.approx(drive.water_c, abs=0.01)
    drive.regulator.request(Mode.AUTO)
    assert drive.step().reference_c == pytest.approx(drive.water_c, abs=0.05)


@pytest.mark.parametrize("rate_k_per_min", [1.0, pytest.param(0.2, marks=pytest.mark.slow)])
def test_the_default_follows_a_ramp_without_lagging_behind(drive_with, rate_k_per_min):
    drive = drive_with(water_c=32.0)
    drive.run(1200)
    drive.regulator.request(SetPoint(41.5, rate_k_per_min))
    ramp_s = round(240.0 / rate_k_per_min)
    errors, after = [], []
    for second in range(ramp_s + 300):
        error_k = drive.step().reference_c - drive.water_c
        (errors if second < ramp_s else after).append(error_k)
    assert abs(np.mean(errors[60:])) < 0.07
    assert np.abs(errors[60:-60]).max() < 0.1
    assert -min(after) < 0.05


def test_a_bad_rate_of_the_configuration_is_refused_by_name():
    loop = {"setpoint_c": 40.0, "trip_above_c": 60.0, "setpoint_rate_k_per_min": 0.0}
    with pytest.raises(Exception, match="setpoint_rate_k_per_min"):
        load({"loops": {"tank": loop}})


def test_an_arrival_takes_as_long_as_the_ramp(warm):
    warm.run(600)
    warm.regulator.request(SetPoint(42.0, 0.5))
    step = warm.run(100)
    left_s = (42.0 - step.reference_c) * 120.0
    assert step.feasible.arrival_s == pytest.approx(left_s, abs=20.0)


def test_a_first_reading_that_is_missing_starts_no_ramp_from_nowhere():
    loop = {"setpoint_c": 40.0, "trip_above_c": 60.0, "mode": "auto",
            "setpoint_rate_k_per_min": 1.0}  # fmt: skip
    regulator = regulator_for(load({"loops": {"tank": loop}}))
    step = regulator.step(Measurement(0.0, math.nan, Quality.MISSING))
    assert math.isnan(step.reference_c)
    assert step.command.power == 0.0
    assert regulator.step(Measurement(1.0, 25.0)).reference_c == 25.0
