"""Faults that have a name, read from what a plant has become.

A quantity is compared with what it was when it was learnt. A drift is named when it is far beyond
both errors, by more than a share that matters, for long enough; it ends when it is half as large.

Explained in ``docs/insight.md``.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from thermoctl.insight.changes import Usual
from thermoctl.quantities import Uncertain

SIGMAS = 3.0
"""Standard deviations beyond which there is a drift."""
HELD_BACK = 2
"""Number of recent spans by which a baseline takes values later than they are compared, so that a
drift is named before it is learnt."""
RELEASED = 0.5
"""Share of what names a drift below which it ends."""


@dataclass(frozen=True, slots=True)
class Compared:
    """A quantity when it was learnt, and now."""

    before: Uncertain
    now: Uncertain

    @property
    def share(self) -> float:
        """By which share of the value before it grew."""
        return self.now.mean / self.before.mean - 1.0 if self.before.mean else math.nan

    @property
    def sigmas(self) -> float:
        """How many standard deviations lie between them; negative where it fell."""
        sd = math.hypot(self.before.sd, self.now.sd)
        return (self.now.mean - self.before.mean) / sd if sd > 0.0 else math.nan

    def beyond(self, share: float) -> bool:
        """Return whether it moved by `share`, up or down, and out of all error."""
        if share < 0.0:
            return self.share <= share and self.sigmas <= -SIGMAS
        return self.share >= share and self.sigmas >= SIGMAS

    def within(self, share: float) -> bool:
        """Return whether less than `RELEASED` of `share` is left."""
        return self.share > RELEASED * share if share < 0.0 else self.share < RELEASED * share


class Hysteresis:
    """Whether a comparison stands: it begins at `share`, and ends at half of it.

    Parameters
    ----------
    share : float
        By how much a quantity has to move; negative: fall.
    times : int
        Comparisons in a row.
    """

    def __init__(self, share: float, times: int) -> None:
        self.share, self._times = share, times
        self._contrary = 0
        self.stands = False

    def after(self, compared: Compared) -> bool:
        """Take one more comparison; return whether it changed what stands."""
        other = compared.within(self.share) if self.stands else compared.beyond(self.share)
        self._contrary = self._contrary + 1 if other else 0
        if self._contrary < self._times:
            return False
        self.stands, self._contrary = not self.stands, 0
        return True

    def end(self) -> bool:
        """Let it stand no longer; return whether it did."""
        stood, self.stands, self._contrary = self.stands, False, 0
        return stood


class Baseline:
    """What a quantity usually is: learnt first, then followed slowly.

    Parameters
    ----------
    learnt : int
        Values that it is learnt from.
    memory : int
        Values over which it is followed.
    recent : int
        Newest values that are compared with it, as their mean.
    """

    def __init__(self, learnt: int, memory: int, recent: int) -> None:
        self._learnt, self._memory = learnt, memory
        self._recent: deque[float] = deque(maxlen=recent)
        self._waiting: deque[float] = deque()
        self._count, self._mean = 0, 0.0
        self._usual = Usual(memory)

    def after(self, value: float, *, follow: bool = True) -> Compared | None:
        """Take a value; return how the newest compare, None while there is too little.

        Parameters
        ----------
        value : float
            The newest.
        follow : bool
            Whether this is as it should be; else the baseline stays where it is.
        """
        self._recent.append(value)
        if follow:
            self._waiting.append(value)
            if len(self._waiting) > HELD_BACK * (self._recent.maxlen or 1):
                self._take(self._waiting.popleft())
        else:
            self._waiting.clear()
        if self._count < self._learnt or len(self._recent) < (self._recent.maxlen or 1):
            return None
        sd = self._usual.sd
        now = Uncertain(sum(self._recent) / len(self._recent), sd / math.sqrt(len(self._recent)))
        return Compared(Uncertain(self._mean, sd / math.sqrt(min(self._count, self._memory))), now)

    def _take(self, value: float) -> None:
        self._count += 1
        away = value - self._mean
        if self._count > 1:
            self._usual.after(away)
        self._mean += away / min(self._count, self._memory)
