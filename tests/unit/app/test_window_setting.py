"""How late an output may be: from the configuration to the limits of its loop."""

import pytest

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.errors import ConfigError

LOOP = {"setpoint_c": 37.5, "trip_above_c": 60.0, "actuator": {"board": "daq"}}


def settings_with(**tables):
    return load({"boards": {"daq": {"kind": "null"}}, "loops": {"tank": LOOP | tables}})


def windows(**tables):
    limits = plan_for(settings_with(**tables).loops["tank"]).limits
    return limits.window_s, limits.cooler_window_s


def test_an_output_is_prompt_until_somebody_says_otherwise():
    assert windows() == (0.0, 0.0)


def test_heater_and_cooler_are_late_each_in_its_own_way():
    late = {"board": "daq", "window_s": 10.0}
    cooler = {"board": "daq", "window_s": 60.0}
    law = {"kind": "adaptive", "action": "heat-cool"}
    assert windows(actuator=late) == (10.0, 0.0)
    assert windows(actuator=late, cooler=cooler, controller=law) == (10.0, 60.0)


@pytest.mark.parametrize("value", [-1.0, 601.0, "soon"])
def test_a_window_that_makes_no_sense_is_refused_by_name(value):
    with pytest.raises(ConfigError, match="window_s"):
        settings_with(actuator={"board": "daq", "window_s": value})
