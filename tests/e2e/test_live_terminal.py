"""The live view on a real terminal: keys that are pressed, rows that are read."""

import contextlib
import fcntl
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.e2e

AQUARIUM = (Path(__file__).parents[2] / "config" / "aquarium.toml").read_text()
PATIENCE_S = 20.0
CODES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
ROW = re.compile(r"\x1b\[(\d+);1H")


class Terminal:
    """A command on a terminal of 100 by 30, and the rows that stand on it."""

    def __init__(self, words, environ):
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
        self.process = subprocess.Popen(
            [sys.executable, "-m", "thermoctl", *words],
            stdin=theirs,
            stdout=theirs,
            stderr=subprocess.PIPE,
            env={**environ, "NO_COLOR": "1", "TERM": "xterm", "PYTHONUTF8": "1"},
            start_new_session=True,
        )
        os.close(theirs)
        os.set_blocking(self._ours, False)
        self.received, self.rows = "", {}

    def press(self, keys):
        os.write(self._ours, keys)

    def read(self):
        with contextlib.suppress(BlockingIOError, OSError):
            while content := os.read(self._ours, 1 << 16):
                self.received += content.decode("utf-8", "replace")
        _, *pieces = ROW.split(self.received)
        for number, text in zip(pieces[::2], pieces[1::2], strict=True):
            self.rows[int(number)] = CODES.sub("", text).replace("\u00a0", " ")
        return "\n".join(self.rows[number] for number in sorted(self.rows))

    def wait_for(self, words):
        until_s = time.monotonic() + PATIENCE_S
        while words not in (picture := self.read()):
            if time.monotonic() > until_s or self.process.poll() is not None:
                pytest.fail(f"no {words!r} within {PATIENCE_S} s on:\n{picture}")
            time.sleep(0.02)

    def wait_in_lines(self, words):
        """Wait for `words` where nothing is drawn."""
        until_s = time.monotonic() + PATIENCE_S
        while words not in self.received and time.monotonic() < until_s:
            self.read()
            time.sleep(0.02)
        assert words in self.received

    def end(self, keys=b"q"):
        """Leave, and return the exit code and what was said on stderr."""
        with contextlib.suppress(OSError):
            self.press(keys)
        until_s = time.monotonic() + PATIENCE_S
        while self.process.poll() is None and time.monotonic() < until_s:
            self.read()
            time.sleep(0.02)
        self.read()
        return self.process.wait(1.0), self.process.stderr.read().decode()

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(PATIENCE_S)
        self.process.stderr.close()
        os.close(self._ours)


@pytest.fixture
def terminal():
    """Return a function that starts a command on a terminal of its own."""
    opened = []

    def begin(*words, environ=os.environ):
        opened.append(Terminal(words, environ))
        return opened[-1]

    yield begin
    for each in opened:
        each.close()


def test_the_shadow_of_a_bench_test_takes_over_when_it_is_confirmed(terminal):
    bench = terminal("--sim", "--no-history")
    bench.wait_for("RUN auto · adaptive")
    bench.press(b"c")
    bench.wait_for("Enter: self-tuning-mv takes over   Esc: leave it")
    bench.press(b"\x1b")
    bench.wait_for("controller")
    bench.press(b"c\r")
    bench.wait_for("RUN auto · self-tuning-mv")
    bench.wait_for("controller.changed")
    code, errors = bench.end()
    assert code == 0
    assert "ran" in errors
    assert bench.received.endswith("\x1b[?1049l")


def test_a_watch_on_a_terminal_is_the_live_view_and_its_keys_ask_the_daemon(daemon, terminal):
    view = terminal("watch", environ=daemon.environ)
    view.wait_for("set 37.50 °C")
    view.wait_for("RUN auto · adaptive")
    picture = view.read()
    assert "What it believes" in picture
    assert "cold" not in picture.splitlines()[-1]
    view.press(b"\x1b[A\x1b[A\x1b[A")
    view.wait_for("set 37.80 °C")
    view.wait_for("setpoint.changed")
    view.press(b"c\r")
    view.wait_for("RUN auto · self-tuning-mv")
    view.press(b"m")
    view.wait_for("Enter: mode manual")
    view.press(b"m")
    view.wait_for("RUN off")
    assert view.end() == (0, "")
    assert view.received.endswith("\x1b[?1049l")
    assert daemon.process.poll() is None


def test_a_refusal_of_the_daemon_is_shown_in_its_own_words(daemon, terminal):
    view = terminal("watch", environ=daemon.environ)
    view.wait_for("set 37.50 °C")
    view.press(b"\x1b[5~" * 20)
    view.wait_for("Refused: expected a set point from 5 to 55 degC, got 57.5")
    view.press(b"\x1b[B")
    view.wait_for("set 37.40 °C")
    assert view.end()[0] == 0


def test_a_daemon_that_goes_is_told_of_and_found_again(daemon, terminal):
    view = terminal("watch", environ=daemon.environ)
    view.wait_for("RUN auto")
    daemon.end(signal.SIGKILL)
    view.wait_for("daemon gone · heater not known")
    view.wait_for("asked again and again")
    daemon.start()
    view.wait_for("RUN auto")
    view.process.send_signal(signal.SIGINT)
    assert view.end(b"")[0] == 0
    assert view.received.endswith("\x1b[?1049l")


def test_lines_are_to_be_had_on_a_terminal_too(daemon, terminal):
    lines = terminal("watch", "--lines", environ=daemon.environ)
    lines.wait_in_lines("auto run")
    assert re.search(r"tank +\d\d\.\d\d °C +set +37\.50 °C .* auto run", lines.received)
    assert "\x1b" not in lines.received
    lines.process.send_signal(signal.SIGINT)
    assert lines.end(b"")[0] == 0


def test_a_view_of_a_daemon_that_is_not_there_ends_as_any_other_call_does(terminal, tmp_path):
    view = terminal("watch", "--socket", str(tmp_path / "none"))
    code, errors = view.end(b"")
    assert code == 3
    assert "running daemon" in errors
    assert "\x1b" not in view.received


def test_several_loops_are_lines_until_one_of_them_is_named(start, terminal):
    renamed = {"loops.tank": "loops.mash", "boards.daq": "boards.other", '= "daq"': '= "other"'}
    second = AQUARIUM
    for old, new in renamed.items():
        second = second.replace(old, new)
    daemon = start(config=AQUARIUM + second)
    daemon.wait_for("board.opened", 2)
    daemon.wait_for("socket.opened")
    both = terminal("watch", environ=daemon.environ)
    both.wait_in_lines("mash ")
    both.wait_in_lines("tank ")
    both.process.send_signal(signal.SIGINT)
    code, errors = both.end(b"")
    assert (code, "--loop NAME shows one of" in errors) == (0, True)
    one = terminal("watch", "--loop", "mash", environ=daemon.environ)
    one.wait_for("thermoctl mash")
    assert one.end() == (0, "")
