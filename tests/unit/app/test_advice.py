"""What an alarm means, in the words of who stands beside the tank."""

from __future__ import annotations

import pytest

from thermoctl.app.advice import ADVICE, advice_for
from thermoctl.app.commands.alarms import _described
from thermoctl.services.events import EVENTS

ROW = {"loop": "tank", "code": "sensor.open", "since": "noon", "text": "an open circuit"}


def test_advice_is_given_only_on_events_that_there_are():
    assert set(ADVICE) <= set(EVENTS)


@pytest.mark.parametrize("family", ["sensor.", "heater.", "trip.", "output."])
def test_every_alarm_about_sensor_heater_and_limits_has_its_advice(family):
    no_alarm = {"heater.questioned", "heater.answered", "output.changed", "output.in_order"}
    no_alarm |= {"sensor.good"}
    told = {name for name in EVENTS if name.startswith(family)} - no_alarm
    assert told
    assert told <= set(ADVICE)


def test_an_alarm_is_a_line_and_what_it_means_another():
    told = _described(ROW | {"active": True})
    assert told == [
        "tank: sensor.open since noon: an open circuit",
        f"    {ADVICE['sensor.open']}",
    ]
    assert _described(ROW | {"active": False})[0].endswith(" (over, not acknowledged)")


def test_an_alarm_nobody_knows_is_one_line():
    assert advice_for("plugin.odd") == ""
    assert len(_described(ROW | {"active": True, "code": "plugin.odd"})) == 1
