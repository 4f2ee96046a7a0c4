"""Axes that do not breathe: they grow, in steps of 1, 2 and 5, and never shrink."""

from __future__ import annotations

import math
from dataclasses import dataclass

_MINUTE, _HOUR, _DAY = 60.0, 3600.0, 86_400.0

RANGES_S = (
    *(n * _MINUTE for n in (2, 5, 10, 30, 60)),
    *(n * _HOUR for n in (2, 6, 12, 24)),
    *(n * _DAY for n in (2, 7, 30, 90, 365)),
)
"""Lengths of time a chart can show."""

_TICKS_S = (
    *(5.0, 10.0, 30.0),
    *(n * _MINUTE for n in (1, 2, 5, 10, 30)),
    *(n * _HOUR for n in (1, 2, 6, 12)),
    *(n * _DAY for n in (1, 2, 7, 30, 90)),
)

_COLDEST_C, _HOTTEST_C = -273.0, 3000.0  # a reading outside of this does not spoil the axis
_STEPS_MOST = 16


def range_for(elapsed_s: float) -> float:
    """Return the shortest range that holds `elapsed_s`; the longest when none does."""
    return next((range_s for range_s in RANGES_S if not elapsed_s > range_s), RANGES_S[-1])


def tick_for(range_s: float, most: int) -> float:
    """Return the shortest distance of time marks that gives at most `most` of them."""
    return next((tick for tick in _TICKS_S if range_s <= most * tick), _TICKS_S[-1])


def next_step(step: float) -> float:
    """Return the step that follows `step` in 1, 2, 5, 10, 20, 50, ..."""
    exponent = math.floor(math.log10(step) + 1e-9)
    mantissa = round(step / 10.0**exponent)
    return {1: 2.0, 2: 5.0, 5: 10.0}[mantissa] * 10.0**exponent


@dataclass(slots=True)
class Scale:
    """The axis of the temperature chart: whole steps, at most sixteen of them.

    Parameters
    ----------
    step : float
        What the axis grows by in °C, of the series 1, 2, 5.
    first, last : int
        The axis runs from ``first * step`` to ``last * step``; equal while nothing is known.
    """

    step: float = 0.1
    first: int = 0
    last: int = 0

    def copy(self) -> Scale:
        """Return the axis as it is now."""
        return Scale(self.step, self.first, self.last)

    @property
    def known(self) -> bool:
        """Return whether there is anything to show."""
        return self.last > self.first

    @property
    def low(self) -> float:
        """Return the temperature at the bottom; above `high` while nothing is known."""
        return self.first * self.step if self.known else math.inf

    @property
    def high(self) -> float:
        """Return the temperature at the top."""
        return self.last * self.step if self.known else -math.inf

    def grow(self, value_c: float) -> None:
        """Make room for `value_c`; what is not a believable temperature is passed over."""
        if not _COLDEST_C <= value_c <= _HOTTEST_C or self.low <= value_c <= self.high:
            return
        low, high = min(self.low, value_c), max(self.high, value_c)
        while True:
            self.first = math.floor(low / self.step + 1e-9)
            self.last = max(math.ceil(high / self.step - 1e-9), self.first + 1)
            if self.last - self.first <= _STEPS_MOST:
                return
            self.step = next_step(self.step)

    def labels(self) -> list[tuple[float, str]]:
        """Return every labelled temperature with its label, from the bottom up."""
        if not self.known:
            return []
        apart = next_step(next_step(self.step))
        decimals = max(0, -math.floor(math.log10(apart) + 1e-9))
        first = math.ceil(self.low / apart - 1e-9)
        last = math.floor(self.high / apart + 1e-9)
        values = [i * apart for i in range(first, last + 1)]
        return [(value, f"{value:.{decimals}f}".replace("-", "−")) for value in values]
