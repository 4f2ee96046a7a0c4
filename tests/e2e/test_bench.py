"""``thermoctl --sim`` as a user runs it."""

import json
import signal
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.e2e

SIM = [sys.executable, "-m", "thermoctl", "--sim", "--no-history"]
KEYS = {
    "t_s", "loop", "mode", "state", "temperature_c", "quality", "setpoint_c", "power",
    "reference_c", "load", "accepted_power", "controller", "innovation_k", "inflation", "gain",
    "gain_sd", "a", "a_sd", "holding_power", "lag_s", "shadow", "shadow_power", "shadow_score",
    "feasible", "tick_us", "late_s", "alarms", "model_origin", "true_temperature_c",
}  # fmt: skip
SUMMARY = {
    "duration_s", "steps", "missed", "overshoot_k", "settled_s", "settled_for_good_s",
    "deviation_mk", "max_deviation_mk", "travel_per_min", "final_temperature_c", "latched",
    "ended", "wall_s",
}  # fmt: skip


def sim(*arguments):
    return subprocess.run(
        [*SIM, *arguments], capture_output=True, text=True, timeout=60, check=False
    )


def test_an_hour_of_json_lines_ends_with_a_summary_of_a_held_tank():
    ended = sim("--speed", "max", "--duration", "1h")
    lines = [json.loads(line) for line in ended.stdout.splitlines()]
    assert ended.returncode == 0
    assert ended.stderr == ""
    assert set(lines[0]) == KEYS
    assert lines[-1].keys() == {"summary"}
    summary = lines[-1]["summary"]
    assert summary.keys() == SUMMARY
    assert summary["steps"] == len(lines) - 1 == 3601
    assert summary["settled_s"] <= summary["settled_for_good_s"] < 3540.0
    assert summary["ended"] == {"tank": {"mode": "auto", "state": "run", "alarms": []}}
    assert summary["overshoot_k"] <= 0.3
    assert summary["deviation_mk"] <= 50.0
    assert summary["final_temperature_c"] == pytest.approx(37.5, abs=0.2)


def test_equal_seeds_give_equal_runs_and_others_do_not():
    def temperatures(seed):
        ended = sim("--speed", "max", "--duration", "60s", "--seed", seed)
        return [json.loads(line).get("temperature_c") for line in ended.stdout.splitlines()]

    assert temperatures("7") == temperatures("7") != temperatures("8")


def test_a_reader_that_goes_away_ends_it_in_silence():
    with subprocess.Popen(
        [*SIM, "--speed", "max"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        process.stdout.readline()
        process.stdout.close()
        assert process.wait(20) == 0
        assert process.stderr.read() == b""


def test_ctrl_c_ends_it_with_the_summary():
    with subprocess.Popen(
        [*SIM, "--speed", "1"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        process.stdout.readline()
        time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=20)
    assert process.returncode == 0
    assert "summary" in rest.splitlines()[-1]
    assert errors == ""


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("--speed", "fast"), 2),
        (("--speed", "-1"), 2),
        (("--duration", "soon"), 2),
        (("--seed", "-5"), 2),
        (("-c", "/nowhere.toml"), 78),
        (("--nonsense",), 2),
    ],
)
def test_nonsense_is_refused_in_one_line_without_a_trace(arguments, code):
    ended = sim(*arguments)
    assert ended.returncode == code
    assert ended.stdout == ""
    assert "Traceback" not in ended.stderr
    assert ended.stderr
