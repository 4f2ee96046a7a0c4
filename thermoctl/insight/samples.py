"""The last hours of a loop, thinned to what its lag can resolve."""

from __future__ import annotations

import math
from array import array

import numpy as np

from thermoctl.insight.assay import Stretch
from thermoctl.quantities import Array

PER_LAG = 20
"""Number of samples in a lag that are enough."""
FINEST_S = 0.5
"""Time in s over which closer samples are taken together as they come."""
KEPT_S, KEPT_LAGS, KEPT = 7_200.0, 400.0, 2_400
"""What is kept: in s, in lags and in samples, the most of the three."""
BRIDGED = 5
"""Largest number of readings in a row that may be missing; more of them break a stretch."""


class Samples:
    """Readings with the power before each.

    Parameters
    ----------
    period_s : float
        Time between two samples.
    """

    def __init__(self, period_s: float) -> None:
        self._together = max(1, round(FINEST_S / period_s))
        self.period_s = self._together * period_s
        self._rows = array("d")
        self._open: list[tuple[float, float, float]] = []
        self._last_c, self._missing = math.nan, 0

    def take(self, t_s: float, reading_c: float, applied: float, lag_s: float) -> None:
        """Take a sample; a reading that is NaN is bridged by the one before it."""
        if math.isfinite(reading_c):
            self._last_c, self._missing = reading_c, 0
        else:
            self._missing += 1
            if self._missing > BRIDGED or math.isnan(self._last_c):
                del self._rows[:]
                self._open.clear()
                return
        self._open.append((t_s, self._last_c, applied))
        if len(self._open) == self._together:
            self._rows.extend(_mean(self._open))
            self._open.clear()
            kept = 3 * max(KEPT, math.ceil(max(KEPT_S, KEPT_LAGS * lag_s) / self.period_s))
            if len(self._rows) > kept + kept // 4:
                del self._rows[:-kept]

    def between(self, begin_s: float, end_s: float, lag_s: float) -> Stretch | None:
        """Return what is kept from `begin_s` to `end_s`; None where the begin is lost."""
        rows: Array = np.array(self._rows).reshape(-1, 3)
        if not len(rows) or rows[0, 0] > begin_s + 2.0 * self.period_s:
            return None
        rows = rows[(rows[:, 0] >= begin_s) & (rows[:, 0] <= end_s)]
        thin = max(1, math.floor(lag_s / PER_LAG / self.period_s))
        whole = len(rows) // thin * thin
        if whole < 2 * thin:
            return None
        thinned = rows[:whole].reshape(-1, thin, 3).mean(axis=1)
        return Stretch(thinned[:, 1], thinned[:, 2], thin * self.period_s)


def _mean(rows: list[tuple[float, float, float]]) -> tuple[float, ...]:
    count = len(rows)
    return (
        rows[0] if count == 1 else tuple(sum(column) / count for column in zip(*rows, strict=True))
    )
