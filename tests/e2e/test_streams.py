"""Commands whose standard streams are closed, full or of a narrow encoding."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.e2e

PROFILE = Path(__file__).parents[2] / "config" / "aquarium.toml"
COMMANDS = [
    f"config check -c {shlex.quote(str(PROFILE))}",
    "drivers --json",
    "--sim --no-history --speed max --duration 5s",
]
by_command = pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.split()[0])


def shell(command: str, redirected: str, **environment: str) -> tuple[int, str, str]:
    """Return exit code, stdout and stderr of a command whose streams the shell has redirected."""
    done = subprocess.run(
        ["/bin/sh", "-c", f"{shlex.quote(sys.executable)} -m thermoctl {command} {redirected}"],
        env=dict(os.environ) | environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


@by_command
def test_a_closed_stdout_is_a_stdout_to_nowhere(command):
    code, _, err = shell(command, ">&-")
    assert code == 0
    assert "Traceback" not in err


def test_with_every_stream_closed_the_exit_code_is_the_same():
    assert shell("drivers", "<&- >&- 2>&-") == (0, "", "")
    assert shell("config check -c not-there.toml", "<&- >&- 2>&-") == (78, "", "")


@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="needs a device that is full")
@by_command
def test_a_full_stdout_is_one_line_and_exit_1(command):
    code, _, err = shell(command, ">/dev/full")
    assert code == 1
    assert err.splitlines()[-1] == "thermoctl: No space left on device"
    assert "Exception ignored" not in err


def test_a_reader_that_goes_away_ends_a_command_without_a_word():
    ours, theirs = os.pipe()
    os.close(ours)
    done = subprocess.run(
        [sys.executable, "-m", "thermoctl", "config", "schema"],
        stdout=theirs,
        stderr=subprocess.PIPE,
        timeout=60.0,
        check=False,
    )
    os.close(theirs)
    assert (done.returncode, done.stderr) == (1, b"")


@pytest.mark.parametrize("command", [COMMANDS[0], "replay --help", "reproduce --help"])
def test_an_encoding_without_the_degree_sign_ends_no_command(command):
    code, out, err = shell(command, "", PYTHONIOENCODING="ascii")
    assert code == 0, err
    assert out
