"""A reading may lie as far off as the plant that is believed in could have moved."""

import math

import pytest

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.regulator import Limits
from thermoctl.signals import Beliefs, Measurement, State

LIMITS = Limits(60.0, 0.0, 5.0, 55.0, period_s=10.0)


@pytest.mark.parametrize(
    ("gain", "gain_sd", "jump_k"),
    [
        (0.0449, 0.001, 1.0),  # the rig, known: what it could do is less
        (0.002, 0.15, 6.04),  # never seen before
        (0.37, 0.02, 8.2),
        (-0.37, 0.02, 8.2),  # a cooler
        (0.9, 0.0, 10.0),
        (math.nan, math.nan, 1.0),
        (math.nan, 0.1, 1.0),
        (0.1, math.nan, 1.0),
        (math.inf, 0.0, 10.0),
    ],
)
def test_the_jump_is_twice_the_rise_of_the_largest_gain_believed_in(gain, gain_sd, jump_k):
    assert LIMITS.jump_for(gain, gain_sd) == pytest.approx(jump_k)


def test_at_a_sample_a_second_no_belief_widens_the_usual_jump():
    assert Limits(60.0, 0.0, 5.0, 55.0).jump_for(0.5, 10.0) == 1.0


@pytest.mark.parametrize(
    ("gain", "gain_sd", "jump_k"),
    [
        (3.5, 0.1, 7.4),  # a hot end, known
        (3.5, 1.0, 1.0),  # guessed: a dry element rises as fast
        (3.5, 0.0, 1.0),  # nobody says how well it is known
        (8.0, 0.1, 10.0),
    ],
)
def test_only_a_gain_that_is_known_may_be_steeper_than_that_of_any_water(gain, gain_sd, jump_k):
    limits = Limits(300.0, 0.0, 5.0, 290.0)
    assert limits.jump_for(gain, gain_sd) == pytest.approx(jump_k)


def test_no_period_is_so_long_that_a_spike_of_20_k_is_believed():
    assert Limits(60.0, 0.0, 5.0, 55.0, period_s=3600.0).jump_for(0.5, 10.0) <= 10.0


def test_a_jump_that_is_configured_is_never_widened():
    table = {"setpoint_c": 37.5, "trip_above_c": 60.0, "period_s": 10.0, "jump_k": 2.0}
    limits = plan_for(load({"loops": {"tank": table}}).loops["tank"]).limits
    assert limits.jump_for(0.5, 0.1) == 2.0
    del table["jump_k"]
    limits = plan_for(load({"loops": {"tank": table}}).loops["tank"]).limits
    assert limits.jump_for(0.5, 0.1) == 10.0


@pytest.mark.parametrize("gain", [None, "much", math.nan, math.inf, 10**400, True])
@pytest.mark.parametrize("gain_sd", [None, "much", math.nan, -1.0, 10**400])
def test_whatever_a_law_believes_a_spike_of_20_k_is_none(drive_with, gain, gain_sd):
    drive = drive_with(controller="on-off", period_s=10.0)
    law = drive.regulator._steering.mind.controller
    told = type("Told", (type(law),), {"beliefs": lambda *_: Beliefs(gain, gain_sd)})
    drive.regulator._steering.mind.controller = told()
    for t in range(5):
        drive.see(Measurement(10.0 * t, 37.4))
    step = drive.see(Measurement(50.0, 57.4))
    assert [event.name for event in step.events] == ["sensor.spike", "state.changed"]
    assert step.state is State.HOLD


def test_three_readings_that_agree_are_still_the_truth(drive_with):
    drive = drive_with(controller="adaptive", period_s=10.0)
    for t in range(30):
        drive.see(Measurement(10.0 * t, 37.4))
    states = [drive.see(Measurement(10.0 * t, 17.4)).state for t in range(30, 33)]
    assert states == [State.HOLD, State.HOLD, State.RUN]
