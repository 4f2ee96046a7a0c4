"""Talk to the service manager: sd_notify(3), never raising or blocking."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Mapping


class Notifier:
    """Sends state to ``$NOTIFY_SOCKET``; without one, does nothing.

    Every method returns whether the message left. A service manager that is gone or does not
    read must not cost the loop a cycle, so nobody needs to look at it.
    """

    def __init__(self, environ: Mapping[str, str] = os.environ) -> None:
        self._address = _address(environ.get("NOTIFY_SOCKET", ""))
        self._socket: socket.socket | None = None

    def ready(self, status: str = "") -> bool:
        """Say that the start, or a reload, has been completed."""
        return self._send("READY=1", *_status(status))

    def status(self, text: str) -> bool:
        """Show `text`, one line, in ``systemctl status``."""
        return self._send(*_status(text))

    def watchdog(self) -> bool:
        """Say that a cycle has completed."""
        return self._send("WATCHDOG=1")

    def reloading(self) -> bool:
        """Say that the configuration is being read again; `ready` ends it."""
        now_us = time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000
        return self._send("RELOADING=1", f"MONOTONIC_USEC={now_us}")

    def stopping(self, status: str = "") -> bool:
        """Say that the end has begun."""
        return self._send("STOPPING=1", *_status(status))

    def close(self) -> None:
        """Let the socket go; idempotent."""
        held, self._socket = self._socket, None
        if held is not None:
            held.close()

    def _send(self, *lines: str) -> bool:
        if self._address is None:
            return False
        try:
            if self._socket is None:
                self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
                self._socket.setblocking(False)
            self._socket.sendto("\n".join(lines).encode(errors="replace"), self._address)
        except OSError:
            return False
        return True


def watchdog_interval_s(
    environ: Mapping[str, str] = os.environ, pid: int | None = None
) -> float | None:
    """Return in how many s the service manager wants a sign of life, or None.

    ``$WATCHDOG_PID`` may name another process than `pid` (default: this one); then the time-out
    in ``$WATCHDOG_USEC`` is not ours.
    """
    wanted = environ.get("WATCHDOG_PID", "")
    if wanted and wanted != str(os.getpid() if pid is None else pid):
        return None
    text = environ.get("WATCHDOG_USEC", "")
    if not (text.isascii() and text.isdigit()) or int(text) == 0:
        return None
    return int(text) / 1e6


def _address(name: str) -> bytes | None:
    """Return the socket's address; a name with ``@`` is an abstract one, others are not unix."""
    if name.startswith("@"):
        return b"\0" + os.fsencode(name[1:])
    return os.fsencode(name) if name.startswith("/") else None


def _status(text: str) -> tuple[str, ...]:
    """Return the line for `text`; a line break in it would begin a message of its own."""
    return (f"STATUS={' '.join(text.split())}",) if text else ()
