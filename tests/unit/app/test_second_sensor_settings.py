"""Settings of a second sensor: what is refused, and where it leads."""

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.doctor import boards
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings
from thermoctl.app.tuning.trial import alone
from thermoctl.errors import ConfigError
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.testing import ManualClock

LOOP = {
    "setpoint_c": 37.5,
    "trip_above_c": 60.0,
    "sensor": {"board": "daq"},
    "second_sensor": {"board": "daq", "input": "temperature2"},
    "actuator": {"board": "daq", "law": "square"},
}
SIMULATED = {"kind": "simulated", "second_sensor": True}
THERMODAQ = {"kind": "thermodaq", "port": "/dev/ttyACM0"}


def read(loop=(), **boards):
    return load({"loops": {"tank": LOOP | dict(loop)}, "boards": {"daq": SIMULATED} | boards})


def test_a_loop_has_one_sensor_unless_another_is_given():
    table = read({"second_sensor": None}).loops["tank"]
    assert table.second_sensor is None
    assert read().loops["tank"].second_sensor.input == "temperature2"


@pytest.mark.parametrize(
    ("keys", "key", "text"),
    [
        ({"second_sensor": {"board": "daq"}}, "second_sensor.input", "expected another input"),
        ({"sensor": None}, "second_sensor", "sensor] beside it, got none"),
        ({"second_sensor": {"board": "dac"}}, "second_sensor.board", "did you mean 'daq'?"),
        (
            {
                "second_sensor": {
                    "board": "daq",
                    "input": "b",
                    "curve": "linear",
                    "zero_v_c": -450.0,
                }
            },
            "trip_above_c",
            "expected less than the 40.0",
        ),
        (
            {"second_sensor": {"board": "daq", "input": "b", "curve": "pt100"}},
            "second_sensor.pull_up_ohm",
            "expected the resistor that a pt100 is read with, got none",
        ),
        ({"disagreement_k": 0.0}, "disagreement_k", "expected"),
    ],
)
def test_a_second_sensor_that_makes_no_sense_is_refused_by_name(keys, key, text):
    with pytest.raises(ConfigError, match=f"loops.tank.{key}: .*") as refused:
        read(keys)
    assert text in str(refused.value)


def test_the_sensors_may_hang_on_two_boards():
    settings = read(
        {"second_sensor": {"board": "other"}}, other={"kind": "simulated", "initial_c": 25.2}
    )
    cycles, clock = [], ManualClock()
    loop = loop_for(settings, clock, cycles.append, beside=False)
    loop.cycle(0.0)
    assert {board.name for board in loop.boards} == {"daq", "other"}
    coldest_c, hottest_c = cycles[0].step.measurement.ends_c
    assert 24.9 < coldest_c < hottest_c < 25.4
    assert {*alone(settings, "tank").boards} == {"daq", "other"}


def test_a_stand_in_for_a_real_board_has_both_sensors():
    second = {"board": "other", "input": "temperature"}
    real = {"other": THERMODAQ | {"port": "/dev/ttyACM1"}, "daq": THERMODAQ}
    settings = bench_settings(
        load(
            {"loops": {"tank": LOOP | {"second_sensor": second, "actuator": {"board": "daq"}}},
             "boards": real}
        )
    )  # fmt: skip
    cycles, clock = [], ManualClock()
    loop_for(settings, clock, cycles.append, beside=False).cycle(0.0)
    coldest_c, hottest_c = cycles[0].step.measurement.ends_c
    assert 24.5 < coldest_c < hottest_c < 25.5
    with pytest.raises(ConfigError, match="on simulated boards only"):
        bench_settings(read({"second_sensor": second}, other=THERMODAQ))


def test_the_doctor_reads_both_sensors(tmp_path):
    found = [finding.text for finding in boards(read(), tmp_path, SimulatedClock(), 0.2)]
    assert any(text.startswith("temperature of loop tank: 2") for text in found)
    assert any(text.startswith("temperature2 of loop tank: 2") for text in found)
