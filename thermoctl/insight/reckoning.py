"""When the gain is assayed: after the loop was moved, and again and again at rest.

Heat that nobody foresaw spoils a stretch, so one with a change in it is left out. At rest little is
learnt in half an hour, and it leans towards the quick part of the plant; such gains are compared
with their like only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from thermoctl.insight.assay import Assay, assay, noise_of
from thermoctl.insight.rest import Rest
from thermoctl.insight.samples import Samples
from thermoctl.quantities import Array

WINDOW_S, WINDOW_LAGS = 1_800.0, 100.0
"""A stretch at rest is so long, and at least so many lags."""
SETTLED_LAGS = 10.0
"""A move is assayed when the loop has been at rest for so many lags."""
BEFORE_LAGS = 5.0
"""Its stretch begins so many lags before it, where there are samples of that time."""
SURE = 0.1
"""A gain whose standard deviation is a larger share of it says nothing of a move."""


@dataclass(frozen=True, slots=True)
class Reckoned:
    """A gain, and where it comes from.

    Parameters
    ----------
    began_s, t_s : float
        First and last time of the stretch.
    assay : Assay
        What it says.
    moved : bool
        Somebody moved the loop in it; else it was at rest.
    """

    began_s: float
    t_s: float
    assay: Assay
    moved: bool


class Reckoning:
    """Assays the gain of one loop.

    Parameters
    ----------
    lag_s, gain_k_per_s : float
        Of the plant, as they are believed when the loop comes to rest for the first time.
    samples : Samples
        Where the samples are kept.
    """

    def __init__(self, lag_s: float, gain_k_per_s: float, samples: Samples) -> None:
        self._lag_s, self._gain_k_per_s, self._samples = lag_s, gain_k_per_s, samples
        self._window_s = max(WINDOW_S, WINDOW_LAGS * lag_s)
        self._whitener: Array | None = None
        self._assayed_s = -math.inf
        self._from_s = -math.inf

    def disturb(self, t_s: float) -> None:
        """Note that heat came or went until `t_s`: nothing before it is assayed any more."""
        self._from_s = self._assayed_s = t_s

    def after(self, t_s: float, rest: Rest) -> Reckoned | None:
        """Return what can be reckoned after the sample at `t_s`, if anything."""
        lasts_s = rest.lasts_s(t_s)
        if lasts_s == 0.0:
            return None
        begin_s = max(rest.since_s, self._from_s)
        whole = t_s - begin_s >= self._window_s
        if whole:
            self._from_s = t_s
            stretch = self._samples.between(t_s - self._window_s, t_s, self._lag_s)
            if self._whitener is None and stretch is not None:
                self._whitener = noise_of(stretch, self._lag_s, self._gain_k_per_s)
                return None
        if self._whitener is None:
            return None
        if rest.moved_s > self._assayed_s and lasts_s >= SETTLED_LAGS * self._lag_s:
            return self._of_move(t_s, rest)
        return self._reckoned(t_s - self._window_s, t_s, moved=False) if whole else None

    def _of_move(self, t_s: float, rest: Rest) -> Reckoned | None:
        """Return the gain of the last move; tried once."""
        self._assayed_s = rest.moved_s
        until_s = min(t_s, rest.since_s + 2.0 * SETTLED_LAGS * self._lag_s)
        for begin_s in (rest.moved_s - BEFORE_LAGS * self._lag_s, rest.moved_s):
            found = self._reckoned(begin_s, until_s, moved=True)
            if found is not None:
                gain = found.assay.gain
                return found if 0.0 < gain.sd < SURE * gain.value else None
        return None

    def _reckoned(self, begin_s: float, end_s: float, *, moved: bool) -> Reckoned | None:
        stretch = self._samples.between(begin_s, end_s, self._lag_s)
        if stretch is None or self._whitener is None or np.ptp(stretch.applied) == 0.0:
            return None
        found = assay(stretch, self._lag_s, self._whitener)
        return None if found is None else Reckoned(begin_s, end_s, found, moved)
