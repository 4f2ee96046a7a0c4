"""From settings to a regulator and a loop."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from thermoctl.app.compose import loop_for, regulator_for, started_as, wiring_errors
from thermoctl.app.parts import plan_for, sensor_for
from thermoctl.app.settings import load
from thermoctl.errors import ConfigError
from thermoctl.model.arx import Arx, KnownGain
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import Measurement, Mode, RawSample, SetPoint, State


def changed(text: str, path: str, **values: object) -> dict:
    """Return the parsed `text` with `values` set in the table at `path`; None removes a key."""
    content = tomllib.loads(text)
    table = content
    for part in path.split("."):
        table = table.setdefault(part, {})
    for key, value in values.items():
        if value is None:
            table.pop(key)
        else:
            table[key] = value
    return content


def errors(content: dict) -> list[str]:
    """Return what keeps `content` from running."""
    return [f"{'.'.join(key)}: {text}" for key, text in wiring_errors(load(content))]


def test_the_least_configuration_gives_a_regulator_that_is_off(minimal):
    regulator = regulator_for(load(minimal))
    step = regulator.step(Measurement(t_s=0.0, temperature_c=25.0))
    assert step.mode is Mode.OFF
    assert step.command.power == 0.0


def test_a_cold_tank_in_auto_is_heated_towards_its_setpoint(minimal):
    regulator = regulator_for(load(minimal), loop="tank")
    regulator.request(Mode.AUTO)
    regulator.request(SetPoint(50.0))
    powers = [regulator.step(Measurement(float(t), 25.0)).command.power for t in range(5)]
    assert powers[-1] > 0.0


def test_a_loop_that_is_not_there_is_refused_with_the_nearest_one(minimal):
    with pytest.raises(ConfigError, match="no loop is called 'tnk'; did you mean 'tank'"):
        regulator_for(load(minimal), loop="tnk")


def test_the_known_gain_is_counted_per_sample(minimal):
    minimal["loops"]["tank"] |= {"period_s": 2.0, "model": {"gain_k_per_s": 0.05}}
    structure = plan_for(load(minimal).loops["tank"]).identifier.structure
    assert structure == KnownGain(0.1)


def test_structure_arx_has_the_orders_that_are_given(minimal):
    minimal["loops"]["tank"]["model"] = {"structure": "arx", "n": 3, "m": 1, "delay": 4}
    structure = plan_for(load(minimal).loops["tank"]).identifier.structure
    assert isinstance(structure, Arx)
    assert (structure.n, structure.m, structure.delay) == (3, 1, 4)


def test_a_known_gain_has_no_delay(minimal):
    minimal["loops"]["tank"]["model"] = {"delay": 2}
    with pytest.raises(ConfigError, match="delay: expected 1 unless structure is 'arx', got 2"):
        load(minimal)


@pytest.mark.parametrize("m", [1, 2, 3, 10])
def test_the_first_guess_is_one_that_a_law_can_begin_with(minimal, m):
    minimal["loops"]["tank"]["model"] = {"structure": "arx", "m": m, "gain_k_per_s": 0.1}
    b = plan_for(load(minimal).loops["tank"]).identifier.start().estimate.theta[2:]
    assert b.sum() == pytest.approx(0.1)
    assert np.abs(np.roots(b)).max(initial=0.0) < 0.9


@pytest.mark.parametrize("guarded", [True, False])
@pytest.mark.parametrize("kind", ["ckf", "nkf", "rls"])
@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 3), (5, 1)])
def test_a_loop_that_learns_everything_heats_from_its_first_sample_on(minimal, guarded, kind, n, m):
    tank = minimal["loops"]["tank"]
    tank["model"] = {"structure": "arx", "n": n, "m": m}
    tank["estimator"] = {"kind": kind, "P0": 1e-6, "guards": {"enabled": guarded}}
    tank["mode"] = "auto"
    regulator = regulator_for(load(minimal))
    for t_s in range(10):
        step = regulator.step(Measurement(float(t_s), 25.0 + 0.01 * t_s))
        assert step.command.power > 0.0
        assert step.alarms == ()


def test_the_noise_of_the_first_sample_does_not_keep_a_cold_tank_cold(minimal):
    tank = minimal["loops"]["tank"]
    tank["model"] = {"gain_k_per_s": 0.024}
    tank["period_s"], tank["mode"] = 0.5, "auto"
    regulator = regulator_for(load(minimal))
    for k in range(20):
        step = regulator.step(Measurement(0.5 * k, 20.9 if k == 1 else 20.0))
        assert step.command.power == 1.0


@pytest.mark.parametrize(("period_s", "gain_k_per_s"), [(1.0, 0.0449), (5.0, 0.7)])
def test_heat_that_is_under_way_for_a_lag_is_not_taken_for_lost(minimal, period_s, gain_k_per_s):
    tank = minimal["loops"]["tank"]
    tank["model"] = {"gain_k_per_s": gain_k_per_s}
    tank["controller"] = {"kind": "self-tuning-mv", "reference_time_s": 60.0}
    tank["estimator"] = {"R2": 0.1}
    tank["period_s"], tank["mode"] = period_s, "auto"
    regulator = regulator_for(load(minimal))
    for k in range(1 + int(20.0 / period_s)):  # a third of the reference time
        step = regulator.step(Measurement(k * period_s, 30.0))
        regulator.applied(step.command.power)
    loss_k = (1.0 - step.estimate.theta[0]) * 30.0
    assert 0.0 < loss_k < 0.25 * gain_k_per_s * period_s


def test_a_fast_tank_at_full_power_is_no_outlier(minimal):
    tank = minimal["loops"]["tank"]
    tank["model"], tank["period_s"], tank["mode"] = {"gain_k_per_s": 0.72}, 5.0, "auto"
    regulator = regulator_for(load(minimal))
    for k in range(8):
        step = regulator.step(Measurement(5.0 * k, 5.0 + 3.6 * k))
        assert step.state is State.RUN
    assert plan_for(load(minimal).loops["tank"]).limits.jump_k == pytest.approx(7.2)
    tank["jump_k"] = 0.5
    assert plan_for(load(minimal).loops["tank"]).limits.jump_k == 0.5


def test_bare_laws_start_from_the_covariance_that_is_given(minimal):
    tank = minimal["loops"]["tank"]
    tank["estimator"] = {"P0": 4.0, "guards": {"enabled": False}}
    assert plan_for(load(minimal).loops["tank"]).identifier.P0 == 4.0
    tank["estimator"] = {"P0": 4.0, "guards": {"covariance_max": 0.5}}
    assert plan_for(load(minimal).loops["tank"]).identifier.P0 == 0.5


def test_a_learnt_gain_is_bounded_from_below_unless_the_guards_are_off(minimal):
    tank = minimal["loops"]["tank"]
    tank["model"] = {"structure": "arx", "gain_k_per_s": 0.1}
    tank["period_s"] = 2.0
    tank["controller"] = "self-tuning-mv"
    assert plan_for(load(minimal).loops["tank"]).controller.gain_min_k == pytest.approx(0.04)
    tank["controller"] = {"kind": "self-tuning-mv", "gain_min_k": 0.01}
    assert plan_for(load(minimal).loops["tank"]).controller.gain_min_k == 0.01
    tank["controller"] = "self-tuning-mv"
    tank["estimator"] = {"guards": {"enabled": False}}
    assert plan_for(load(minimal).loops["tank"]).controller.gain_min_k == 0.0


@pytest.mark.parametrize(
    ("curve", "more", "volts", "temperature_c"),
    [
        ("lm335", {}, 3.1065, 37.5),
        ("lm35", {}, 0.375, 37.5),
        ("tmp36", {}, 0.875, 37.5),
        ("linear", {"kelvin_per_v": 20.0, "zero_v_c": 10.0}, 2.0, 50.0),
        # The divider at 37.5 degC: 5 V over R and 1 kohm; R(37.5) = 114.5749 ohm (IEC 60751).
        ("pt100", {"pull_up_ohm": 1e3}, 5.0 * 114.5749 / 1114.5749, 37.5),
        ("pt1000", {"pull_up_ohm": 1e3}, 5.0 * 1145.749 / 2145.749, 37.5),
        ("ntc", {"pull_up_ohm": 1e4}, 2.5, 25.0),
    ],
)
def test_every_curve_reads_a_known_temperature(whole, curve, more, volts, temperature_c):
    table = load(changed(whole, "loops.tank.sensor", curve=curve, **more)).loops["tank"].sensor
    measured = sensor_for(table).measure(RawSample(0.0, volts / 5.0 * 2**20, 2.0**20))
    assert measured.temperature_c == pytest.approx(temperature_c, abs=2e-3)


def test_what_can_run_has_no_wiring_errors_and_gives_a_loop(whole):
    settings = load(tomllib.loads(whole))
    assert list(wiring_errors(settings)) == []
    finished = []
    loop = loop_for(settings, SimulatedClock(), finished.append, beside=False)
    loop.cycle(0.0)
    assert [cycle.loop for cycle in finished] == ["tank"]
    loop.shut_down()


@pytest.mark.parametrize("part", ["sensor", "actuator"])
def test_a_loop_without_a_channel_cannot_run(whole, part):
    content = changed(whole, "loops.tank", **{part: None})
    assert errors(content) == [f"loops.tank: needs a table [loops.tank.{part}] to run"]
    with pytest.raises(ConfigError, match=rf"\[loops.tank.{part}\]"):
        loop_for(load(content), SimulatedClock(), lambda cycle: None)


def test_two_loops_must_agree_on_the_period(whole):
    content = changed(whole, "loops.mash", setpoint_c=65.0, trip_above_c=80.0, period_s=2.0)
    content["boards"]["other"] = {"kind": "simulated"}
    content["loops"]["mash"] |= {part: {"board": "other"} for part in ("sensor", "actuator")}
    assert errors(content) == [
        "loops.tank.period_s: expected one for all loops, got [1.0, 2.0]",
        "loops.mash.period_s: expected one for all loops, got [1.0, 2.0]",
    ]


def test_two_loops_may_not_drive_one_output(whole):
    content = tomllib.loads(whole)
    content["loops"]["mash"] = dict(content["loops"]["tank"])
    assert errors(content) == [
        "loops.mash.actuator: expected one loop for output 'heater' of 'daq', got tank, mash"
    ]


def test_a_board_without_a_dead_man_must_be_accepted(whole, foreign):
    content = changed(whole, "boards.daq", kind="foreign", volume_l=None)
    assert "accept_no_dead_man = true" in errors(content)[0]
    with pytest.raises(ConfigError, match="cannot switch its output off by itself"):
        loop_for(load(content), SimulatedClock(), lambda cycle: None)
    content["service"] = {"accept_no_dead_man": True}
    assert errors(content) == []


def test_a_start_in_another_mode_leaves_the_rest_as_it_is(whole):
    settings = load(tomllib.loads(whole))
    started = started_as(settings, {"tank": (Mode.AUTO, 40.0)})
    assert (started.loops["tank"].mode, started.loops["tank"].setpoint_c) == (Mode.AUTO, 40.0)
    assert started_as(started, {"tank": (Mode.OFF, 37.5)}) == settings


@pytest.mark.parametrize(
    ("path", "names", "told"),
    [
        ("loops.tank.sensor", {"input": "temprature"}, "input 'temprature'; did you mean 'tempe"),
        ("loops.tank.actuator", {"output": "heeter"}, "output 'heeter'; did you mean 'heater'"),
        ("loops.tank.cooler", {"board": "daq", "output": "cooler"}, "output 'cooler'; known: heat"),
        ("loops.tank.second_sensor", {"board": "daq", "input": "b"}, "input 'b'; known: temper"),
    ],
)
def test_a_channel_that_its_board_does_not_have_is_named_before_anything_runs(
    whole, path, names, told
):
    content = changed(whole, path, **names)
    if "cooler" in path:
        content["loops"]["tank"]["controller"] = {"kind": "pid", "action": "heat-cool"}
    (error,) = errors(content)
    key = next(each for each in ("input", "output") if each in names)
    assert error.startswith(f"{path}.{key}: board 'daq' has no {told}")


def test_a_simulated_board_has_the_channels_it_is_asked_for(whole):
    asked = changed(whole, "boards.daq", second_sensor=True, element_sensor=True, cooler_w=300.0)
    assert errors(changed(whole, "loops.tank.sensor", board="daq")) == []
    board = load(asked).boards["daq"]
    assert board.inputs == ("temperature", "temperature2", "element")
    assert board.outputs == ("heater", "cooler")


def test_a_driver_that_does_not_name_its_channels_is_believed(whole, foreign):
    content = changed(whole, "boards.daq", kind="foreign", volume_l=None)
    content["loops"]["tank"]["sensor"]["input"] = "anything"
    content["service"] = {"accept_no_dead_man": True}
    assert errors(content) == []
