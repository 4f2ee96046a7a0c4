"""What an operator may ask, and what is refused without changing anything."""

import math

import numpy as np
import pytest

from thermoctl.errors import Refused
from thermoctl.signals import Acknowledge, ManualPower, Mode, SetPoint, State


@pytest.mark.parametrize(
    "value", [math.nan, math.inf, -math.inf, 1e400, 60.5, -0.1, "37.5", None, True, 10**400, [38.0]]
)
def test_a_set_point_that_is_none_is_refused_naming_the_range(warm, value):
    with pytest.raises(Refused, match="0 to 60"):
        warm.regulator.request(SetPoint(value))
    assert warm.regulator.setpoint_c == 37.5


def test_a_set_point_of_any_real_type_is_taken(warm):
    for value in (40, 40.0, np.float32(40.0), np.int64(40)):
        warm.regulator.request(SetPoint(value))
        assert warm.regulator.setpoint_c == 40.0


@pytest.mark.parametrize("power", [-0.01, 1.01, math.nan, "0.5", None])
def test_a_manual_power_outside_0_to_1_is_refused(warm, power):
    with pytest.raises(Refused, match="0 to 1"):
        warm.regulator.request(ManualPower(power))


@pytest.mark.parametrize("request_", [None, "auto", 38.0, object()])
def test_what_is_no_request_is_refused(warm, request_):
    with pytest.raises(Refused):
        warm.regulator.request(request_)


def test_a_program_is_refused_where_there_is_none(warm):
    with pytest.raises(Refused, match="no program"):
        warm.regulator.request(Mode.PROGRAM)
    assert warm.regulator.mode is Mode.AUTO


def test_off_means_power_0_at_the_next_step(warm):
    warm.regulator.request(Mode.OFF)
    step = warm.step()
    assert (step.command.power, step.command.reason) == (0.0, "off")
    assert step.state is State.RUN


def test_manual_goes_on_with_the_power_that_is_given_now(warm):
    before = warm.power
    warm.regulator.request(Mode.MANUAL)
    assert warm.step().command.power == before
    warm.regulator.request(ManualPower(0.33))
    assert warm.step().command.power == 0.33


def test_going_back_to_auto_does_not_bump(warm):
    warm.regulator.request(Mode.MANUAL)
    before = warm.run(20).command.power
    warm.regulator.request(Mode.AUTO)
    assert abs(warm.step().command.power - before) < 0.1


def test_a_regulator_is_off_unless_its_configuration_says_otherwise(drive_with):
    drive = drive_with(water_c=20.0, mode="off")
    assert drive.run(10).command.power == 0.0


def test_acknowledging_nothing_is_no_error(warm):
    warm.regulator.request(Acknowledge())
    assert warm.step().alarms == ()


def test_every_change_is_an_event(warm):
    warm.regulator.request(SetPoint(40.0))
    warm.regulator.request(Mode.MANUAL)
    names = [event.name for event in warm.step().events]
    assert names == ["setpoint.changed", "mode.changed"]


def test_a_power_by_hand_is_an_event_with_the_power_before_it(warm):
    warm.regulator.request(Mode.MANUAL)
    carried = warm.step().command.power
    warm.regulator.request(ManualPower(0.3))
    (event,) = warm.step().events
    assert event.name == "output.changed"
    assert dict(event.fields) == {"before_power": carried, "after_power": 0.3}


def test_a_power_that_is_refused_is_no_event(warm):
    with pytest.raises(Refused):
        warm.regulator.request(ManualPower(1.5))
    assert warm.step().events == ()


def test_a_loop_that_starts_in_manual_starts_at_power_0(drive_with):
    drive = drive_with(water_c=20.0, mode="manual")
    assert drive.run(10).command.power == 0.0


def test_what_does_not_change_is_no_event(warm):
    warm.regulator.request(SetPoint(37.5))
    warm.regulator.request(Mode.AUTO)
    warm.regulator.request(ManualPower(0.0))
    assert warm.step().events == ()


@pytest.mark.parametrize("code", ["sensor.open", "nonsense", 3])
def test_acknowledging_an_alarm_that_is_not_there_is_refused(warm, code):
    with pytest.raises(Refused, match="expected an alarm of none"):
        warm.regulator.request(Acknowledge(code))
