"""Reading a configuration: what is taken, and how what is wrong is told."""

from __future__ import annotations

import contextlib
import math
import os
import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.app.compose import regulator_for, wiring_errors
from thermoctl.app.configuration.device_tables import ActuatorTable, SensorTable
from thermoctl.app.configuration.document import BadConfiguration, exposures
from thermoctl.app.configuration.tables import (
    GuardsTable,
    HistoryTable,
    LoopTable,
    ModelTable,
    ServiceTable,
)
from thermoctl.app.doubts import doubts
from thermoctl.app.in_force import in_force
from thermoctl.app.settings import load, load_all
from thermoctl.errors import ConfigError
from thermoctl_drivers.simulated import SimulatedSettings

PROFILES = sorted((Path(__file__).parents[3] / "config").glob("*.toml"))
TABLES = {
    "loops.tank": LoopTable,
    "loops.tank.sensor": SensorTable,
    "loops.tank.actuator": ActuatorTable,
    "loops.tank.model": ModelTable,
    "loops.tank.estimator.guards": GuardsTable,
    "boards.daq": SimulatedSettings,
    "history": HistoryTable,
    "service": ServiceTable,
}
KEYS = [(t, k) for t, model in TABLES.items() for k in model.model_fields if len(k) >= 4]
ONE_SENSOR_TWICE = {
    "sensor": {"board": "daq", "curve": "lm35"},
    "second_sensor": {"board": "daq", "curve": "lm335"},
}
WHOLE = """\
[boards.daq]
kind = "simulated"

[loops.tank]
setpoint_c = 37.5
trip_above_c = 60.0

[loops.tank.sensor]
board = "daq"

[loops.tank.actuator]
board = "daq"
"""


def problems(source) -> list[str]:
    """Return a line for everything that is wrong with `source`."""
    with pytest.raises(BadConfiguration) as caught:
        load(source)
    return str(caught.value).splitlines()


def tank(minimal: dict, **keys: object) -> dict:
    """Return the least configuration with more keys in its loop."""
    minimal["loops"]["tank"] |= keys
    return minimal


# -- what is taken ---------------------------------------------------------------------------------


@pytest.mark.parametrize("path", PROFILES, ids=lambda path: path.stem)
def test_every_profile_loads_can_run_and_gives_regulators(path):
    loaded = load(path)
    assert list(wiring_errors(loaded)) == []
    for name in loaded.loops:
        regulator_for(loaded, name)


def test_there_are_profiles():
    assert {path.stem for path in PROFILES} >= {"aquarium", "ozbek2021", "thermodaq"}


@pytest.mark.parametrize("kind", ["ckf", "nkf"])
def test_a_table_that_only_names_a_filter_has_the_noises_of_no_table_at_all(minimal, kind):
    without = load(minimal).loops["tank"].estimator
    minimal["loops"]["tank"]["estimator"] = {"kind": kind}
    named = load(minimal).loops["tank"].estimator
    assert named.options == without.options == {"R1": 1e-8, "R2": 0.1}


def test_a_noise_that_is_written_stands(minimal):
    minimal["loops"]["tank"]["estimator"] = {"kind": "ckf", "R1": 0.0}
    assert load(minimal).loops["tank"].estimator.options == {"R1": 0.0, "R2": 0.1}


def test_what_is_in_force_loads_as_the_same_settings(minimal):
    minimal["loops"]["tank"]["estimator"] = {"kind": "ckf", "inflation_max": math.inf}
    loaded = load(minimal)
    assert load(loaded.in_force()) == loaded


def test_whole_numbers_are_taken_for_floats(minimal):
    loaded = load(tank(minimal, setpoint_c=40)).loops["tank"].setpoint_c
    assert loaded == 40.0
    assert isinstance(loaded, float)


def test_a_controller_may_be_named_without_a_table(minimal):
    assert load(tank(minimal, controller="on-off")).loops["tank"].controller.kind == "on-off"


def test_settings_of_a_foreign_driver_take_lists_and_refuse_text_for_numbers(minimal, foreign):
    minimal["boards"] = {"daq": {"kind": "foreign", "colours": ["red", "blue"]}}
    assert load(minimal).boards["daq"].colours == ("red", "blue")
    minimal["boards"]["daq"]["gain"] = "2.0"
    assert problems(minimal) == [
        'configuration: boards.daq.gain: expected a number, got "2.0" (write it without quotes)'
    ]


def test_a_byte_order_mark_is_overlooked(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("\ufeff" + WHOLE, encoding="utf-8")
    assert load(path) == load(tomllib.loads(WHOLE))


def test_settings_cannot_be_changed(minimal):
    with pytest.raises(ValueError, match="frozen"):
        load(minimal).loops["tank"].setpoint_c = 1.0


# -- what is refused -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "came"),
    [
        ("37.5", 'a number, got "37.5" (write it without quotes)'),
        ("warm", 'a number, got "warm"'),
        (True, "a number, got true"),
        ([37.5], "a number, got [37.5]"),
        (math.nan, "a finite number, got NaN"),
        (math.inf, "a finite number, got Infinity"),
        (10**400, f"a finite number, got 1{'0' * 59}..."),
        (-300.0, "at least -273.15, got -300.0"),
        (3000, "at most 2000, got 3000"),
    ],
)
def test_a_setpoint_that_is_no_temperature_is_refused(minimal, value, came):
    assert problems(tank(minimal, setpoint_c=value)) == [
        f"configuration: loops.tank.setpoint_c: expected {came}"
    ]


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"resume": 1}, "resume: expected true or false, got 1"),
        ({"mode": "on"}, "mode: expected 'off', 'manual' or 'auto', got \"on\""),
        ({"mode": "program"}, "mode: expected 'off', 'manual' or 'auto', got"),
        ({"period_s": 0.0}, "period_s: expected at least 0.05, got 0.0"),
        ({"power_max": 1.5}, "power_max: expected at most 1, got 1.5"),
        ({"jump_k": 0}, "jump_k: expected a number above 0, got 0"),
        ({"sensor": "daq"}, 'sensor: expected a table, got "daq"'),
        ({"sensor": {}}, "sensor.board: expected a value, got none"),
        (
            {"sensor": {"board": "daq", "calibration_gain": 2.0}},
            "sensor.calibration_gain: expected at most 1.25, got 2.0",
        ),
        (
            {"sensor": {"board": "daq", "calibration_offset_k": -30}},
            "sensor.calibration_offset_k: expected at least -20, got -30",
        ),
        (
            {"sensor": {"board": "daq", "open_above": 0.0, "short_below": 0.5}},
            "sensor.short_below: expected at least 0 and less than open_above (0.0, at most 1), "
            "got 0.5",
        ),
        ({"controller": 3}, "controller: expected a table, got 3"),
        ({"controller": "mpc"}, "controller.kind: no controller is called 'mpc'"),
        ({"model": {"n": 2.0}}, "model.n: expected a whole number, got 2.0"),
        ({"model": {"gain_k_per_s": 1e308}}, "model.gain_k_per_s: expected at most 1e+06, got"),
        ({"estimator": {"kind": "ckv"}}, "estimator.kind: no estimator is called 'ckv'; did you"),
        ({"estimator": {"kind": "ckf", "R3": 1}}, "estimator.R3: unknown key; known: R1, R2, infl"),
        ({"estimator": {"kind": "vff"}}, "estimator.Sigma0: expected a value, got none"),
        ({"estimator": {"R2": -1.0}}, "estimator.R2: expected a number above 0, got -1.0"),
        ({"estimator": {"theta0": [1.0, 2.0]}}, "estimator.theta0: "),
        ({"estimator": {"theta0": ["1"]}}, "estimator.theta0.0: expected a number"),
        (
            {"controller": {"kind": "manual", "power": 2}},
            "controller.power: expected a number in [0, 1]",
        ),
    ],
)
def test_a_bad_key_of_a_loop_is_named_with_what_was_expected(minimal, keys, told):
    minimal["boards"] = {"daq": {"kind": "simulated"}}
    [problem] = problems(tank(minimal, **keys))
    assert problem.startswith(f"configuration: loops.tank.{told}")


@pytest.mark.parametrize(
    ("key", "value", "hint"),
    [
        ("setpoint_f", 99.5, "unknown key; the unit here is °C: setpoint_c = 37.5"),
        ("setpoint_k", 310.65, "unknown key; the unit here is °C: setpoint_c = 37.5"),
        ("period_ms", 500, "unknown key; the unit here is s: period_s = 0.5"),
        ("period_min", 2, "unknown key; the unit here is s: period_s = 120"),
        ("trip_above_f", "hot", "unknown key; the unit here is °C: trip_above_c"),
        ("rise_per_min", 0.1, "unknown key; the unit here is 1/s: rise_per_s"),
    ],
)
def test_a_key_in_another_unit_is_told_the_right_one(minimal, key, value, hint):
    assert f"configuration: loops.tank.{key}: {hint}" in problems(tank(minimal, **{key: value}))


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"trip_below_c": 70.0}, "trip_below_c: expected less than trip_above_c (60), got 70"),
        (
            {"setpoint_max_c": 65.0},
            "setpoint_max_c: expected from the least set point (-10) to trip_above_c (60), got 65",
        ),
        (
            {"setpoint_c": 60.0},
            "setpoint_c: expected from -10 to 60 and below trip_above_c (60), got 60",
        ),
        ({"setpoint_max_c": 30.0}, "setpoint_c: expected from -10 to 30 and"),
    ],
)
def test_limits_that_contradict_each_other_are_refused(minimal, keys, told):
    [problem] = problems(tank(minimal, **keys))
    assert told in problem


def test_a_typo_does_not_hide_limits_that_contradict_each_other(minimal):
    lines = problems(tank(minimal, setpoint_c=70.0, perod_s=1.0))
    assert len(lines) == 2
    assert "perod_s: unknown key; did you mean 'period_s'?" in lines[0]
    assert "setpoint_c: expected from -10 to 60 and below trip_above_c (60), got 70" in lines[1]


def test_a_bad_value_beside_them_does_not_hide_limits_that_contradict_each_other(minimal):
    lines = problems(tank(minimal, setpoint_c=70.0, mode="on", model={"n": 0}))
    assert [line.split(":")[1] for line in lines] == [
        " loops.tank.mode",
        " loops.tank.model.n",
        " loops.tank.setpoint_c",
    ]


def test_limits_of_which_one_is_bad_are_not_judged_by_its_default(minimal):
    [line] = problems(tank(minimal, setpoint_c=-20.0, trip_below_c="-30"))
    assert "trip_below_c: expected a number" in line


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        (
            {
                "setpoint_c": 75.0,
                "controller": "adaptve",
                "estimator": {"kind": "ckf", "R2": -1.0},
            },
            ["setpoint_c", "controller.kind", "estimator.R2"],
        ),
        (
            {"controller": {"kind": "adaptive", "calmness": 35.0, "calm": 1, "lags": {"count": 0}}},
            ["controller.calm", "controller.calmness", "controller.lags.count"],
        ),
        (
            {"mode": "on", "sensor": {"board": "daq", "curve": "lm336"}, "estimator": {"R2": -1.0}},
            ["mode", "sensor.curve", "estimator.R2"],
        ),
        (
            {"trip_above_c": "hot", "shadow": "pit", "model": {"structure": "ark"}},
            ["trip_above_c", "model.structure", "shadow.kind"],
        ),
        (
            {"actuator": {"board": "daq", "law": "cube"}, "controller": "mpc"},
            ["actuator.law", "controller.kind"],
        ),
        (
            {"setpoint_c": -80.0, "trip_below_c": -90.0, "controller": "mpc", **ONE_SENSOR_TWICE},
            ["setpoint_c", "trip_below_c", "controller.kind", "second_sensor.input"],
        ),
        (
            {"trip_above_c": 300.0, "estimator": {"kind": "ckf", "R2": -1.0}, **ONE_SENSOR_TWICE},
            ["trip_above_c", "estimator.R2", "second_sensor.input"],
        ),
    ],
)
def test_a_mistake_in_one_place_does_not_hide_those_in_others(minimal, keys, told):
    minimal["boards"] = {"daq": {"kind": "simulated"}}
    found = [line.split(": ")[1] for line in problems(tank(minimal, **keys))]
    assert sorted(found) == sorted(f"loops.tank.{key}" for key in told)


def test_an_option_behind_a_bad_one_is_shown_as_it_was_written(minimal):
    lines = problems(tank(minimal, estimator={"kind": "ckf", "R1": math.inf, "R2": math.inf}))
    assert [line.rpartition(", ")[2] for line in lines] == ["got inf", "got inf"]


@pytest.mark.parametrize("place", [(), ("actuator",), ("model",)])
def test_an_unknown_key_may_look_like_what_tells_tables_apart(minimal, place):
    keys = {"<board>": 1}
    for name in place:
        keys = {name: keys}
    minimal["boards"] = {"daq": {"kind": "simulated"}}
    path = ".".join(("loops.tank", *place, "<board>"))
    assert any(f" {path}: unknown key" in line for line in problems(tank(minimal, **keys)))


@pytest.mark.parametrize(
    "keys",
    [
        {"controller": {"kind": "adaptve", "action": "cool"}, "shadow": {"action": "cool"}},
        {"controller": {"kind": "adaptive", "action": "heat-cool"}, "cooler": {"output": 3}},
        {"shadow": {"kind": "pid", "action": "cool"}, "controller": {"kind": "x"}},
    ],
)
def test_what_follows_from_a_mistake_alone_is_not_told(minimal, keys):
    minimal["boards"] = {"daq": {"kind": "simulated"}}
    if "shadow" in keys:
        keys["shadow"].setdefault("kind", "pid")
    assert not any("action" in line for line in problems(tank(minimal, **keys)))


@pytest.mark.parametrize(("curve", "reference_v"), [("lm335", 5000), ("tmp36", 0.01)])
def test_a_reference_that_no_converter_has_is_told_at_its_own_key(minimal, curve, reference_v):
    minimal["boards"] = {"daq": {"kind": "simulated"}}
    sensor = {"board": "daq", "curve": curve, "reference_v": reference_v}
    [line] = problems(tank(minimal, sensor=sensor))
    told = f"expected a converter that can show a room, got {reference_v:g} V"
    assert line == f"configuration: loops.tank.sensor.reference_v: {told}"


def test_a_limit_that_contradicts_another_has_the_line_of_its_key(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(WHOLE.replace("37.5", "61"))
    assert problems(path) == [
        f"{path}:5: loops.tank.setpoint_c: expected from -10 to 60 and below trip_above_c (60), "
        "got 61"
    ]


def test_a_board_that_is_not_there_is_told_the_nearest_one(minimal):
    minimal["boards"] = {"daq": {"kind": "simulated"}}
    assert problems(tank(minimal, sensor={"board": "dac"})) == [
        "configuration: loops.tank.sensor.board: no table [boards.dac] there; did you mean 'daq'?"
    ]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ({}, "loops: expected at least one table [loops.NAME], got none"),
        ({"loops": {}}, "loops: expected at least one table [loops.NAME], got none"),
        ({"loops": 3}, "loops: expected tables [loops.NAME], got 3"),
        ({"loops": {"tank": 3}}, "loops.tank: expected a table, got 3"),
        ({"boards": {"daq": {}}}, "boards.daq: expected a kind, got none; known: "),
        ({"boards": {"daq": {"kind": 3}}}, "boards.daq.kind: no driver is called '3'"),
        ({"boards": []}, "boards: expected tables [boards.NAME], got []"),
        ({"lops": {}}, "lops: unknown key; did you mean 'loops'?"),
        ({"history": {"enabled": "yes"}}, 'history.enabled: expected true or false, got "yes"'),
        ({"service": 1}, "service: expected a table, got 1"),
    ],
)
def test_a_document_that_is_none_is_refused(content, told):
    assert any(line.startswith(f"configuration: {told}") for line in problems(content))


def test_a_name_that_is_no_name_is_refused():
    loop = {"setpoint_c": 37.5, "trip_above_c": 60}
    assert "named with up to 64 of" in problems({"loops": {"a/b": loop}})[0]


# -- where it stands -------------------------------------------------------------------------------


def test_everything_wrong_is_told_at_once_with_file_and_line(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(
        '[boards.daq]\nkind = "simulatd"\n\n[loops.tank]\nsetpoint_f = 99.5\ntrip_above_c = 60\n'
        '[loops.tank.sensor]\nboard = "daq"\ninput = 5\n[loops.mash]\nsetpoint_c = 1\n'
        'trip_above_c = 3\n[loops.mash.controller]\nkind = "on-off"\nhysteresis = 1.0\n'
    )
    assert problems(path) == [
        f"{path}:2: boards.daq.kind: no driver is called 'simulatd'; did you mean 'simulated'?",
        f"{path}:4: loops.tank.setpoint_c: expected a value, got none",
        f"{path}:9: loops.tank.sensor.input: expected text in quotes, got 5",
        f"{path}:5: loops.tank.setpoint_f: unknown key; the unit here is °C: setpoint_c = 37.5",
        f"{path}:15: loops.mash.controller.hysteresis: unknown key; did you mean 'hysteresis_k'?",
    ]


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("[loops.tank]\nsetpoint_c = \n", 2, "no valid TOML: Invalid value in column 14"),
        ("[a]\nb = 1\n[a]\n", 3, "no valid TOML"),
        ("[a]\nb = '''never closed\n\n", 3, "no valid TOML: Expected \"'''\" (at end of document)"),
        ("a = " + "9" * 5000, None, "no valid TOML: Exceeds the limit"),
        ("a = " + "[" * 5000, None, "no valid TOML"),
    ],
)
def test_a_syntax_error_names_file_and_line(tmp_path, text, line, words):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    place = str(path) if line is None else f"{path}:{line}"
    [problem] = problems(path)
    assert problem.startswith(f"{place}: {words}")


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("setpoint_c = 37,5", "; write a decimal point, not a comma"),
        ("resume = True", "; write true or false in small letters, and text in quotes"),
        ("mode = auto", "; write true or false in small letters, and text in quotes"),
        ("setpoint_c = ", "Invalid value in column 14"),
    ],
)
def test_a_usual_slip_of_syntax_brings_a_hint(tmp_path, line, hint):
    path = tmp_path / "bad.toml"
    path.write_text(f"[loops.tank]\n{line}\n")
    [problem] = problems(path)
    assert problem.startswith(f"{path}:2: no valid TOML: ")
    assert problem.endswith(hint)


def test_a_typo_in_the_first_part_of_a_table_has_the_line_of_that_table(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(f'{WHOLE}\n\n[loop.tank.sensor]\nboard = "daq"\n')
    line = path.read_text().splitlines().index("[loop.tank.sensor]") + 1
    assert problems(path) == [f"{path}:{line}: loop: unknown key; did you mean 'loops'?"]


def test_the_problems_travel_as_data(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(WHOLE.replace("37.5", '"37.5"'))
    with pytest.raises(BadConfiguration) as caught:
        load(path)
    assert [problem.as_json() for problem in caught.value.problems] == [
        {
            "file": str(path),
            "line": 5,
            "key": "loops.tank.setpoint_c",
            "text": 'expected a number, got "37.5" (write it without quotes)',
        }
    ]


def test_several_files_make_one_configuration(tmp_path):
    boards, loops = WHOLE.split("\n\n", 1)
    (tmp_path / "a.toml").write_text(boards)
    (tmp_path / "b.toml").write_text(loops)
    together = load_all([tmp_path / "a.toml", tmp_path / "b.toml"])
    assert together == load(tomllib.loads(WHOLE))


def test_an_error_in_one_of_several_files_names_that_file(tmp_path):
    boards, loops = WHOLE.split("\n\n", 1)
    (tmp_path / "a.toml").write_text(boards)
    (tmp_path / "b.toml").write_text(loops.replace("setpoint_c", "setpoint"))
    with pytest.raises(ConfigError) as caught:
        load_all([tmp_path / "a.toml", tmp_path / "b.toml"])
    assert f"{tmp_path / 'b.toml'}:2: loops.tank.setpoint: unknown key" in str(caught.value)


def test_a_table_may_not_stand_in_two_files(tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.toml").write_text(WHOLE)
    with pytest.raises(ConfigError) as caught:
        load_all([tmp_path / "a.toml", tmp_path / "b.toml"])
    first, second = tmp_path / "a.toml", tmp_path / "b.toml"
    assert str(caught.value).splitlines() == [
        f"{second}:1: boards.daq: stands in {first} as well",
        f"{second}:4: loops.tank: stands in {first} as well",
    ]


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"nowhere\.toml: no such file"):
        load(tmp_path / "nowhere.toml")


def test_a_pipe_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.toml")
    with pytest.raises(ConfigError, match=r"a\.toml: expected a regular file, got a pipe"):
        load(tmp_path / "a.toml")


def test_a_device_is_refused():
    with pytest.raises(ConfigError, match="/dev/zero: expected a regular file, got a device"):
        load("/dev/zero")


@pytest.mark.parametrize("content", [b"\xff\xfe", b"a = '\x80'"])
def test_a_file_that_is_not_utf_8_is_refused(tmp_path, content):
    path = tmp_path / "a.toml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match="expected a readable TOML file in UTF-8"):
        load(path)


# -- typos -----------------------------------------------------------------------------------------


@st.composite
def typos(draw) -> tuple[str, str, str]:
    """Return a table, a key of it, and the key with one slip of the finger."""
    table, key = draw(st.sampled_from(KEYS))
    at = draw(st.integers(0, len(key) - 2))
    slip = draw(st.sampled_from(["drop", "double", "swap"]))
    typed = {
        "drop": key[:at] + key[at + 1 :],
        "double": key[: at + 1] + key[at:],
        "swap": key[:at] + key[at + 1] + key[at] + key[at + 2 :],
    }[slip]
    return table, key, typed


@settings(deadline=None, max_examples=100, derandomize=True)
@given(typos())
def test_a_slip_of_the_finger_is_refused_with_the_key_that_was_meant(typo):
    table, key, typed = typo
    known = TABLES[table].model_fields
    if typed in known:
        return
    content = tomllib.loads(WHOLE)
    inner = content
    for part in table.split("."):
        inner = inner.setdefault(part, {})
    inner[typed] = 1
    told = [line for line in problems(content) if f"{table}.{typed}: unknown key" in line]
    assert len(told) == 1
    assert re.search(rf"(did you mean '|: ){key}\b", told[0].partition("unknown key")[2]), told


@settings(deadline=None, max_examples=100, derandomize=True)
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(["loops", "boards", "tank", "sensor", "kind", "setpoint_c", "x"]),
                inner,
                max_size=4,
            )
        ),
        max_leaves=12,
    )
)
def test_no_content_whatever_raises_anything_but_a_config_error(value):
    content = value if isinstance(value, dict) else {"loops": value}
    with contextlib.suppress(ConfigError):
        load(content)


@pytest.mark.parametrize("value", [5e-324, 1e-300, 1e308, -1e308])
@pytest.mark.parametrize("curve", ["lm335", "ntc", "linear"])
def test_no_number_in_any_key_raises_anything_but_a_config_error(curve, value):
    for table, key in KEYS:
        content = tomllib.loads(WHOLE)
        content["loops"]["tank"]["sensor"] |= {"curve": curve, "pull_up_ohm": 1e4}
        inner = content
        for part in table.split("."):
            inner = inner.setdefault(part, {})
        inner[key] = value
        with contextlib.suppress(ConfigError):
            doubts(load(content))


# -- who may write it ------------------------------------------------------------------------------


def test_a_private_file_is_exposed_to_nobody(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(WHOLE)
    path.chmod(0o644)
    assert exposures([path]) == []


@pytest.mark.parametrize(("mode", "whose"), [(0o664, "group"), (0o646, "everybody")])
def test_a_file_that_others_may_write_to_is_told(tmp_path, mode, whose):
    path = tmp_path / "a.toml"
    path.write_text(WHOLE)
    path.chmod(mode)
    [told] = exposures([path])
    assert whose in told
    assert f"chmod go-w {path}" in told


def test_a_file_in_a_folder_that_is_open_to_everybody_is_told(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(WHOLE)
    path.chmod(0o644)
    tmp_path.chmod(0o777)
    assert "everybody may replace it" in exposures([path])[0]
    tmp_path.chmod(0o1777)  # the sticky bit keeps others from replacing it
    assert exposures([path]) == []


def test_root_does_not_obey_a_file_that_everybody_may_write_to(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(WHOLE)
    path.chmod(0o666)
    if os.geteuid() != 0:
        assert load(path) == load(tomllib.loads(WHOLE))
        return
    with pytest.raises(ConfigError, match="only its owner may write to, got mode 0666"):
        load(path)


def test_litres_and_watts_are_the_gain_of_a_model_that_is_given_none():
    rated = {"setpoint_c": 37.5, "trip_above_c": 60.0, "heater_w": 2000.0, "volume_l": 20.0}
    follows = load({"loops": {"tank": rated}})
    assert follows.loops["tank"].gain_k_per_s == pytest.approx(2000.0 / (4186.0 * 20.0))
    assert in_force(follows)["loops"]["tank"]["model"]["gain_k_per_s"] == pytest.approx(
        0.02389, 1e-3
    )
    given = load({"loops": {"tank": rated | {"model": {"gain_k_per_s": 0.03}}}})
    assert given.loops["tank"].gain_k_per_s == 0.03


def test_litres_without_watts_say_nothing():
    with pytest.raises(
        ConfigError, match="heater_w: expected the watts that warm volume_l, got none"
    ):
        load({"loops": {"tank": {"setpoint_c": 37.5, "trip_above_c": 60.0, "volume_l": 8.0}}})
