"""The installed command as a process of its own: started, signalled, killed, misconfigured."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.e2e

ROOT = Path(__file__).parents[2]
AQUARIUM = (ROOT / "config" / "aquarium.toml").read_text()
PATIENCE_S = 15.0


@pytest.fixture
def daemon(start):
    running = start()
    running.wait_for("board.opened")
    return running


@pytest.mark.parametrize(
    "signals",
    [(signal.SIGTERM,), (signal.SIGINT,), (signal.SIGTERM, signal.SIGTERM)],
    ids=["TERM", "INT", "TERM twice"],
)
def test_a_signal_ends_it_with_power_0_confirmed_and_exit_0_within_two_seconds(daemon, signals):
    code, took_s = daemon.end(*signals)
    print(f"{signals}: ended after {took_s:.2f} s")
    assert code == 0
    assert took_s < 2.0
    assert daemon.named("loop.stopped")[0]["power_0_confirmed"] is True


def test_a_hangup_reads_the_configuration_again_and_takes_a_new_set_point(daemon):
    daemon.config.write_text(AQUARIUM.replace("setpoint_c = 37.5", "setpoint_c = 40.0"))
    daemon.process.send_signal(signal.SIGHUP)
    daemon.wait_for("setpoint.changed")
    daemon.config.write_text(AQUARIUM.replace("trip_above_c = 60.0", "trip_above_c = 90"))
    daemon.process.send_signal(signal.SIGHUP)
    daemon.wait_for("config.refused")
    daemon.config.write_text("this is no TOML")
    daemon.process.send_signal(signal.SIGHUP)
    daemon.wait_for("config.refused", 2)
    code, _ = daemon.end(signal.SIGTERM)
    assert code == 0
    assert "trip_above_c" in daemon.named("config.refused")[0]["why"]


def test_a_second_daemon_is_refused_naming_the_first_which_goes_on(daemon):
    second = daemon.call("run")
    assert second.returncode == 69
    assert str(daemon.process.pid) in second.stderr
    assert daemon.process.poll() is None


def test_after_a_kill_the_next_start_knows_that_it_is_a_restart(start):
    daemon = start(config=AQUARIUM.replace("resume = true", "resume = false"))
    record = daemon.folder / "state" / "run-tank.json"
    daemon.wait_until(record.exists, "record of the run")
    daemon.end(signal.SIGKILL)
    daemon.start()
    daemon.wait_for("loop.not_resumed")
    code, _ = daemon.end(signal.SIGTERM)
    assert code == 0


def test_a_latch_survives_kill_and_restart_and_only_ack_clears_it(start):
    # water above its limit latches in the second cycle
    daemon = start(config=AQUARIUM.replace("initial_c = 25.0", "initial_c = 70.0"))
    latch = daemon.folder / "state" / "latch-tank.json"
    daemon.wait_until(latch.exists, "latch on the disk")
    refused = daemon.call("alarms", "ack")
    assert refused.returncode == 1
    assert "still stands" in refused.stderr
    daemon.end(signal.SIGKILL)
    assert latch.exists()
    daemon.config.write_text(AQUARIUM)
    daemon.start()
    daemon.wait_for("latch.kept")
    listed = json.loads(daemon.call("alarms", "--json").stdout)
    assert [row["code"] for row in listed] == ["trip.over_temperature"]
    # before its first reading a loop cannot know that the cause is gone, and says so
    daemon.wait_until(lambda: daemon.ask("get", "state").returncode == 0, "first cycle")
    done = daemon.call("alarms", "ack")
    assert (done.returncode, latch.exists()) == (0, False)
    daemon.wait_for("alarm.acknowledged")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[loops.tank\n", r"bad\.toml:1"),
        ("[loops.tank]\nsetpont_c = 3.0\ntrip_above_c = 60\n", r"bad\.toml:2.*setpoint_c"),
        ("[loops.tank]\nsetpoint_c = 70.0\ntrip_above_c = 60.0\n", r"bad\.toml:2.*60.*got 70"),
        ("", "loops"),
    ],
)
def test_a_bad_configuration_is_exit_78_with_file_line_and_key(tmp_path, text, told):
    bad = tmp_path / "bad.toml"
    bad.write_text(text)
    ended = subprocess.run(
        [sys.executable, "-m", "thermoctl", "run", "-c", str(bad), "--state", str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert ended.returncode == 78
    assert re.search(told, ended.stderr), ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_watchdog_shorter_than_two_periods_is_refused_before_anything_is_on(tmp_path):
    config = tmp_path / "slow.toml"
    config.write_text(AQUARIUM.replace("period_s = 1.0", "period_s = 2.0"))
    ended = subprocess.run(
        [sys.executable, "-m", "thermoctl", "run", "-c", str(config), "--state", str(tmp_path)],
        env={**os.environ, "WATCHDOG_USEC": "3000000"},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert ended.returncode == 78
    assert "at least 4 s" in ended.stderr
