"""Samples in blocks: watching a heater costs next to nothing a sample."""

from __future__ import annotations

import math
from typing import NamedTuple

BLOCK_S = 4.0
NEARLY_FULL = 0.9
"""Power above which a reading has to rise, unless its plant is at what it can reach."""
NOISE_START_K2 = 1e-3
NOISE_MIN_K2 = 1e-6
"""Least variance of the noise in K²: 1 mK."""
_MOST = 9.0  # a square counts as three standard deviations at most
_MEMORY = 0.01  # of 100 readings
_SPREAD = 6.0  # variance of y - 2 y1 + y2 in units of the noise's: 1 + 4 + 1
_ROUNDED = 1.0 / math.sqrt(12.0)  # standard deviation of what a step rounds off, in steps
_STEP_MAX_K = 0.5  # no converter is taken to be coarser


class Block(NamedTuple):
    """Some seconds of a loop.

    Parameters
    ----------
    span_s : float
        How long.
    power : float
        Mean of what was applied.
    reading_c : float
        Mean reading; NaN where there was none.
    sd_k : float
        Its standard deviation, by the noise of the readings.
    """

    span_s: float
    power: float
    reading_c: float
    sd_k: float


class Blocks:
    """Adds samples up until a block is complete.

    Parameters
    ----------
    period_s : float
        Nominal time between two samples; no block is shorter.
    sign : float
        -1 where power cools: to the watch everything is a heater.
    """

    def __init__(self, period_s: float, sign: float = 1.0) -> None:
        self._least_s = max(BLOCK_S, period_s) - 0.5 * period_s
        self._sign = sign
        self._variance = NOISE_START_K2
        self._step_k = _STEP_MAX_K
        self._last_c = self._before_c = math.nan
        self.clear()

    def clear(self) -> None:
        """Forget the block that is not complete."""
        self._span_s = self._given_s = self._total_c = 0.0
        self._readings = 0

    def add(self, interval_s: float, reading_c: float, applied: float) -> Block | None:
        """Add a sample, NaN for no reading; return a block that it completes."""
        self._span_s += interval_s
        self._given_s += applied * interval_s
        if reading_c == reading_c:  # nearly always, and faster than to ask for NaN
            self._total_c += reading_c
            self._readings += 1
            moved_k = abs(reading_c - self._last_c)
            if 0.0 < moved_k < self._step_k:
                self._step_k = moved_k
            second = reading_c - 2.0 * self._last_c + self._before_c
            self._before_c, self._last_c = self._last_c, reading_c
            if second == second:
                square, most = second * second / _SPREAD, _MOST * self._variance
                self._variance += _MEMORY * ((square if square < most else most) - self._variance)
                if self._variance < NOISE_MIN_K2:
                    self._variance = NOISE_MIN_K2
        return self._complete() if self._span_s >= self._least_s else None

    def _complete(self) -> Block:
        n, span_s, given_s = self._readings, self._span_s, self._given_s
        mean_c = self._sign * self._total_c / n if n else math.nan
        self.clear()
        # What is rounded off stays the same for many readings: their mean is no better.
        sd_k = math.hypot(math.sqrt(self._variance / max(n, 1)), _ROUNDED * self._step_k)
        return Block(span_s, given_s / span_s, mean_c, sd_k)
