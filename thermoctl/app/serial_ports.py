"""Serial ports of this machine: which there are, who may use one, who does."""

from __future__ import annotations

import fcntl
import grp
import os
import stat
from pathlib import Path
from typing import Final

from serial.tools import list_ports

from thermoctl.services.lock import LONGEST, device_lock_path
from thermoctl.services.places import SERVICE_RUN, SERVICE_STATE, runtime_dir

TERMINAL_DRIVERS: Final = Path("/proc/tty/drivers")
SERIAL_GROUPS: Final = ("dialout", "uucp", "plugdev")
"""Groups that exist to give the right to ports; any other may give much more, root above all."""


def present() -> list[str]:
    """Return the serial ports, each with what is plugged in if that is known."""
    return [
        f"{port.device} ({port.description})" if port.vid is not None else port.device
        for port in sorted(list_ports.comports())
    ]


def obstacle(port: str) -> str | None:
    """Return why `port` cannot be used and what to do, or None; None for a URL."""
    if "://" in port:
        return None
    if not os.path.exists(port):
        return f"{port} is not there; plug the board in, or set port to one of the ports above"
    if not is_terminal(port):
        return f"{port} is no serial port; set port to one of the ports above"
    if not os.access(port, os.R_OK | os.W_OK):
        return f"{port}: no right to read and write; {_remedy(port)}"
    for directory in (runtime_dir(), SERVICE_RUN):
        holder = holder_of(device_lock_path(directory, port))
        if holder is not None:
            return f"{port} is in use by a daemon (process {holder})"
    return None


def daemon_holding(directory: Path) -> str | None:
    """Return the process id of a daemon on this state folder or the service's."""
    for each in (directory, SERVICE_STATE):
        holder = holder_of(each / "daemon.lock")
        if holder is not None:
            return holder
    return None


def holder_of(lock: Path) -> str | None:
    """Return the process id in a lock that is held, or None; takes nothing."""
    try:
        descriptor = os.open(lock, os.O_RDONLY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return os.pread(descriptor, LONGEST, 0).decode(errors="replace").strip() or "unknown"
    finally:
        os.close(descriptor)
    return None


def is_terminal(port: str) -> bool:
    """Return whether `port` is a terminal, as every serial port is; opens nothing.

    Opening one would reset an Arduino. The kernel lists every terminal driver, and so its numbers.
    """
    status = os.stat(port)
    if not stat.S_ISCHR(status.st_mode):
        return False
    major, minor = os.major(status.st_rdev), os.minor(status.st_rdev)
    try:
        rows = TERMINAL_DRIVERS.read_text().splitlines()
    except OSError:
        return True  # nobody can tell; who opens it will
    return not rows or any(_drives(row.split(), major, minor) for row in rows)


def _drives(row: list[str], major: int, minor: int) -> bool:
    """Return whether a row of the kernel's list of terminal drivers has these numbers."""
    first, _, last = row[-2].partition("-")
    return int(row[-3]) == major and int(first) <= minor <= int(last or first)


def _remedy(port: str) -> str:
    """Return what gives the right to use a port; never to join a group with more rights."""
    status = os.stat(port)
    try:
        name = grp.getgrgid(status.st_gid).gr_name
    except KeyError:
        name = str(status.st_gid)
    if name in SERIAL_GROUPS and status.st_gid not in os.getgroups():
        return f"join its group and log in again: sudo usermod -aG {name} $USER"
    mode = stat.S_IMODE(status.st_mode)
    return f"it is of user {status.st_uid} and group {name}, mode {mode:04o}; install the udev rule"


def used_by(port: str) -> str | None:
    """Return which other process has `port` open, as far as this user may see.

    That alone is no obstacle: whoever keeps a pseudo terminal alive holds it open as well.
    """
    device = os.path.realpath(port)
    for folder in Path("/proc").glob("[0-9]*"):
        if folder.name == str(os.getpid()):
            continue
        try:
            opened = {os.readlink(each) for each in (folder / "fd").iterdir()}
            name = (folder / "comm").read_text(errors="replace").strip()
        except OSError:
            continue  # gone, or somebody else's
        if device in opened:
            return f"{device} is open in process {folder.name} ({name})"
    return None
