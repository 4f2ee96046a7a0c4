"""A daemon as a process of its own, with folders of its own, for every test that starts one."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

AQUARIUM = (Path(__file__).parents[2] / "config" / "aquarium.toml").read_text()
PATIENCE_S = 15.0

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # Whoever runs the tests in the background ignores Ctrl-C, and a program that they start would
    # inherit that and never be interrupted.
    signal.signal(signal.SIGINT, signal.default_int_handler)


class DaemonProcess:
    """``thermoctl run``; with `program`, that Python is run on configuration and state instead."""

    def __init__(self, folder, program=None, config=AQUARIUM):
        self.folder, self.program = folder, program
        self.config, self.log = folder / "own.toml", folder / "log"
        self.config.write_text(config)
        run = folder / "run"
        run.mkdir(mode=0o700)
        self.environ = {**os.environ, "XDG_RUNTIME_DIR": str(run), "PYTHONUNBUFFERED": "1"}
        self.environ.pop("NOTIFY_SOCKET", None)
        self.start()

    def command(self, *arguments):
        state = str(self.folder / "state")
        if self.program is not None:
            return [sys.executable, "-c", self.program, str(self.config), state]
        words = [*arguments, "-c", str(self.config), "--state", state]
        return [sys.executable, "-m", "thermoctl", *words]

    def start(self):
        """Start it, or start it again on the same folders."""
        with self.log.open("a") as log:
            self.process = subprocess.Popen(
                self.command("run"), env=self.environ, stderr=log, stdout=log, cwd=self.folder
            )

    def call(self, *arguments):
        """Run another command on the same folders, and return what came of it."""
        return self._run(self.command(*arguments))

    def ask(self, *words):
        """Run a command as its user would, without a configuration, and return what came of it."""
        return self._run([sys.executable, "-m", "thermoctl", *words])

    def _run(self, command):
        return subprocess.run(
            command,
            env=self.environ,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )

    def events(self):
        lines = self.log.read_text().splitlines()
        return [json.loads(line) for line in lines if line.startswith("{")]

    def named(self, name):
        return [event for event in self.events() if event["event"] == name]

    def wait_for(self, name, count=1):
        self.wait_until(lambda: len(self.named(name)) >= count, f"{count} {name}")

    def wait_until(self, come, what):
        until_s = time.monotonic() + PATIENCE_S
        while not come():
            if time.monotonic() > until_s:
                pytest.fail(f"no {what} within {PATIENCE_S} s:\n{self.log.read_text()}")
            time.sleep(0.02)

    def end(self, *signals):
        """Send `signals`; return the exit code and how long the end took."""
        began_s = time.monotonic()
        for number in signals:
            self.process.send_signal(number)
        code = self.process.wait(PATIENCE_S)
        return code, time.monotonic() - began_s


@pytest.fixture
def start(tmp_path):
    """Return a function that starts a daemon; whatever is left of it is killed in the end."""
    started = []

    def begin(program=None, config=AQUARIUM):
        started.append(DaemonProcess(tmp_path, program, config))
        return started[-1]

    yield begin
    for each in started:
        if each.process.poll() is None:
            each.process.kill()
        each.process.wait(PATIENCE_S)


@pytest.fixture
def daemon(start):
    """Return a daemon that runs and can be asked."""
    running = start()
    running.wait_for("board.opened")
    running.wait_for("socket.opened")
    return running
