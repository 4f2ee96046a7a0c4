"""Lines under control: scripted, in lock step, or broken."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from thermoctl.ports import Link
from thermoctl.testing.clock import ManualClock

_BYTES_PER_S = 11_520  # of a line at 115200 baud


@dataclass(frozen=True, slots=True)
class Turn:
    """One exchange of a `Transcript`.

    Parameters
    ----------
    expects : bytes or None
        What must be written; None accepts anything.
    answers : bytes
        What comes back.
    delay_s : float
        How long after the write the answer comes.
    disconnects : bool
        The line is pulled out: from now on every call raises `OSError`.
    """

    expects: bytes | None
    answers: bytes = b""
    delay_s: float = 0.0
    disconnects: bool = False


class Transcript:
    """A line that plays exchanges written down beforehand, on a `ManualClock`.

    Raises
    ------
    AssertionError
        When something else is written than the next turn expects, or more than all turns.
    """

    def __init__(self, clock: ManualClock, turns: Iterable[Turn]) -> None:
        self.timeout: float | None = None
        self.write_timeout: float | None = None
        self.closed = False
        self._clock = clock
        self._turns = list(turns)
        self._coming: list[tuple[float, int]] = []
        self._unplugged = False

    @property
    def finished(self) -> bool:
        """Whether every turn has been played."""
        return not self._turns

    def write(self, data: bytes, /) -> int:
        """Compare `data` with the next turn, and schedule its answer."""
        self._check()
        if not self._turns:
            raise AssertionError(f"expected no more writes, got {data!r}")
        turn = self._turns.pop(0)
        if turn.expects is not None and data != turn.expects:
            raise AssertionError(f"expected {turn.expects!r} to be written, got {data!r}")
        due_s = self._clock.now_s() + turn.delay_s
        self._coming += [(due_s, byte) for byte in turn.answers]
        self._unplugged = turn.disconnects
        return len(data)

    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes; the clock moves as long as a read waits."""
        self._check()
        if self.timeout is None:
            raise AssertionError("expected a time-out, a read without one may block for ever")
        until_s = self._clock.now_s() + self.timeout
        due = [each for each in self._coming[:size] if each[0] <= until_s]
        del self._coming[: len(due)]
        self._clock.sleep_until(max((when for when, _ in due), default=until_s))
        if len(due) < size:
            self._clock.sleep_until(until_s)
        return bytes(byte for _, byte in due)

    def reset_input_buffer(self) -> None:
        """Forget what has already come."""
        self._check()
        now_s = self._clock.now_s()
        self._coming = [each for each in self._coming if each[0] > now_s]

    def close(self) -> None:
        """Remember that it was closed."""
        self.closed = True

    def _check(self) -> None:
        if self._unplugged or self.closed:
            raise OSError(5, "Input/output error")


class Device(Protocol):
    """Something simulated at the other end of a line, moved on by `advance` alone."""

    def send(self, data: bytes) -> None:
        """Take bytes."""
        ...

    def receive(self) -> bytes:
        """Return what was sent since the last call."""
        ...

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        ...


class LockStepLink:
    """A line to a simulated `Device` that lives exactly as long as the clock says.

    Parameters
    ----------
    device : Device
        What is at the other end.
    clock : ManualClock
        Moved on while a read waits; when others move it, the device follows at the next call.
    step_s : float
        How finely a waiting read looks.
    """

    def __init__(self, device: Device, clock: ManualClock, step_s: float = 0.0005) -> None:
        self.timeout: float | None = None
        self.write_timeout: float | None = None
        self.closed = False
        self._device, self._clock, self._step_s = device, clock, step_s
        self._lived_until_s = clock.now_s()
        self._received = b""

    def catch_up(self) -> None:
        """Let the device live until now."""
        now_s = self._clock.now_s()
        if now_s > self._lived_until_s:
            self._device.advance(now_s - self._lived_until_s)
            self._lived_until_s = now_s
        self._received += self._device.receive()

    def write(self, data: bytes, /) -> int:
        """Put `data` on the line."""
        self._check()
        self.catch_up()
        self._device.send(data)
        return len(data)

    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes, letting time pass until `timeout`."""
        self._check()
        if self.timeout is None:
            raise AssertionError("expected a time-out, a read without one may block for ever")
        until_s = self._clock.now_s() + self.timeout
        self.catch_up()
        while len(self._received) < size and self._clock.now_s() < until_s:
            self._clock.sleep_until(min(self._clock.now_s() + self._step_s, until_s))
            self.catch_up()
        taken, self._received = self._received[:size], self._received[size:]
        return taken

    def reset_input_buffer(self) -> None:
        """Forget what has come."""
        self._check()
        self.catch_up()
        self._received = b""

    def close(self) -> None:
        """Let the device go; it lives on with its clock."""
        self.closed = True

    def _check(self) -> None:
        if self.closed:
            raise OSError(9, "Bad file descriptor")


class FaultyLink:
    """Any line, broken on demand: set `fault` to one of `FAULTS`.

    ``silent`` swallows what is written; ``garbage`` answers noise; ``half`` lets the first half of
    an answer through; ``endless`` streams without a line feed; ``echo`` returns what was written;
    ``unplugged`` raises at once and ``unplugged-mid-read`` after a few bytes; ``stuck`` blocks
    writes until their time-out.
    """

    FAULTS = (
        "silent",
        "garbage",
        "half",
        "endless",
        "echo",
        "unplugged",
        "unplugged-mid-read",
        "stuck",
    )

    def __init__(self, link: Link, clock: ManualClock, seed: int = 1) -> None:
        self.fault = "healthy"
        self.written = 0
        self._link, self._clock = link, clock
        self._rng = np.random.default_rng(seed)
        self._pending = b""
        self._mid_read = 0

    @property
    def timeout(self) -> float | None:
        """Longest wait of a read."""
        return self._link.timeout

    @timeout.setter
    def timeout(self, seconds: float | None) -> None:
        self._link.timeout = seconds

    @property
    def write_timeout(self) -> float | None:
        """Longest wait of a write."""
        return self._link.write_timeout

    @write_timeout.setter
    def write_timeout(self, seconds: float | None) -> None:
        self._link.write_timeout = seconds

    def write(self, data: bytes, /) -> int | None:
        """Write, as far as the fault lets it."""
        self.written += 1
        self._mid_read = 0
        match self.fault:
            case "unplugged":
                raise OSError(5, "Input/output error")
            case "stuck":
                if self.write_timeout is None:
                    raise AssertionError("expected a write time-out, there was none")
                self._clock.advance(self.write_timeout)
                raise TimeoutError("Write timeout")
            case "silent" | "endless":
                return len(data)
            case "garbage":
                self._pending = self._rng.bytes(40) + b"\n"
                return len(data)
            case "echo":
                self._pending = data
                return len(data)
        return self._link.write(data)

    def read(self, size: int = 1) -> bytes:
        """Read, as far as the fault lets it."""
        match self.fault:
            case "unplugged":
                raise OSError(5, "Input/output error")
            case "unplugged-mid-read":
                self._mid_read += 1
                if self._mid_read > 1:
                    raise OSError(5, "Input/output error")
                return self._link.read(min(size, 3))
            case "half":
                self._mid_read += 1
                return self._link.read(min(size, 6)) if self._mid_read == 1 else self._wait()
            case "endless":
                self._clock.advance(size / _BYTES_PER_S)
                return b"x" * size
            case "silent" | "garbage" | "echo" | "stuck":
                taken, self._pending = self._pending[:size], self._pending[size:]
                return taken if len(taken) == size else taken + self._wait()
        return self._link.read(size)

    def reset_input_buffer(self) -> None:
        """Forget what has come."""
        if self.fault == "unplugged":
            raise OSError(5, "Input/output error")
        self._pending = b""
        self._link.reset_input_buffer()

    def close(self) -> None:
        """Close the line behind."""
        self._link.close()

    def _wait(self) -> bytes:
        self._clock.advance(self.timeout or 0.0)
        return b""
