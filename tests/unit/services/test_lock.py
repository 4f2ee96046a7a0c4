"""One daemon per state folder and per device."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from thermoctl.errors import Unavailable
from thermoctl.services.lock import DaemonLock, device_lock_path

HOLD = """
import sys
from pathlib import Path
from thermoctl.services.lock import DaemonLock
DaemonLock.acquire(lock := DaemonLock(Path(sys.argv[1])))
print("held", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """Return another process that holds ``daemon.lock``."""
    command = [sys.executable, "-c", HOLD, str(tmp_path / "daemon.lock")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"held\n"
        yield process
        process.kill()


def test_the_second_daemon_is_refused_and_told_who_holds_it(tmp_path, holder):
    with pytest.raises(Unavailable, match=f"process {holder.pid} holds .*daemon.lock") as refused:
        DaemonLock(tmp_path / "daemon.lock").acquire()
    assert "a daemon is running" in str(refused.value)
    assert "stop it first" in str(refused.value)


def test_who_finds_a_lock_held_is_told_what_to_do(tmp_path, holder):
    with pytest.raises(Unavailable, match=r"; ask it$"):
        DaemonLock(tmp_path / "daemon.lock", "ask it").acquire()


def test_a_killed_holder_keeps_nobody_out(tmp_path, holder):
    holder.kill()
    holder.wait()
    with DaemonLock(tmp_path / "daemon.lock"):
        assert (tmp_path / "daemon.lock").read_text() == f"{os.getpid()}\n"


def test_a_lock_is_let_go_at_the_end_of_its_block_whatever_ends_it(tmp_path):
    lock = DaemonLock(tmp_path / "x.lock")
    with pytest.raises(ZeroDivisionError), lock:
        1 / 0
    with DaemonLock(tmp_path / "x.lock"):
        pass


def test_a_released_lock_is_free(tmp_path):
    first, second = DaemonLock(tmp_path / "x.lock"), DaemonLock(tmp_path / "x.lock")
    first.acquire()
    first.acquire()
    with pytest.raises(Unavailable, match=f"process {os.getpid()}"):
        second.acquire()
    first.release()
    first.release()
    second.acquire()
    second.release()


def test_a_place_that_takes_no_lock_file_is_said(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(Unavailable, match="should be a lock file"):
        DaemonLock(tmp_path / "file" / "x.lock").acquire()


def test_two_names_of_one_device_share_a_lock(tmp_path):
    (tmp_path / "ttyUSB0").write_text("")
    (tmp_path / "heater").symlink_to(tmp_path / "ttyUSB0")
    locks = {device_lock_path(tmp_path, str(tmp_path / name)) for name in ("ttyUSB0", "heater")}
    assert len(locks) == 1
