"""Single keys of a terminal, as named actions."""

from __future__ import annotations

import os
import select
import termios
import tty
from collections.abc import Mapping
from enum import StrEnum
from types import TracebackType
from typing import Any, Self

_MOST_BYTES = 1024


class Action(StrEnum):
    """What the operator asked for with one key."""

    SETPOINT_UP = "setpoint-up"
    SETPOINT_DOWN = "setpoint-down"
    SETPOINT_UP_MUCH = "setpoint-up-much"
    SETPOINT_DOWN_MUCH = "setpoint-down-much"
    MODE = "mode"
    CONTROLLER = "controller"
    CONFIRM = "confirm"
    CANCEL = "cancel"
    COLD_WATER = "cold-water"
    ICE = "ice"
    STIRRER = "stirrer"
    ACKNOWLEDGE = "acknowledge"
    PAUSE = "pause"
    QUIT = "quit"


ESCAPE = b"\x1b"

_KEYS: Mapping[bytes, Action] = {
    b"\x1b[A": Action.SETPOINT_UP,
    b"\x1bOA": Action.SETPOINT_UP,  # while the terminal is in its application mode
    b"\x1b[B": Action.SETPOINT_DOWN,
    b"\x1bOB": Action.SETPOINT_DOWN,
    b"\x1b[1;2A": Action.SETPOINT_UP_MUCH,
    b"\x1b[a": Action.SETPOINT_UP_MUCH,  # rxvt
    b"\x1b[5~": Action.SETPOINT_UP_MUCH,
    b"\x1b[1;2B": Action.SETPOINT_DOWN_MUCH,
    b"\x1b[b": Action.SETPOINT_DOWN_MUCH,
    b"\x1b[6~": Action.SETPOINT_DOWN_MUCH,
    b"m": Action.MODE,
    b"c": Action.CONTROLLER,
    b"\r": Action.CONFIRM,
    b"\n": Action.CONFIRM,
    ESCAPE: Action.CANCEL,
    b"d": Action.COLD_WATER,
    b"i": Action.ICE,
    b"s": Action.STIRRER,
    b"a": Action.ACKNOWLEDGE,
    b" ": Action.PAUSE,
    b"q": Action.QUIT,
    b"\x03": Action.QUIT,
    b"\x04": Action.QUIT,
}


def _sequence_end(received: bytes, begin: int) -> int | None:
    """Return where the escape sequence at `begin` ends; None while it is not complete."""
    if begin + 1 == len(received):
        return None
    introducer = received[begin + 1 : begin + 2]
    if introducer == b"O":
        return begin + 3 if begin + 2 < len(received) else None
    if introducer != b"[":
        return begin + 1  # the key Escape itself, and then another key
    for at in range(begin + 2, len(received)):
        if 0x40 <= received[at] <= 0x7E:
            return at + 1
    return None


def decode(received: bytes) -> tuple[list[Action], bytes]:
    """Return the actions in `received`, and what is begun at its end.

    Keys without an action, unknown sequences and stray bytes are passed over.
    """
    actions: list[Action] = []
    begin = 0
    while begin < len(received):
        end: int | None = begin + 1
        if received[begin : begin + 1] == ESCAPE:
            end = _sequence_end(received, begin)
            if end is None:
                return actions, received[begin:]
        action = _KEYS.get(received[begin:end])
        if action is not None:
            actions.append(action)
        begin = end if end is not None else len(received)
    return actions, b""


class Keys:
    """Keys as they are pressed; a context that restores the terminal.

    Parameters
    ----------
    fd : int
        File descriptor to read from. When it is no terminal, or has come to its end, there are
        no keys, and that is no error.
    """

    def __init__(self, fd: int = 0) -> None:
        self._fd = fd
        self._before: list[Any] | None = None
        self._begun = b""

    def __enter__(self) -> Self:
        if os.isatty(self._fd):
            self._before = termios.tcgetattr(self._fd)
            tty.setcbreak(self._fd, termios.TCSANOW)
            attributes = termios.tcgetattr(self._fd)
            # A controller must not be stopped by Ctrl-Z: the heater would be left to the board.
            attributes[6][termios.VSUSP] = b"\x00"
            termios.tcsetattr(self._fd, termios.TCSANOW, attributes)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._before is not None:
            before, self._before = self._before, None
            try:
                termios.tcsetattr(self._fd, termios.TCSADRAIN, before)
            except termios.error:
                return  # the terminal itself is gone

    def poll(self, timeout_s: float = 0.0) -> list[Action]:
        """Return the actions of the keys pressed since the last call.

        Parameters
        ----------
        timeout_s : float
            How long to wait for the first key; 0 returns at once.
        """
        if self._before is None:
            select.select([], [], [], timeout_s)
            return []
        # What follows a lone Escape comes at once, or never.
        ready, _, _ = select.select([self._fd], [], [], 0.0 if self._begun else timeout_s)
        if not ready:
            begun, self._begun = self._begun, b""
            return [Action.CANCEL] if begun == ESCAPE else []
        try:
            received = os.read(self._fd, _MOST_BYTES)
        except OSError:
            received = b""
        if not received:  # hung up
            return [Action.QUIT]
        actions, self._begun = decode(self._begun + received)
        return actions
