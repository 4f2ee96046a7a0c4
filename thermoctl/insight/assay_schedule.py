"""When the gain is assayed: once the loop is at rest after a move.

At rest the gain is not assayed. The power then only answers noise, and half an hour of it gave any
gain from 40 to 85 for a true 44 (``docs/insight.md``). Heat that nobody foresaw spoils a stretch as
well, so one with a change in it is left out.
"""

from __future__ import annotations

import math

from thermoctl.insight.assay import Assay, assay, noise_of
from thermoctl.insight.rest import Rest
from thermoctl.insight.samples import Samples
from thermoctl.quantities import Array

WINDOW_S, WINDOW_LAGS, WINDOW = 1_800.0, 100.0, 600
"""Length of the stretch at rest that noise is learnt from: in s, in lags and in samples, the
longest of the three."""
SETTLED_LAGS = 10.0
"""Time at rest, in lags, after which a move is assayed."""
BEFORE_LAGS = 5.0
"""Time before a move, in lags, at which its stretch begins, where there are samples of it."""
SURE = 0.1
"""Relative standard deviation of a gain from which on it says nothing of a move."""


class AssaySchedule:
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
        self._window_s = max(WINDOW_S, WINDOW_LAGS * lag_s, WINDOW * samples.period_s)
        self._whitener: Array | None = None
        self._assayed_s = -math.inf
        self._from_s = -math.inf

    def disturb(self, t_s: float) -> None:
        """Note that heat came or went until `t_s`: nothing before it is assayed any more."""
        self._from_s = self._assayed_s = t_s

    def after(self, t_s: float, rest: Rest) -> Assay | None:
        """Return what the last move says, once that can be computed."""
        lasts_s = rest.lasts_s(t_s)
        if lasts_s == 0.0:
            return None
        if self._whitener is None:
            self._learn_noise(t_s, max(rest.since_s, self._from_s))
        elif rest.moved_s > self._assayed_s and lasts_s >= SETTLED_LAGS * self._lag_s:
            return self._of_move(t_s, rest)
        return None

    def _learn_noise(self, t_s: float, begin_s: float) -> None:
        """Learn the noise of a whole stretch at rest."""
        if t_s - begin_s < self._window_s:
            return
        self._from_s = t_s
        stretch = self._samples.between(begin_s, t_s, self._lag_s)
        if stretch is not None:
            self._whitener = noise_of(stretch, self._lag_s, self._gain_k_per_s)

    def _of_move(self, t_s: float, rest: Rest) -> Assay | None:
        """Return the gain of the last move; tried once."""
        self._assayed_s = rest.moved_s
        until_s = min(t_s, rest.since_s + 2.0 * SETTLED_LAGS * self._lag_s)
        for begin_s in (rest.moved_s - BEFORE_LAGS * self._lag_s, rest.moved_s):
            stretch = self._samples.between(begin_s, until_s, self._lag_s)
            if stretch is None or self._whitener is None:
                continue
            found = assay(stretch, self._lag_s, self._whitener)
            if found is not None and 0.0 < found.gain.sd < SURE * found.gain.mean:
                return found
        return None
