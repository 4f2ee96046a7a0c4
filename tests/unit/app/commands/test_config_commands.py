"""``thermoctl config`` and ``thermoctl drivers`` from the command line."""

from __future__ import annotations

import json
import resource
import tomllib
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from thermoctl.app.catalogue import INJECTED
from thermoctl.app.cli import cli, main
from thermoctl.app.compose import wiring_errors
from thermoctl.app.configuration.toml_text import toml_text
from thermoctl.app.in_force import in_force
from thermoctl.app.parts import plan_for
from thermoctl.app.plugins import CONTROLLERS, ESTIMATORS, find, option_names
from thermoctl.app.settings import load

PROFILES = sorted((Path(__file__).parents[4] / "config").glob("*.toml"))
VALUES = st.recursive(
    st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=5,
)
TREES = st.dictionaries(
    st.text(max_size=6), VALUES | st.dictionaries(st.text(max_size=6), VALUES), max_size=4
)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]):
    """Return a function that runs a command and returns exit code, stdout and stderr."""

    def run(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            main([str(each) for each in arguments])
        out, err = capsys.readouterr()
        code = ended.value.code
        assert isinstance(code, int)
        return code, out, err

    return run


@pytest.fixture
def file(tmp_path: Path, whole: str) -> Path:
    """Return a configuration file that can run, writable by its owner only."""
    path = tmp_path / "tank.toml"
    path.write_text(whole)
    path.chmod(0o644)
    return path


# -- check -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", PROFILES, ids=lambda path: path.stem)
def test_every_profile_passes_the_check(run, path):
    code, out, _ = run("config", "check", "-c", path)
    assert code == 0
    held = [
        f"{name} ({loop.setpoint_c:g} °C, off above {loop.trip_above_c:g} °C"
        for name, loop in load(path).loops.items()
    ]
    assert out.startswith(f"{path}: ok; loops: {held[0]}")
    assert all(each in out for each in held)
    assert out.count("\n") == 1


def test_a_good_configuration_is_told_in_one_line_and_nothing_else(run, file):
    assert run("config", "check", "-c", file) == (
        0,
        f"{file}: ok; loops: tank (37.5 °C, off above 60 °C, self-tuning-mv, every 1 s); "
        "boards: daq (simulated)\n",
        "",
    )


def test_a_bad_configuration_exits_78_with_every_error_on_stderr(run, file):
    text = file.read_text().replace("setpoint_c", "setpoint").replace('"square"', '"cube"')
    file.write_text(text)
    code, out, err = run("config", "check", "-c", file)
    assert (code, out) == (78, "")
    assert f"thermoctl: {file}:6: loops.tank.setpoint: unknown key; did you mean 'se" in err
    assert f"thermoctl: {file}:14: loops.tank.actuator.law: expected 'linear', 'squ" in err


def test_a_loop_that_cannot_run_fails_the_check_on_its_line(run, file):
    text = file.read_text().replace('[loops.tank.sensor]\nboard = "daq"\n', "")
    file.write_text(text)
    code, _, err = run("config", "check", "-c", file)
    assert code == 78
    assert err == f"thermoctl: {file}:5: loops.tank: needs a table [loops.tank.sensor] to run\n"


def test_a_board_without_a_dead_man_fails_the_check_on_its_line(run, file, foreign):
    file.write_text(file.read_text().replace('"simulated"\nvolume_l = 8.0', '"foreign"'))
    code, _, err = run("config", "check", "-c", file)
    assert code == 78
    assert err.startswith(f"thermoctl: {file}:1: boards.daq: Foreign cannot switch")


LATER = "thermoctl: how loops and boards go together is checked once this is mended\n"


def test_a_bad_option_does_not_hide_how_the_boards_are_wired(run, file):
    text = file.read_text().replace('board = "daq"\nlaw', 'board = "daq"\noutput = "pump"\nlaw')
    file.write_text(text.replace('"self-tuning-mv"', '"self-tuning-mv"\npower_weigt = 1.0'))
    code, _, err = run("config", "check", "-c", file)
    assert code == 78
    assert "loops.tank.controller.power_weigt: unknown key" in err
    assert "loops.tank.actuator.output: board 'daq' has no output 'pump'" in err
    assert not err.endswith(LATER)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [("37.5", '"37.5"'), ('"simulated"', '"simulatd"'), ('board = "daq"\nlaw', 'board = "x"\nlaw')],
)
def test_what_could_not_be_checked_yet_is_said_at_the_end(run, file, right, wrong):
    file.write_text(file.read_text().replace(right, wrong))
    code, _, err = run("config", "check", "-c", file)
    assert code == 78
    assert err.endswith(LATER)


def test_the_errors_travel_as_json(run, file):
    file.write_text(file.read_text() + "\n[histroy]\n")
    code, out, _ = run("config", "check", "-c", file, "--json")
    error = json.loads(out)["error"]
    assert code == error["exit_code"] == 78
    assert error["problems"] == [
        {
            "file": str(file),
            "line": 24,
            "key": "histroy",
            "text": "unknown key; did you mean 'history'?",
        }
    ]


def test_a_good_check_travels_as_json(run, file):
    code, out, _ = run("config", "check", "-c", file, "--json")
    assert code == 0
    assert json.loads(out) == {
        "ok": True,
        "loops": ["tank"],
        "boards": {"daq": "simulated"},
        "warnings": [],
    }


def test_a_file_that_its_group_may_write_to_passes_with_a_warning(run, file):
    file.chmod(0o664)
    code, _, err = run("config", "check", "-c", file)
    assert code == 0
    assert err.startswith(f"thermoctl: {file}: group ")


def test_a_check_says_that_readings_are_coarse_and_what_to_set(run, file):
    text = file.read_text().replace("volume_l = 8.0", "bits = 10\nconversions = 1")
    file.write_text(text)
    code, out, err = run("config", "check", "-c", file)
    assert (code, out.startswith(f"{file}: ok")) == (0, True)
    assert "thermoctl: loops.tank.sensor: a conversion of boards.daq is in steps of 488 mK" in err
    _, out, _ = run("config", "check", "-c", file, "--json")
    assert "conversions to 32" in json.loads(out)["warnings"][0]


def test_a_check_says_that_a_set_point_lies_next_to_the_trip(run, file):
    file.write_text(file.read_text().replace("= 37.5", "= 59.99").replace("= 55.0", "= 60.0"))
    code, out, err = run("config", "check", "-c", file)
    assert (code, out.startswith(f"{file}: ok")) == (0, True)
    assert "setpoint_c: expected 57, 3 K below trip_above_c, or farther, got 59.99" in err
    _, out, _ = run("config", "check", "-c", file, "--json")
    assert "setpoint_c: expected 57" in json.loads(out)["warnings"][0]


# -- show and schema -------------------------------------------------------------------------------


@pytest.mark.parametrize("path", PROFILES, ids=lambda path: path.stem)
def test_what_is_shown_loads_as_the_same_settings(run, path):
    code, out, err = run("config", "show", "-c", path)
    assert (code, err) == (0, "")
    assert in_force(load(tomllib.loads(out))) == in_force(load(path))


def test_what_is_shown_as_json_loads_as_the_same_settings(run, file):
    _, out, _ = run("config", "show", "-c", file, "--json")
    assert in_force(load(json.loads(out))) == in_force(load(file))


def test_what_is_shown_holds_defaults(run, file):
    _, out, _ = run("config", "show", "-c", file)
    shown = tomllib.loads(out)
    assert "period_s" not in file.read_text()
    assert shown["loops"]["tank"]["period_s"] == 1.0


@pytest.mark.parametrize("path", PROFILES, ids=lambda path: path.stem)
def test_what_is_shown_has_every_option_and_makes_the_same_regulator(run, path):
    _, out, _ = run("config", "show", "-c", path)
    shown = tomllib.loads(out)
    for name, table in load(path).loops.items():
        for key, group in (("controller", CONTROLLERS), ("estimator", ESTIMATORS)):
            law = find(group, getattr(table, key).kind)
            assert set(option_names(law, INJECTED)) <= set(shown["loops"][name][key])
        again, plan = plan_for(load(shown).loops[name]), plan_for(table)
        assert (again.controller, again.limits) == (plan.controller, plan.limits)
        assert (again.shadow, again.identifier.P0) == (plan.shadow, plan.identifier.P0)


def test_constants_that_nobody_has_written_are_shown_in_their_tables(run, tmp_path, minimal):
    path = tmp_path / "least.toml"
    path.write_text(toml_text(minimal))
    _, out, _ = run("config", "show", "-c", path)
    tank = tomllib.loads(out)["loops"]["tank"]
    assert tank["controller"]["calmness"] == 0.35
    assert tank["controller"]["lags"]["count"] == 24
    assert (tank["estimator"]["R1"], tank["estimator"]["R2"]) == (1e-8, 0.1)


@given(TREES)
def test_whatever_is_written_as_toml_is_read_back(tree):
    assert tomllib.loads(toml_text(tree)) == tree


def test_what_toml_does_not_know_is_not_written():
    with pytest.raises(TypeError, match="expected text, a number, true, false or a list, got None"):
        toml_text({"a": None})


def test_the_schema_describes_boards_and_laws_by_kind(run):
    code, out, _ = run("config", "schema")
    schema = json.loads(out)
    assert code == 0
    boards = schema["properties"]["boards"]["additionalProperties"]["oneOf"]
    kinds = [board["properties"]["kind"]["const"] for board in boards]
    assert kinds == ["null", "simulated", "thermodaq"]
    loop = schema["$defs"]["LoopTable"]["properties"]
    assert loop["setpoint_c"]["x-unit"] == "°C"
    assert loop["setpoint_c"]["description"] == "Temperature to hold."
    [ckf] = [e for e in loop["estimator"]["anyOf"] if e["properties"]["kind"]["const"] == "ckf"]
    assert {"R1", "R2", "inflation_max", "P0", "theta0", "guards"} <= set(ckf["properties"])
    assert "Variance of the noise" in ckf["properties"]["R2"]["description"]
    [vff] = [e for e in loop["estimator"]["anyOf"] if e["properties"]["kind"]["const"] == "vff"]
    assert vff["required"] == ["kind", "Sigma0"]


def test_every_reference_in_the_schema_leads_somewhere(run):
    _, out, _ = run("config", "schema")
    schema = json.loads(out)

    def references(node: object) -> list[str]:
        if isinstance(node, dict):
            own = [node["$ref"]] if "$ref" in node else []
            return own + [each for value in node.values() for each in references(value)]
        return [e for each in node for e in references(each)] if isinstance(node, list) else []

    found = references(schema)
    assert found
    assert {each.removeprefix("#/$defs/") for each in found} <= set(schema["$defs"])


# -- new -------------------------------------------------------------------------------------------


KNOWN = ("--port", "/dev/ttyACM0", "--volume-l", 8, "--heater-w", 1500)


@pytest.mark.parametrize(
    ("kind", "known"), [("simulated", ()), ("null", ()), ("thermodaq", KNOWN)], ids=str
)
def test_a_new_configuration_of_any_kind_can_run(run, tmp_path, kind, known):
    path = tmp_path / "new.toml"
    code, out, err = run("config", "new", "--yes", "--kind", kind, *known, "-o", path)
    assert (code, out) == (0, "")
    assert str(path) in err
    assert list(wiring_errors(load(path))) == []


def test_a_new_configuration_has_the_gain_of_the_heater_and_the_water(run):
    _, out, _ = run("config", "new", "--yes", "--heater-w", 2000, "--volume-l", 20)
    loop = load(tomllib.loads(out)).loops["tank"]
    assert loop.gain_k_per_s == pytest.approx(2000 / (4186 * 20))


@pytest.mark.parametrize(
    ("heater_w", "volume_l", "weakest"),
    [(1500, 8, 8.96e-3), (3000, 500, 2.87e-4), (5000, 0.2, 0.5), (0.5, 500, 1e-6)],
)
def test_a_new_configuration_says_how_weak_a_healthy_heater_may_be(
    run, heater_w, volume_l, weakest
):
    options = ("--heater-w", heater_w, "--volume-l", volume_l, "--kind", "null")
    code, out, _ = run("config", "new", "--yes", *options, "--accept-no-dead-man")
    assert code == 0
    check = plan_for(load(tomllib.loads(out)).loops["tank"]).heater_check
    assert check.weakest_k_per_s == pytest.approx(weakest, rel=2e-3)


def test_the_answers_of_a_person_become_the_configuration():
    answers = "thermodaq\n/dev/ttyACM3\nntc\n4700\n12\n1000\n65\n80\noff\nn\n"
    result = CliRunner().invoke(cli, ["config", "new"], input=answers)
    assert result.exit_code == 0, result.stderr
    settings = load(tomllib.loads(result.stdout))
    loop = settings.loops["tank"]
    assert settings.boards["daq"].port == "/dev/ttyACM3"
    assert (loop.sensor.curve, loop.sensor.pull_up_ohm) == ("ntc", 4700.0)
    assert (loop.setpoint_c, loop.trip_above_c, loop.mode) == (65.0, 80.0, "off")
    assert loop.setpoint_c < loop.setpoint_max_c < loop.trip_above_c


def test_a_trip_below_the_setpoint_is_asked_again():
    answers = "simulated\nlm335\n8\n1500\n60\n50\n70\nauto\ny\n"
    result = CliRunner().invoke(cli, ["config", "new"], input=answers)
    assert result.exit_code == 0, result.stderr
    assert load(tomllib.loads(result.stdout)).loops["tank"].trip_above_c == 70.0


def test_water_is_neither_held_nor_tripped_above_100_degrees():
    answers = "simulated\nlm335\n8\n1500\n120\n60\n1500\n100\nauto\ny\n"
    result = CliRunner().invoke(cli, ["config", "new"], input=answers)
    assert result.exit_code == 0, result.stderr
    loop = load(tomllib.loads(result.stdout)).loops["tank"]
    assert (loop.setpoint_c, loop.trip_above_c) == (60.0, 100.0)


@pytest.mark.parametrize("setpoint_c", [-5.0, 37.5, 96.0, 99.5, 150.0])
@pytest.mark.parametrize("sensor", ["lm335", "lm35", "tmp36", "pt100", "pt1000", "ntc", "linear"])
def test_the_usual_answers_suit_every_sensor_that_can_show_the_setpoint(run, sensor, setpoint_c):
    code, out, err = run("config", "new", "--yes", "--sensor", sensor, f"--setpoint-c={setpoint_c}")
    cannot = (sensor in ("lm35", "linear") and setpoint_c < 10.0) or (sensor, setpoint_c) == (
        "ntc",
        150.0,
    )
    assert (code, out != "") == ((78, False) if cannot else (0, True)), err


@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "much"])
@pytest.mark.parametrize("option", ["--volume-l", "--heater-w"])
def test_a_size_that_is_none_is_refused(run, option, value):
    code, out, _ = run("config", "new", "--yes", option, value)
    assert code in (2, 78)
    assert out == ""


def test_options_that_contradict_each_other_write_nothing(run, tmp_path):
    path = tmp_path / "new.toml"
    arguments = ("--yes", "--setpoint-c", 60, "--trip-above-c", 50, "-o", path)
    code, _, err = run("config", "new", *arguments)
    assert code == 78
    assert "expected --trip-above-c above the set point of 60 degC, got 50" in err
    assert not path.exists()


def test_a_real_board_starts_off_and_does_not_go_on_after_a_restart(run):
    code, out, _ = run("config", "new", "--yes", "--kind", "thermodaq", *KNOWN)
    loop = load(tomllib.loads(out)).loops["tank"]
    assert (code, loop.mode, loop.resume) == (0, "off", False)


@pytest.mark.parametrize(("mode", "told"), [("off", True), ("auto", False)])
def test_who_begins_with_a_loop_that_is_off_is_told_how_to_switch_it_on(run, tmp_path, mode, told):
    path = tmp_path / "new.toml"
    _, _, err = run("config", "new", "--yes", "--mode", mode, "-o", path)
    assert ("thermoctl mode auto" in err) is told


def test_a_real_board_goes_on_by_itself_where_that_was_asked_for(run):
    asked = ("--mode", "auto", "--resume")
    code, out, _ = run("config", "new", "--yes", "--kind", "thermodaq", *KNOWN, *asked)
    loop = load(tomllib.loads(out)).loops["tank"]
    assert (code, loop.mode, loop.resume) == (0, "auto", True)


def test_a_person_who_agrees_to_everything_has_a_real_board_start_off():
    answers = "thermodaq\n\n\n12\n1000\n\n\n\n\n"
    result = CliRunner().invoke(cli, ["config", "new"], input=answers)
    assert result.exit_code == 0, result.stderr
    loop = load(tomllib.loads(result.stdout)).loops["tank"]
    assert (loop.mode, loop.resume) == ("off", False)
    assert "Go on after a restart [y/N]" in result.stderr


@pytest.mark.parametrize("left_out", [0, 2, 4])
def test_what_only_a_person_can_know_of_a_real_board_is_not_guessed(run, left_out):
    known = KNOWN[:left_out] + KNOWN[left_out + 2 :]
    code, out, err = run("config", "new", "--yes", "--kind", "thermodaq", *known)
    assert (code, out) == (2, "")
    assert f"expected {KNOWN[left_out]} for 'thermodaq', a real board" in err


def test_all_that_is_not_guessed_is_named_at_once(run):
    code, _, err = run("config", "new", "--yes", "--kind", "thermodaq")
    assert code == 2
    assert "expected --port, --volume-l, --heater-w for 'thermodaq'" in err


@pytest.mark.parametrize("option", ["--setpoint-c", "--trip-above-c", "--heater-w"])
def test_an_answer_that_is_no_number_is_told_by_the_option_it_was_given_to(run, option):
    code, _, err = run("config", "new", "--yes", option, "nan")
    assert code == 2
    assert err.startswith(f"thermoctl: {option}: expected a finite number, got nan")


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--heater-w", "1e9"),
        ("--volume-l", "1e9"),
        ("--setpoint-c", "-280"),
        ("--trip-above-c", "1e307"),
    ],
)
def test_an_answer_beyond_what_can_be_is_told_by_its_option(run, option, value):
    code, _, err = run("config", "new", "--yes", option, value)
    assert code == 78
    assert f"answers: {option}: expected at " in err


def test_a_trip_that_is_answered_with_no_number_is_asked_for_again():
    result = CliRunner().invoke(cli, ["config", "new"], input="\n\n\n\n\nnan\n60\n\n\n")
    assert result.exit_code == 0, result.stderr
    assert "expected a finite number, got nan" in result.stderr
    assert load(tomllib.loads(result.stdout)).loops["tank"].trip_above_c == 60.0


def test_the_end_of_input_is_a_wrong_use_on_a_line_of_its_own():
    result = CliRunner().invoke(cli, ["config", "new"], input="simulated\n")
    assert result.exit_code == 2
    *_, question, error = [line for line in result.stderr.splitlines() if "see" not in line][-3:]
    assert "expected an answer" not in question
    assert "expected an answer, got the end of input; with --yes nothing is asked" in error


def test_a_set_point_that_was_answered_next_to_the_trip_is_told(run):
    _, out, err = run("config", "new", "--yes", "--setpoint-c", 50, "--trip-above-c", 50.5)
    assert "loops.tank.setpoint_c: expected 49.5, 1 K below trip_above_c, or farther, got 50" in err
    assert load(tomllib.loads(out)).loops["tank"].setpoint_c == 50.0


@pytest.mark.parametrize("trip_c", [52, 55.005, 60, 70])
def test_the_highest_set_point_that_is_written_has_room_for_an_overshoot(run, trip_c):
    _, out, err = run("config", "new", "--yes", "--setpoint-c", 50, "--trip-above-c", trip_c)
    assert err == ""
    assert load(tomllib.loads(out)).loops["tank"].setpoint_max_c <= trip_c - 1.0


@contextmanager
def short_files():
    """Let no file grow beyond a hundred bytes, as on a disk that is full.

    Not a fixture: the runner writes its own lines between the parts of a test, perhaps to a file.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_file_that_cannot_be_written_whole_is_named_and_not_left_behind(run, tmp_path):
    path = tmp_path / "new.toml"
    with short_files():
        code, _, err = run("config", "new", "--yes", "-o", path)
    assert (code, err) == (1, f"thermoctl: {path}: File too large\n")
    assert not path.exists()


def test_the_watts_that_were_answered_are_the_loop_s_too(run, tmp_path):
    path = tmp_path / "new.toml"
    assert run("config", "new", "--yes", "--heater-w", 800, "-o", path)[0] == 0
    assert load(path).loops["tank"].heater_w == 800.0


def test_a_board_without_a_dead_man_needs_the_promise_of_a_thermostat(run, foreign):
    arguments = ("config", "new", "--yes", "--kind", "foreign", *KNOWN[2:])
    code, _, err = run(*arguments)
    assert code == 78
    assert err.startswith("thermoctl: answers: --kind: Foreign cannot switch its output off")
    assert "add an independent thermostat and say --accept-no-dead-man to run it" in err
    code, out, _ = run(*arguments, "--accept-no-dead-man")
    assert code == 0
    assert tomllib.loads(out)["service"] == {"accept_no_dead_man": True}


def test_a_file_that_is_there_is_replaced_only_by_force(run, file):
    before = file.read_text()
    code, _, err = run("config", "new", "--yes", "-o", file)
    assert code == 1
    assert "--force replaces it" in err
    assert file.read_text() == before
    assert run("config", "new", "--yes", "--force", "-o", file)[0] == 0
    assert file.read_text() != before


# -- drivers ---------------------------------------------------------------------------------------


def test_drivers_are_listed_with_dead_man_and_origin(run, foreign):
    code, out, _ = run("drivers", "--json")
    told = {each["kind"]: each for each in json.loads(out)}
    assert code == 0
    assert told["thermodaq"]["dead_man"] is True
    assert told["foreign"] == {
        "kind": "foreign",
        "dead_man": False,
        "origin": "thermoctl-foreign 1.2",
        "text": "A board from elsewhere.",
    }


def test_a_driver_that_cannot_be_loaded_does_not_hide_the_others(run, foreign):
    code, out, _ = run("drivers")
    lines = {line.split()[0]: line for line in out.splitlines()[1:]}
    assert code == 0
    assert "cannot be loaded" in lines["broken"]
    assert lines["simulated"].split()[1] == "yes"


def test_the_settings_of_a_kind_are_shown_with_bounds_and_defaults(run):
    code, out, _ = run("drivers", "show", "thermodaq")
    rows = {line.split()[0]: line for line in out.splitlines()[2:]}
    assert code == 0
    assert "required" in rows["port"]
    assert "number, s" in rows["dead_man_s"]
    assert "≥ 0.2, ≤ 10" in rows["dead_man_s"]
    assert " 2.5 " in rows["dead_man_s"]
    assert rows["dead_man_s"].find("The board cuts") == rows["port"].find("Serial device") > 0


def test_the_settings_of_an_unknown_kind_are_a_wrong_use(run):
    code, _, err = run("drivers", "show", "thermodac")
    assert code == 2
    assert "no driver is called 'thermodac'; did you mean 'thermodaq'?" in err
