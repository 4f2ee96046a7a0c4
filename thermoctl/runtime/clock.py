"""The kinds of time: the machine's monotonic clock, a simulated and a paced one.

All satisfy `thermoctl.ports.Clock`, so an hour in a simulation runs the code a real hour runs.
"""

from __future__ import annotations

import time
from collections.abc import Callable

_SLICE_S = 0.1  # how long a signal may have to wait for a sleep to end


class MonotonicClock:
    """The machine's monotonic clock; `interrupt` ends a sleep within 0.1 s.

    `interrupt` only sets a flag, so that a signal handler may call it at any moment: an event or a
    condition has a lock that the interrupted code may hold.
    """

    def __init__(self) -> None:
        self._interrupted = False

    def now_s(self) -> float:
        """Return seconds since an arbitrary zero; the wall clock cannot move it."""
        return time.monotonic()

    def sleep_until(self, t_s: float) -> None:
        """Return at `t_s`, or when `interrupt` is called; at once when `t_s` is past."""
        while not self._interrupted and (remaining_s := t_s - time.monotonic()) > 0.0:
            time.sleep(min(remaining_s, _SLICE_S))

    def interrupt(self) -> None:
        """End this and every later sleep; used to stop, never to hurry a cycle."""
        self._interrupted = True


class SimulatedClock:
    """Time that moves only when somebody sleeps, or is told to."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s

    def now_s(self) -> float:
        """Return the simulated time in s."""
        return self._now_s

    def sleep_until(self, t_s: float) -> None:
        """Be at `t_s` at once; time never goes back."""
        self._now_s = max(self._now_s, t_s)

    def advance(self, seconds: float) -> None:
        """Move time on by `seconds`, at least zero."""
        if not seconds >= 0.0:
            raise ValueError(f"time only moves forward, got {seconds!r} s")
        self._now_s += seconds

    def interrupt(self) -> None:
        """Do nothing: a simulated sleep is over before anybody could end it."""


class PacedClock(SimulatedClock):
    """Simulated time at a fixed ratio to real time; may do something meanwhile.

    Parameters
    ----------
    speed : float
        Simulated seconds a second, greater than zero; infinite: never wait.
    start_s : float
        Simulated time at the start.
    """

    def __init__(self, speed: float, start_s: float = 0.0) -> None:
        if not speed > 0.0:
            raise ValueError(f"speed must be positive, got {speed!r}")
        super().__init__(start_s)
        self._speed = speed
        self._anchor_s = time.monotonic() - start_s / speed
        self._interrupted = False
        self._paused = False
        self.idle: Callable[[float], None] = time.sleep
        """Called again and again while waiting, with the longest time it may take."""

    def sleep_until(self, t_s: float) -> None:
        """Wait as long as `t_s` takes at this speed; a late wake is made good."""
        while not self._interrupted:
            begin_s = time.monotonic()
            remaining_s = self._anchor_s + t_s / self._speed - begin_s
            if self._paused:
                self.idle(_SLICE_S)
                self._anchor_s += time.monotonic() - begin_s
            elif remaining_s > 0.0:
                self.idle(min(remaining_s, _SLICE_S))
            else:
                break
        super().sleep_until(t_s)

    def pause(self) -> None:
        """Stop time where it is, or let it go on."""
        self._paused = not self._paused

    def interrupt(self) -> None:
        """End this and every later sleep."""
        self._interrupted = True
