"""The command that commissions a loop: what it refuses, asks, prints and leaves behind."""

import csv
import errno
import json
import os
import signal
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from thermoctl.app.cli import cli
from thermoctl.app.commands import tune as tune_module
from thermoctl.app.commands.endings import exit_code_of, words_of
from thermoctl.app.commands.tune import tune_command
from thermoctl.app.settings import load
from thermoctl.app.tuning.suggestion import limit_keys
from thermoctl.app.tuning.trial import plan
from thermoctl.services.lock import DaemonLock
from thermoctl.services.store import Latch, LatchStore
from thermoctl.studies import figure as house
from thermoctl.studies.tuning_limits import Proposal

BOARD = """
[boards.daq]
kind = "null"
counts = 65000.0  # an open sensor

[service]
accept_no_dead_man = true

[loops.tank]
setpoint_c = 37.5
trip_above_c = 60.0

[loops.tank.sensor]
board = "daq"

[loops.tank.actuator]
board = "daq"
"""

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def places(tmp_path, monkeypatch):
    """Folders of one's own, and figures with fewer dots."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "run"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setitem(house._STYLE, "savefig.dpi", 40.0)


def run(*words, answer=None):
    """Return exit code, what is printed, and what is said."""
    came = CliRunner().invoke(cli, ["tune", *map(str, words)], input=answer)
    code, said = came.exit_code, came.stderr
    if came.exception is not None and not isinstance(came.exception, SystemExit):
        code, said = exit_code_of(came.exception), said + words_of(came.exception)
    elif came.return_value:
        code = came.return_value
    return code, came.stdout, said


def code_of(*words):
    """Return the exit code and the words of a command that ends with a number."""
    with tune_command.make_context("tune", [str(word) for word in words]) as context:
        return tune_command.invoke(context)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of ten minutes on the simulated aquarium, made once."""
    folder = tmp_path_factory.mktemp("tune")
    code, printed, said = run("--sim", "--duration", "10m", "--out", folder / "o", "--json")
    assert code == 0, said
    return json.loads(printed), folder / "o"


def test_the_report_tells_of_the_run(report):
    told, _ = report
    assert (told["loop"], told["simulated"], told["ending"]) == ("tank", True, "finished")
    assert told["off_confirmed"] is True
    assert told["samples"] == 601
    assert 37.0 < told["hottest_c"] < 38.5
    assert told["signal"]["top_c"] == 37.5
    assert told["reached"] is True


def test_the_report_tells_of_the_plant_with_bounds(report):
    plant = report[0]["plant"]
    assert plant["gain_k_per_min"]["low"] < 2.5 < plant["gain_k_per_min"]["high"]
    assert 10.0 < plant["lag_s"]["low"] < plant["lag_s"]["high"] < 23.5  # 13.5 + 6 + 2, less glass
    assert plant["holding_power"]["low"] < 0.19 < plant["holding_power"]["high"]


def test_the_report_tells_of_orders_and_parameters(report):
    told, _ = report
    model = told["model"]
    assert len(told["orders"]) == 72
    assert len(model["theta"]) == len(model["theta_sd"]) == model["n"] + model["m"]


def test_the_suggested_table_is_one_that_can_be_loaded(report):
    told, _ = report
    keys = tomllib.loads(told["suggestion_toml"])["loops"]["tank"]["model"]
    assert keys == told["suggestion"]
    table = {"setpoint_c": 37.5, "trip_above_c": 60.0, "model": keys}
    model = load({"loops": {"tank": table}}).loops["tank"].model
    assert 60.0 * model.gain_k_per_s == pytest.approx(
        told["plant"]["gain_k_per_min"]["value"], rel=1e-3
    )


def test_files_hold_the_report_the_figure_and_a_run_that_can_be_replayed(report):
    told, folder = report
    assert json.loads((folder / "report.json").read_text()) == told
    assert (folder / "report.png").read_bytes().startswith(b"\x89PNG")
    assert "K/min at full power" in (folder / "report.txt").read_text()
    with (folder / "run.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 601
    assert {float(row["accepted_power"]) for row in rows} == {0.0, 1.0}
    again = CliRunner().invoke(cli, ["replay", str(folder / "run.csv"), "--json"])
    assert json.loads(again.stdout)["samples"] == 601


def test_text_and_files_say_the_same(tmp_path):
    code, printed, said = run("--sim", "--duration", "5m", "--order", "2,1,4", "--out", "o")
    assert code == 0
    assert printed == (tmp_path / "o" / "report.txt").read_text()
    assert "power 0 confirmed" in printed
    assert "Order    given" in printed
    assert "report.json written" in said


def test_a_run_is_written_where_it_cannot_be_printed(monkeypatch):
    def full(content):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("thermoctl.app.commands.tune.print_json", full)
    code, _, said = run("--sim", "--duration", "5m", "--order", "2,1,4", "--out", "o", "--json")
    assert code == 1
    assert "No space left on device" in said
    assert {each.name for each in Path("o").iterdir()} >= {"report.txt", "report.json", "run.csv"}


def test_a_band_that_was_not_reached_is_told_and_nothing_suggested():
    code, printed, _ = run("--sim", "--duration", "4m", "--out", "o")
    assert code == 0
    assert "Band     not reached: 36.5 °C" in printed
    report = json.loads(Path("o/report.json").read_text())
    assert (report["reached"], report["plant"], report["suggestion"]) == (False, None, None)


def test_a_loop_that_is_warmer_than_the_band_is_told_why_nothing_was_heard(tmp_path):
    config = Path("warm.toml")
    config.write_text(
        '[boards.daq]\nkind = "simulated"\nambient_c = 30.0\nice_kg = 0.0\n'
        + BOARD[BOARD.index("[loops.tank]") :].replace("37.5", "20.0")
    )
    code, printed, _ = run("--sim", "-c", config, "--duration", "5m", "--out", "o")
    assert code == 0
    assert "Band     not reached: no reading fell to 20 °C" in printed


def test_a_loop_of_structure_arx_is_suggested_its_order(tmp_path):
    config = Path("arx.toml")
    config.write_text(BOARD + '[loops.tank.model]\nstructure = "arx"\n')
    code, printed, _ = run("--sim", "-c", config, "--order", "2,1,4", "--duration", "9m", "--json")
    assert code == 0
    keys = json.loads(printed)["suggestion"]
    assert (keys["n"], keys["m"], keys["delay"]) == (2, 1, 4)


def test_an_interrupted_run_keeps_what_is_finished(monkeypatch):
    from thermoctl.app.tuning import run as tune_run

    class Interrupting(tune_run.Trial):
        def _follow(self, cycle):
            super()._follow(cycle)
            if cycle.step.t_s == 400.0:
                os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(tune_run, "Trial", Interrupting)
    handler = signal.getsignal(signal.SIGINT)
    assert code_of("--sim", "--out", "o", "--json") == 130
    assert signal.getsignal(signal.SIGINT) is handler
    told = json.loads(Path("o/report.json").read_text())
    assert (told["ending"], told["off_confirmed"]) == ("interrupted", True)
    assert 399 <= told["samples"] <= 403
    assert told["model"] is not None


def test_a_run_that_ended_early_says_so_in_plain_words(monkeypatch):
    from thermoctl.app.tuning import run as tune_run

    class Interrupting(tune_run.Trial):
        def _follow(self, cycle):
            super()._follow(cycle)
            if cycle.step.t_s == 40.0:
                os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(tune_run, "Trial", Interrupting)
    _, printed, _ = run("--sim", "--out", "o")
    words = "the run ended after 41 good readings; these orders need at least 149 without a gap"
    assert f"Nothing was learnt: {words}" in printed


def test_a_fault_is_told_and_ends_with_1():
    Path("null.toml").write_text(BOARD)
    assert code_of("-c", "null.toml", "--yes", "--out", "o") == 1
    told = json.loads(Path("o/report.json").read_text())
    assert told["ending"] == "fault"
    assert told["why"]
    assert told["off_confirmed"] is True
    assert told["chosen"] is None
    assert told["undecided"].startswith("the run ended without a good reading")


def test_a_board_that_a_daemon_holds_is_left_alone(tmp_path):
    Path("null.toml").write_text(BOARD)
    (tmp_path / "s").mkdir(mode=0o700)
    with DaemonLock(tmp_path / "s" / "daemon.lock"):
        code, _, said = run("-c", "null.toml", "--yes", "--state", tmp_path / "s")
    assert code == 69
    assert "a daemon is running" in said


def test_a_latched_loop_is_left_alone(tmp_path):
    Path("null.toml").write_text(BOARD)
    state = tmp_path / "s"
    state.mkdir(mode=0o700)
    LatchStore(state).save("tank", Latch("trip.over_temperature", "too hot", 9, 0.0))
    code, _, said = run("-c", "null.toml", "--yes", "--state", state)
    assert code == 1
    assert "latched by trip.over_temperature: too hot" in said


def test_without_a_terminal_and_without_yes_nothing_is_touched(tmp_path):
    Path("null.toml").write_text(BOARD)
    code, _, said = run("-c", "null.toml")
    assert code == 2
    assert "expected --yes" in said
    assert not (tmp_path / "tune").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--power", "0.6,0.2"), "two powers LO,HI from 0 to 1"),
        (("--power", "0,150%"), "got '0,150%'"),
        (("--power", "0"), "got '0'"),
        (("--band", "0"), "greater than zero, got '0'"),
        (("--band", "40"), "a band within the set points of loop 'tank'"),
        (("--duration", "1m"), "at least 240 s"),
        (("--duration", "3d"), "at most 2 d"),
        (("--order", "1"), "expected auto or n,m,d"),
        (("--order", "1,1,1", "--candidates", "1,1,1"), "only with --order auto"),
        (("--candidates", "1,1"), "n,m,d or ranges of them"),
        (("--order", "2,1,300"), "at least 1519 s for orders that look back so far, got 1200 s"),
        (("--candidates", "250,1,1"), "expected orders that reach back 200 samples"),
        (("--candidates", "1-3,1,200", "--duration", "5m"), "at least 1019 s for orders"),
    ],
)
def test_what_cannot_be_done_is_refused_before_anything_is_made(tmp_path, words, message):
    code, printed, said = run("--sim", *words)
    assert (code, printed) == (2, "")
    assert message in " ".join(said.split())
    assert not (tmp_path / "tune").exists()


def test_the_report_proposes_limits_with_reasons(report):
    told, folder = report
    limits = {each["key"]: each for each in told["limits"]}
    assert set(limits) >= {"trip_above_c", "jump_k", "period_s", "power_max", "dead_man_s"}
    assert limits["trip_above_c"]["now"] == 60.0
    assert all(each["why"] for each in limits.values())
    assert limits["trip_above_c"]["why"].split(";")[0] in (folder / "report.txt").read_text()


def test_limits_that_do_not_fit_are_suggested_as_a_table_that_can_be_loaded():
    text = BOARD.replace("trip_above_c = 60.0", "trip_above_c = 90.0\njump_k = 0.05")
    Path("far.toml").write_text(text)
    code, printed, said = run("--sim", "-c", "far.toml", "--duration", "9m", "--json")
    assert code == 0, said
    keys = tomllib.loads(json.loads(printed)["suggestion_toml"])["loops"]["tank"]
    assert 38.5 < keys["trip_above_c"] < 45.0
    assert keys["jump_k"] >= 0.1
    load({"loops": {"tank": {"setpoint_c": 37.5, **keys}}})


def test_a_trip_that_the_sensor_could_not_show_is_not_suggested():
    loop = load(tomllib.loads(BOARD)).loops["tank"]
    beyond = Proposal("trip_above_c", 500.0, 60.0, True, "made")
    fine = Proposal("power_max", 0.5, 1.0, True, "made")
    board = Proposal("dead_man_s", 2.5, 60.0, True, "made")
    assert limit_keys(loop, [beyond, fine, board]) == {"power_max": 0.5}


@pytest.mark.parametrize(
    ("profile", "told"),
    [
        ("cool", "expected a loop that heats, got 'tank', which only cools"),
        (
            "cascade",
            "expected a loop with a heater of its own, got 'bath', which leads 'block'",
        ),
    ],
)
def test_a_loop_that_cannot_be_heated_to_a_band_is_refused(profile, told):
    config = Path(__file__).parents[4] / "config" / f"{profile}.toml"
    code, out, said = run("--sim", "-c", config)
    assert (code, out) == (2, "")
    assert told in said
    assert not Path("tune").exists()


def test_the_question_names_the_heat_that_may_pass_the_limit(capsys, monkeypatch):
    monkeypatch.setattr("thermoctl.app.commands.tune.click.confirm", lambda *_, **__: True)
    settings = load(tomllib.loads(BOARD))
    asked = SimpleNamespace(yes=False)
    tune_module._consent(settings, "tank", plan(settings, "tank", None, 2.0, 1200.0), asked)
    said = capsys.readouterr().err
    assert "up to 37.5 degC, and past it only by heat that is under way by then, for at" in said
