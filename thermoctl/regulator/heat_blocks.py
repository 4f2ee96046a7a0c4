"""Samples in blocks: watching a heater costs next to nothing a sample."""

from __future__ import annotations

import math

from thermoctl.regulator.heat_response import Block

BLOCK_S = 4.0
NOISE_START_K2 = 1e-3
NOISE_MIN_K2 = 1e-6
"""Noise below 1 mK is not believed."""
_MOST = 9.0  # a square counts as three standard deviations at most
_MEMORY = 0.01  # of 100 readings
_SPREAD = 6.0  # variance of y - 2 y1 + y2 in units of the noise's: 1 + 4 + 1
_SURE = 30.0  # exponent of the odds against a run of equal readings


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
            second = reading_c - 2.0 * self._last_c + self._before_c
            self._before_c, self._last_c = self._last_c, reading_c
            if second == second:
                square, most = second * second / _SPREAD, _MOST * self._variance
                self._variance += _MEMORY * ((square if square < most else most) - self._variance)
                self._variance = max(self._variance, NOISE_MIN_K2)
        return self._complete() if self._span_s >= self._least_s else None

    def _complete(self) -> Block:
        n, span_s, given_s = self._readings, self._span_s, self._given_s
        mean_c = self._sign * self._total_c / n if n else math.nan
        self.clear()
        return Block(span_s, given_s / span_s, mean_c, math.sqrt(self._variance / max(n, 1)))


class Repeats:
    """Tells a converter that stands still from one with coarse steps.

    The share of readings that equal the one before is learnt; a run that is next to impossible by
    that share, and no shorter than `LEAST`, is a converter that stands still.
    """

    LEAST = 10
    KNOWN_AFTER = 200
    MEMORY = 1 / 500
    SHARE_MAX = 0.4
    """Where more readings than this repeat themselves, the noise is below half a step."""
    MORE, AND = 1.3, 0.02
    """Where the reading lies between two steps changes the share by about so much."""

    def __init__(self) -> None:
        self._last_c = math.nan
        self._run = 0
        self._seen = 0
        self._share = 0.0
        self._limit = math.inf

    def observe(self, reading_c: float) -> bool:
        """Return whether the converter stands still; NaN is no reading, and says nothing."""
        if reading_c == self._last_c:
            self._run += 1
            return self._run >= self._limit
        if reading_c == reading_c:
            self._last_c = reading_c
            self._learn(self._run)
            self._run = 0
        return False

    @property
    def run(self) -> int:
        """How many readings in a row have equalled the one before."""
        return self._run

    def _learn(self, run: int) -> None:
        """Learn from a run that has ended; one that was a fault teaches nothing."""
        if run >= self._limit:
            return
        self._seen += run + 1
        memory = max(self.MEMORY, 1.0 / self._seen)
        self._share += min(memory * (run + 1), 1.0) * (run / (run + 1) - self._share)
        known = self._seen >= self.KNOWN_AFTER and self._share <= self.SHARE_MAX
        odds = -math.log(self.MORE * self._share + self.AND)
        self._limit = max(self.LEAST, math.ceil(_SURE / odds)) if known else math.inf
