"""Limits and set points against what the sensor of a loop can show at all."""

from __future__ import annotations

import pytest

from thermoctl.app.configuration.device_tables import SensorTable
from thermoctl.app.parts import sensor_for
from thermoctl.app.reach import reach_c
from thermoctl.app.settings import load
from thermoctl.errors import ConfigError
from thermoctl.signals import Quality, RawSample

CURVES = [
    {"curve": "lm335"},
    {"curve": "lm335", "reference_v": 4.5, "calibration_gain": 1.02},
    {"curve": "lm35"},
    {"curve": "pt100", "pull_up_ohm": 1e3},
    {"curve": "pt100", "pull_up_ohm": 1e4},
    {"curve": "pt1000", "pull_up_ohm": 2.2e3, "open_above": 1.0, "short_below": 0.0},
    {"curve": "ntc", "pull_up_ohm": 1e4},
    {"curve": "linear", "kelvin_per_v": -50.0, "zero_v_c": 120.0},
]


def holding(sensor: dict, **limits: float) -> dict:
    """Return a configuration with such a sensor and such limits."""
    loop = {"setpoint_c": 37.5, "trip_above_c": 60.0, "sensor": {"board": "daq", **sensor}}
    return {"boards": {"daq": {"kind": "null"}}, "loops": {"tank": loop | limits}}


@pytest.mark.parametrize("settings", CURVES, ids=str)
@pytest.mark.slow
def test_no_reading_lies_outside_the_reach_and_some_lie_at_its_ends(settings):
    sensor = sensor_for(SensorTable(board="daq", **settings))
    measured = [sensor.measure(RawSample(0.0, counts, 65536.0)) for counts in range(65536)]
    shown = [each.temperature_c for each in measured if each.quality is Quality.GOOD]
    coldest_c, hottest_c = reach_c(sensor)
    assert coldest_c <= min(shown) == pytest.approx(coldest_c, abs=1.5)
    assert hottest_c >= max(shown) == pytest.approx(hottest_c, abs=1.5)


def test_a_trip_that_no_reading_can_pass_is_refused_by_what_the_sensor_shows_at_most():
    with pytest.raises(ConfigError, match=r"tank\.trip_above_c: .* 216\.9 °C .* at most, got 1500"):
        load(holding({"curve": "lm335"}, trip_above_c=1500.0))
    load(holding({"curve": "lm335"}, trip_above_c=216.0))
    load(holding({"curve": "lm335", "open_above": 0.99}, trip_above_c=217.0))


def test_a_lower_trip_out_of_reach_is_refused_only_when_it_was_given():
    load(holding({"curve": "lm35"}))
    with pytest.raises(ConfigError, match=r"tank\.trip_below_c: .* 10\.0 °C .* at least, got 5"):
        load(holding({"curve": "lm35"}, trip_below_c=5.0))
    load(holding({"curve": "lm35"}, trip_below_c=11.0))


def test_a_setpoint_that_the_sensor_cannot_show_is_refused():
    with pytest.raises(ConfigError, match=r"tank\.setpoint_c: .* 277\.7 to 850\.0 °C, got 37\.5"):
        load(holding({"curve": "pt100", "pull_up_ohm": 1e4}))


@pytest.mark.parametrize(
    ("curve", "pull_up_ohm"),
    [("pt100", 1e-3), ("pt100", 1e6), ("pt1000", 1e308), ("ntc", 5e-324), ("ntc", 1e308)],
)
def test_a_resistor_that_shows_a_converter_nothing_is_refused(curve, pull_up_ohm):
    with pytest.raises(ConfigError) as refused:
        load(holding({"curve": curve, "pull_up_ohm": pull_up_ohm}))
    text = "expected a resistor with which the converter can tell the sensor's temperatures, got "
    key = "configuration: loops.tank.sensor.pull_up_ohm: "
    assert str(refused.value) == f"{key}{text}{pull_up_ohm:g} ohm"
