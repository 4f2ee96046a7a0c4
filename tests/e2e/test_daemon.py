"""The installed command as a process of its own: started, signalled, killed, misconfigured."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.e2e

ROOT = Path(__file__).parents[2]
AQUARIUM = ROOT / "config" / "aquarium.toml"
PATIENCE_S = 15.0


class Daemon:
    """A running ``thermoctl run`` with folders of its own."""

    def __init__(self, folder, config=AQUARIUM):
        self.folder, self.config = folder, config
        self.environ = {
            **os.environ,
            "XDG_RUNTIME_DIR": str(folder / "run"),
            "PYTHONUNBUFFERED": "1",
        }
        self.environ.pop("NOTIFY_SOCKET", None)
        (folder / "run").mkdir(mode=0o700, exist_ok=True)
        self.log = folder / "log"
        self.process = self.start()

    def command(self, *arguments):
        return [
            sys.executable,
            "-m",
            "thermoctl",
            *arguments,
            "-c",
            str(self.config),
            "--state",
            str(self.folder / "state"),
        ]

    def start(self):
        with self.log.open("a") as log:
            return subprocess.Popen(
                self.command("run"), env=self.environ, stderr=log, stdout=log, cwd=self.folder
            )

    def call(self, *arguments):
        return subprocess.run(
            self.command(*arguments),
            env=self.environ,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )

    def events(self):
        lines = self.log.read_text().splitlines()
        return [json.loads(line) for line in lines if line.startswith("{")]

    def wait_for(self, name, count=1):
        until_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < until_s:
            if [event["event"] for event in self.events()].count(name) >= count:
                return
            time.sleep(0.05)
        pytest.fail(f"no {name} within {PATIENCE_S} s:\n{self.log.read_text()}")

    def end(self, *signals):
        """Send `signals`; return the exit code and how long the end took."""
        began_s = time.monotonic()
        for number in signals:
            self.process.send_signal(number)
        code = self.process.wait(PATIENCE_S)
        return code, time.monotonic() - began_s


@pytest.fixture
def daemon(tmp_path):
    running = Daemon(tmp_path)
    try:
        running.wait_for("board.opened")
        yield running
    finally:
        if running.process.poll() is None:
            running.process.kill()
        running.process.wait(PATIENCE_S)


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
    stopped = next(event for event in daemon.events() if event["event"] == "loop.stopped")
    assert stopped["power_0_confirmed"] is True


def test_a_hangup_reads_the_configuration_again_and_takes_a_new_set_point(tmp_path):
    config = tmp_path / "own.toml"
    config.write_text(AQUARIUM.read_text())
    daemon = Daemon(tmp_path, config)
    try:
        daemon.wait_for("board.opened")
        config.write_text(AQUARIUM.read_text().replace("setpoint_c = 37.5", "setpoint_c = 40.0"))
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for("setpoint.changed")
        config.write_text(AQUARIUM.read_text().replace("trip_above_c = 60.0", "trip_above_c = 90"))
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for("config.refused")
        config.write_text("this is no TOML")
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for("config.refused", 2)
    finally:
        code, _ = daemon.end(signal.SIGTERM)
    assert code == 0
    refused = [event["why"] for event in daemon.events() if event["event"] == "config.refused"]
    assert "trip_above_c" in refused[0]


def test_a_second_daemon_is_refused_naming_the_first_which_goes_on(daemon):
    second = daemon.call("run")
    assert second.returncode == 69
    assert str(daemon.process.pid) in second.stderr
    assert daemon.process.poll() is None


def test_after_a_kill_the_next_start_knows_that_it_is_a_restart(tmp_path):
    config = tmp_path / "own.toml"
    config.write_text(AQUARIUM.read_text().replace("resume = true", "resume = false"))
    daemon = Daemon(tmp_path, config)
    try:
        daemon.wait_for("board.opened")
        until_s = time.monotonic() + PATIENCE_S
        while not (tmp_path / "state" / "run-tank.json").exists() and time.monotonic() < until_s:
            time.sleep(0.05)
        daemon.end(signal.SIGKILL)
        daemon.process = daemon.start()
        daemon.wait_for("loop.not_resumed")
    finally:
        code, _ = daemon.end(signal.SIGTERM)
    assert code == 0


def test_a_latch_survives_kill_and_restart_and_only_ack_clears_it(tmp_path):
    config = tmp_path / "hot.toml"  # water above its limit latches in the second cycle
    hot = AQUARIUM.read_text().replace("initial_c = 25.0", "initial_c = 70.0")
    config.write_text(hot)
    daemon = Daemon(tmp_path, config)
    latch = tmp_path / "state" / "latch-tank.json"
    try:
        daemon.wait_for("trip.over_temperature")
        until_s = time.monotonic() + PATIENCE_S
        while not latch.exists() and time.monotonic() < until_s:
            time.sleep(0.05)
        refused = daemon.call("alarms", "ack")
        assert refused.returncode == 1
        assert "still stands" in refused.stderr
        daemon.end(signal.SIGKILL)
        assert latch.exists()
        config.write_text(AQUARIUM.read_text())
        daemon.process = daemon.start()
        daemon.wait_for("latch.kept")
        listed = json.loads(daemon.call("alarms", "--json").stdout)
        assert [row["code"] for row in listed] == ["trip.over_temperature"]
        done = daemon.call("alarms", "ack")
        assert (done.returncode, latch.exists()) == (0, False)
        daemon.wait_for("alarm.acknowledged")
    finally:
        daemon.end(signal.SIGTERM)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[loops.tank\n", r"bad\.toml:1"),
        ("[loops.tank]\nsetpont_c = 3.0\ntrip_above_c = 60\n", r"bad\.toml:2.*setpoint_c"),
        ("[loops.tank]\nsetpoint_c = 70.0\ntrip_above_c = 60.0\n", r"bad\.toml:1.*70.*60"),
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
    config.write_text(AQUARIUM.read_text().replace("period_s = 1.0", "period_s = 2.0"))
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
