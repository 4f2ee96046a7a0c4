"""One request, one reply, one deadline: how host and board talk."""

from __future__ import annotations

import termios
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from thermoctl.errors import FaultError, LinkError, TransientError
from thermoctl.ports import Clock, Link
from thermoctl_drivers import thermodaq_frames as frames
from thermoctl_drivers.thermodaq_frames import FrameError, Refusal, Reply

LINK_ERRORS = (OSError, termios.error)
"""What a port raises that is pulled out or stuck; termios.error is not an OSError."""

_SHORTEST_WRITE_S = 0.001

Value = TypeVar("Value")


class RefusedByBoard(FaultError):  # noqa: N818 - an answer, though not the one hoped for
    """The board answered, and did not obey; `fields` are those of its refusal."""

    def __init__(self, text: str, fields: tuple[str, ...]) -> None:
        super().__init__(text)
        self.fields = fields

    def because(self, reason: Refusal) -> bool:
        """Return whether `reason` is the one the board gave."""
        return self.fields == (str(int(reason)),)


@dataclass(frozen=True, slots=True)
class Answer:
    """A valid reply and when its last byte was here, in s on the clock."""

    reply: Reply
    received_s: float


class Exchange:
    """Requests and replies over one link; counts everything that went wrong.

    Replies are matched by sequence number, so that one that comes late, or twice, is never taken
    for the next. Lines are collected here, because `readline` of a port waits for each byte anew
    and an endless stream would hold it for ever.

    Parameters
    ----------
    link : Link
        The port.
    clock : Clock
        Where deadlines are measured.
    """

    def __init__(self, link: Link, clock: Clock) -> None:
        self.counters: Counter[str] = Counter()
        self.last_good_s: float | None = None
        self._link, self._clock = link, clock
        self._assembler = frames.Assembler()
        self._sequence = 0

    def ask(
        self, letter: str, *arguments: int, deadline_s: float, wait_s: float, attempts: int
    ) -> Answer:
        """Return the answer to ``letter arguments``; ask anew until one is valid.

        Parameters
        ----------
        letter, *arguments : str, int
            The command.
        deadline_s : float
            When to give up, in s on the clock.
        wait_s : float
            Longest wait of one attempt.
        attempts : int
            How often to send it, at least 1.

        Raises
        ------
        TransientError
            When no attempt brought a valid reply.
        RefusedByBoard
            When the board refused the last attempt, or said that it is not configured.
        LinkError
            When the link failed.
        """
        failure: TransientError | RefusedByBoard = TransientError(f"{letter}: no time left")
        for attempt in range(attempts):
            if self._clock.now_s() >= deadline_s:
                break
            self.counters["retries"] += attempt > 0
            until_s = min(deadline_s, self._clock.now_s() + wait_s)
            try:
                return self._once(letter, arguments, until_s)
            except FrameError as error:
                failure = TransientError(f"no valid reply to {letter}: {error}")
                self.forget()
            except RefusedByBoard as refused:
                failure = refused
                self.counters["refused"] += 1
                if refused.because(Refusal.UNCONFIGURED):
                    break  # the same request cannot fare better
        raise failure

    def forget(self) -> None:
        """Forget what has come and was not read."""
        self._assembler.clear()
        self._guarded(self._link.reset_input_buffer)

    def _once(self, letter: str, arguments: tuple[int, ...], until_s: float) -> Answer:
        """Send one request and return its answer; raise `FrameError` when none came in time."""
        self._sequence = (self._sequence + 1) & 0xFF
        self._send(frames.request(self._sequence, letter, *arguments), until_s)
        while (remaining_s := until_s - self._clock.now_s()) > 0.0:
            for line in self._assembler.feed(self._receive(remaining_s)):
                reply = self._decoded(line)
                if reply.sequence not in (self._sequence, None) or reply.letter not in letter + "E":
                    self.counters["dropped"] += 1
                    continue
                if reply.letter == "E":
                    raise self._refusal(letter, reply)
                self.last_good_s = self._clock.now_s()
                return Answer(reply, self.last_good_s)
        raise FrameError(f"expected a line, got {self._assembler.half!r} in time")

    def _refusal(self, letter: str, reply: Reply) -> Exception:
        """Return the error of a refusal: one that names nobody means that our line was damaged."""
        text = f"{letter} refused: {frames.refusal(reply)}"
        if reply.sequence is None:
            return FrameError(text)
        self.last_good_s = self._clock.now_s()
        return RefusedByBoard(text, reply.fields)

    def _decoded(self, line: bytes) -> Reply:
        """Return the reply in `line`, counting a damaged one."""
        try:
            return frames.decode(line)
        except FrameError:
            self.counters["garbled"] += 1
            raise

    def _send(self, line: bytes, until_s: float) -> None:
        """Write `line`, at the latest until `until_s`."""

        def transmit() -> None:
            remaining_s = until_s - self._clock.now_s()
            self._link.write_timeout = max(remaining_s, _SHORTEST_WRITE_S)
            self._link.write(line)

        self._guarded(transmit)

    def _receive(self, timeout_s: float) -> bytes:
        """Return what came within `timeout_s`, not waiting for more than a line can lack."""

        def listen() -> bytes:
            self._link.timeout = timeout_s
            return self._link.read(self._assembler.missing)

        return self._guarded(listen)

    @staticmethod
    def _guarded(call: Callable[[], Value]) -> Value:
        """Return ``call()``, with what a lost port raises turned into `LinkError`."""
        try:
            return call()
        except LINK_ERRORS as error:
            raise LinkError(f"expected a working link, got {error}") from error
