"""The commands that study runs, as a user starts them."""

import json
import math
import subprocess
import sysconfig
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.e2e

COMMAND = Path(sysconfig.get_path("scripts")) / "thermoctl"
COLUMNS = ("--time", "time_s", "--input", "heater", "--output", "water_c")
AUTO = (*COLUMNS, "--order", "auto")


@pytest.fixture
def thermoctl(tmp_path):
    """Run the command in an empty folder and return what came of it."""

    def run(*arguments):
        return subprocess.run(
            [str(COMMAND), *map(str, arguments)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )

    return run


@pytest.fixture
def recording(tmp_path):
    """A first-order plant stepped at random, written as a logger would."""
    rng = np.random.default_rng(6)
    path, water_c, lines = tmp_path / "run.csv", 30.0, ["time_s,heater,water_c"]
    power = np.repeat(rng.choice((0.0, 50.0), 40), 20)
    for t, heater in enumerate(power):
        lines.append(f"{2 * t},{heater:g},{water_c + 0.01 * rng.standard_normal():.4f}")
        water_c += 0.01 * heater - 0.02 * (water_c - 20.0)
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_replay_prints_what_was_done_and_a_row_for_each_estimator(thermoctl, recording):
    names = ("ckf", "nkf:R1=1e-6", "rls:0.98", "vff:50")
    chosen = [word for name in names for word in ("--estimator", name)]
    came = thermoctl("replay", recording, *COLUMNS, "--order", "1,1,1", *chosen)
    assert (came.returncode, came.stderr) == (0, "")
    assert "run.csv: 800 samples, every 2 s, 26 min 38 s; heater → water_c" in came.stdout
    assert "mean removed" in came.stdout
    assert "R2 = " in came.stdout
    assert "estimated" in came.stdout
    rows = [line.split() for line in came.stdout.splitlines()]
    for name in names:
        assert sum(row[:1] == [name] for row in rows) == 2


def test_json_has_one_object_and_errors_beside_it(thermoctl, recording):
    came = thermoctl("replay", recording, *COLUMNS, "--estimator", "ckf", "--json")
    told = json.loads(came.stdout)
    assert told["samples"] == 800
    (score,) = told["estimators"]
    assert list(score) == [
        "name",
        "rms_error",
        "r2",
        "whiteness_p",
        "whiteness_unknown",
        "theta",
        "theta_sd",
        "us_per_sample",
    ]
    assert score["name"] == "ckf"
    assert 0.01 < score["rms_error"] < 0.03
    assert len(score["theta"]) == len(score["theta_sd"]) == 4
    assert told["conditions"]["mean_removed"] is True
    assert told["conditions"]["R2_source"].startswith("estimated")


def test_the_record_may_choose_the_order_itself(thermoctl, recording, tmp_path):
    came = thermoctl("replay", recording, *AUTO, "--json", "--plot", "a.png")
    told = json.loads(came.stdout)
    assert (came.returncode, told["chosen"]["delay"]) == (0, 1)
    assert len(told["orders"]) == 72
    assert (tmp_path / "a.png").stat().st_size > 10_000
    few = thermoctl("replay", recording, *AUTO, "--candidates", "1-2,1,1-3")
    assert "Orders   6 weighed on" in few.stdout


def test_a_given_noise_and_a_kept_mean_are_said(thermoctl, recording):
    came = thermoctl("replay", recording, *COLUMNS, "--R2", "0.04", "--keep-mean")
    assert "R2 = 0.04 (sd 0.2), given" in came.stdout
    assert "mean kept" in came.stdout


def test_rows_that_are_not_sound_are_told_with_the_first_line(thermoctl, recording):
    lines = recording.read_text().splitlines()
    lines[100] = "not,a,row"
    recording.write_text("\n".join(lines))
    came = thermoctl("replay", recording, *COLUMNS)
    assert came.returncode == 0
    assert "1 row left out" in came.stdout
    assert "line 101: time_s is 'not'" in came.stdout
    as_json = thermoctl("replay", recording, *COLUMNS, "--json")
    assert json.loads(as_json.stdout)["conditions"]["skipped_rows"] == 1
    assert "line 101" in as_json.stderr


def test_a_figure_is_written_where_it_was_asked_for(thermoctl, recording, tmp_path):
    came = thermoctl("replay", recording, *COLUMNS, "--plot", "a.png", "--plot", "b/a.svg")
    assert came.returncode == 0
    assert (tmp_path / "a.png").stat().st_size > 10_000
    assert (tmp_path / "b" / "a.svg").stat().st_size > 10_000
    assert came.stderr.splitlines() == [
        "thermoctl: folder b made",
        "thermoctl: figure written to a.png",
        "thermoctl: figure written to b/a.svg",
    ]


def test_a_figure_that_does_not_fit_on_the_disk_is_named(thermoctl, recording, tmp_path):
    (tmp_path / "full.png").symlink_to("/dev/full")
    came = thermoctl("replay", recording, *COLUMNS, "--plot", "full.png")
    assert came.returncode == 1
    assert "full.png: expected a place for a figure, got: No space left on device" in came.stderr


def test_an_ascii_terminal_gets_the_tables_in_ascii(thermoctl, recording, monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    came = thermoctl("replay", recording, *COLUMNS)
    assert (came.returncode, came.stderr) == (0, "")
    assert "heater -> water_c" in came.stdout
    assert "parameters +- 2s" in came.stdout


@pytest.mark.parametrize("wild", ["1e308", "9e49", "-1e200"])
def test_one_wild_value_ends_neither_in_a_traceback_nor_in_a_warning(thermoctl, recording, wild):
    lines = recording.read_text().splitlines()
    lines[100] = f"{lines[100].rpartition(',')[0]},{wild}"
    recording.write_text("\n".join(lines))
    came = thermoctl("replay", recording, *COLUMNS)
    assert (came.returncode, came.stderr) == (0, "")


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("nowhere.csv",), 1, "nowhere.csv: expected a readable file"),
        (("run.csv", "--output", "water"), 2, "run.csv has time_s, heater, water_c"),
        (("run.csv",), 2, "(--output); run.csv has time_s, heater, water_c"),
        (("run.csv", *COLUMNS, "--loop", "tank"), 1, "expected a history"),
        (("run.csv", *COLUMNS, "--order", "2"), 2, "expected auto or n,m,d such as 2,2,1; got '2'"),
        (("run.csv", *COLUMNS, "--candidates", "1,1,1"), 2, "only with --order auto"),
        (("run.csv", *AUTO, "--candidates", "1,1"), 2, "n,m,d or ranges of them"),
        (("run.csv", *AUTO, "--candidates", "1-9,1-9,1-9"), 2, "at most 200 candidates, got 729"),
        (("run.csv", *AUTO, *2 * ("--candidates", "1,1,1")), 2, "repeats another"),
        (("run.csv", *COLUMNS, "--estimator", "x"), 2, "expected an estimator such as ckf"),
        (("run.csv", *COLUMNS, "--R2", "-1"), 2, "greater than zero, got '-1'"),
        (("run.csv", *COLUMNS, "--plot", "x.pdf"), 2, ".png or .svg, got 'x.pdf'"),
    ],
)
def test_a_mistake_is_answered_with_what_was_expected(
    thermoctl, recording, arguments, code, message
):
    came = thermoctl("replay", *arguments)
    assert (came.returncode, came.stdout) == (code, "")
    assert message in " ".join(came.stderr.split())
    assert "Traceback" not in came.stderr


def test_a_bench_test_can_be_replayed_from_its_history(thermoctl, tmp_path):
    state = tmp_path / "state"
    bench = thermoctl("--sim", "--speed", "max", "--duration", "20m", "--json", "--state", state)
    assert bench.returncode == 0
    (history,) = state.glob("*.sqlite")
    came = thermoctl("replay", history, "--json", "--order", "1,1,1", "--estimator", "nkf")
    told = json.loads(came.stdout)
    assert told["samples"] > 1190
    a1, b1 = told["estimators"][0]["theta"]
    assert a1 == pytest.approx(-1.0, abs=0.05)
    assert b1 > 0.0


def experiment(thermoctl, *arguments):
    came = thermoctl("reproduce", "experiment", "--json", *arguments)
    assert came.returncode == 0, came.stderr
    return json.loads(came.stdout)


def test_the_experiment_cycles_as_printed_and_a_time_constant_repairs_it(thermoctl, tmp_path):
    printed = experiment(thermoctl)
    repaired = experiment(thermoctl, "--tc", "60")
    assert printed["measures"]["cycle_k"] > 0.2
    assert 40.0 < printed["measures"]["cycle_period_s"] < 200.0
    assert repaired["measures"]["cycle_k"] is None
    ratio = printed["measures"]["deviation_k"] / repaired["measures"]["deviation_k"]
    assert ratio > 5.0
    assert math.isclose(repaired["conditions"]["tc_s"], 60.0)
    for told in (printed, repaired):
        for figure in told["figures"].values():
            assert (tmp_path / figure).stat().st_size > 10_000


def test_the_same_seed_gives_the_same_experiment(thermoctl):
    first, same, other = (
        experiment(thermoctl, "--duration", "7m", "--seed", seed)["measures"]
        for seed in ("4", "4", "5")
    )
    assert first == same
    assert first != other


def test_a_run_too_short_to_arrive_says_so(thermoctl):
    came = thermoctl("reproduce", "experiment", "--duration", "60s")
    assert came.returncode == 0
    assert "the run was too short" in came.stdout


def test_an_experiment_that_would_take_for_ever_is_refused(thermoctl):
    came = thermoctl("reproduce", "experiment", "--duration", "100000h")
    assert came.returncode == 2
    assert "expected at most 2 d, got '100000h'" in " ".join(came.stderr.split())
