"""The other end of the control socket, for commands and for other programs."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from thermoctl.errors import NotPermitted, NotRunning, Refused, ThermoctlError, Unavailable
from thermoctl.services.control_place import checked, usual_paths
from thermoctl.services.control_protocol import VERSION, asking, error_words

ANSWER_S: Final = 5.0
"""How long a reply may take that needs no cycle of the loop."""

_PAUSE_S: Final = 0.02
_HARMLESS: Final = ("status", "get", "alarms")
"""Calls that change nothing, and may be made twice."""


class ControlClient:
    """One connection to a running daemon, as a context.

    Parameters
    ----------
    path : Path, optional
        Its socket; the user's daemon, else the machine's, when not given.

    Raises
    ------
    NotRunning
        No daemon answers.
    NotPermitted
        One does, and this user may not talk to it.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._paths = usual_paths() if path is None else [checked(path)]
        self._connect()
        self._calls = 0

    def _connect(self) -> None:
        self._connection = _connected(self._paths)
        self._lines = self._connection.makefile("rb")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let the connection go; idempotent."""
        self._lines.close()
        self._connection.close()

    def ask(self, do: str, patience_s: float = ANSWER_S, **keys: Any) -> Mapping[str, Any]:
        """Return the content of the reply to a call.

        A busy daemon may drop a client it has not heard yet; what changes nothing is then asked a
        second time.

        Parameters
        ----------
        do : str
            What to do, see docs/control.md.
        patience_s : float
            How long to wait for the reply, in s.
        **keys
            The other keys of the call; those that are None are left out.

        Raises
        ------
        Refused
            The daemon says no; the text says why.
        NotRunning
            The daemon has gone.
        Unavailable
            No reply in time, or none that can be understood.
        """
        try:
            return self._asked(do, patience_s, keys)
        except NotRunning as gone:
            if do not in _HARMLESS:
                raise
            self.close()
            try:
                self._connect()
            except ThermoctlError:
                raise gone from None
            return self._asked(do, patience_s, keys)

    def ask_loop(self, do: str, **keys: Any) -> Mapping[str, Any]:
        """Return the reply to a call that a loop grants, as late as the slowest loop may.

        Raises
        ------
        Refused, NotRunning, Unavailable
            As `ask` does.
        """
        patience_s = float(self.ask("status")["patience_s"])
        return self.ask(do, patience_s + ANSWER_S, **keys)

    def _asked(self, do: str, patience_s: float, keys: Mapping[str, Any]) -> Mapping[str, Any]:
        self._calls += 1
        self._connection.settimeout(patience_s)
        try:
            self._connection.sendall(asking(self._calls, do, keys))
            reply = self._next()
        except TimeoutError as error:
            raise Unavailable(f"expected a reply within {patience_s:g} s, got none") from error
        except OSError as error:
            raise _gone() from error
        if not reply.get("ok"):
            raise Refused(error_words(reply.get("error") or {}))
        return reply

    def watch(self, loop: str | None = None) -> Iterator[Mapping[str, Any]]:
        """Yield the record of every finished cycle until the daemon ends.

        Raises
        ------
        Refused
            There is no such loop.
        NotRunning
            The daemon has gone.
        """
        return (cycle for cycle, _ in self._watched(loop, None))

    def follow(self, loop: str) -> Iterator[tuple[Mapping[str, Any], Mapping[str, Any]]]:
        """Yield record and details of every cycle of `loop` until the daemon ends.

        Raises
        ------
        Refused
            There is no such loop, or the daemon is too old to tell details.
        NotRunning
            The daemon has gone.
        """
        return self._watched(loop, True)

    def _watched(
        self, loop: str | None, details: bool | None
    ) -> Iterator[tuple[Mapping[str, Any], Mapping[str, Any]]]:
        self.ask("watch", loop=loop, details=details)
        self._connection.settimeout(None)
        while True:
            try:
                told = self._next()
            except OSError as error:
                raise _gone() from error
            cycle = told.get("cycle")
            if isinstance(cycle, dict):
                yield cycle, told.get("details") or {}

    def _next(self) -> dict[str, Any]:
        line = self._lines.readline()
        if not line:
            raise _gone()
        try:
            reply = json.loads(line)
        except ValueError as error:
            raise Unavailable(f"expected a line of JSON, got {line[:60]!r}") from error
        if not isinstance(reply, dict) or reply.get("v") != VERSION:
            raise Unavailable(f"expected version {VERSION} of the protocol, got {line[:60]!r}")
        return reply


def _connected(paths: Sequence[Path]) -> socket.socket:
    """Return a connection to the first path where a daemon answers."""
    for path in paths:
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        connection.settimeout(ANSWER_S)
        try:
            _patiently(connection, checked(path))
        except PermissionError as error:
            connection.close()
            raise NotPermitted(f"expected to be allowed to use {path}; try sudo") from error
        except BlockingIOError as error:
            connection.close()
            raise Unavailable(f"expected the daemon at {path} to be less busy") from error
        except OSError:
            connection.close()
        except Unavailable:
            connection.close()
            raise
        else:
            return connection
    looked = " or ".join(str(path) for path in paths)
    for path in paths:
        if path.exists() and not path.is_socket():
            raise NotRunning(f"expected the socket of a running daemon, got another file: {path}")
    raise NotRunning(f"expected a running daemon at {looked}, found none")


def _patiently(connection: socket.socket, path: Path) -> None:
    """Connect; while the daemon's queue of newcomers is full, try again."""
    until_s = time.monotonic() + ANSWER_S
    while True:
        try:
            connection.connect(os.fspath(path))
        except BlockingIOError:
            if time.monotonic() > until_s:
                raise
            time.sleep(_PAUSE_S)
        else:
            return


def _gone() -> NotRunning:
    return NotRunning("expected the daemon to stay, but it has ended")
