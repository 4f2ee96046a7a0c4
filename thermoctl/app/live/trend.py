"""A run of any length in bounded memory, as extremes, mean and last value.

Buckets lie side by side in time from the first sample on. When they are used up, neighbours are
merged and the buckets are twice as wide; so the whole run is always there, and an extreme is
never lost, whatever the length of the run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from thermoctl.quantities import Array

CAPACITY = 4096
"""Buckets kept: at least 2048 for the whole run, ten for each dot of a wide terminal."""

(
    TEMPERATURE_LOW,
    DEVIATION_LOW,
    POWER_LOW,
    TEMPERATURE_HIGH,
    DEVIATION_HIGH,
    POWER_HIGH,
    INFLATION_HIGH,
    POWER_SUM,
    POWER_COUNT,
    SETPOINT,
    GAIN,
    POLE,
    HOLDING,
    LOSS,
    LAG,
) = range(15)
_LOWS, _HIGHS, _SUMS, _LASTS = slice(0, 3), slice(3, 7), slice(7, 9), slice(9, 15)
_EMPTY = (math.nan,) * 7 + (0.0, 0.0) + (math.nan,) * 6


def _merge(table: Array, starts: npt.NDArray[np.intp]) -> Array:
    """Return the reduction of `table` over the intervals ``starts[2j] : starts[2j + 1]``."""
    merged = np.empty((table.shape[0], starts.size // 2))
    merged[_LOWS] = np.fmin.reduceat(table[_LOWS], starts, axis=1)[:, ::2]
    merged[_HIGHS] = np.fmax.reduceat(table[_HIGHS], starts, axis=1)[:, ::2]
    merged[_SUMS] = np.add.reduceat(table[_SUMS], starts, axis=1)[:, ::2]
    last = table[_LASTS, starts[1::2] - 1]
    merged[_LASTS] = np.where(np.isnan(last), table[_LASTS, starts[0::2]], last)
    return merged


@dataclass(frozen=True, slots=True, eq=False)
class Trend:
    """What a run looked like, at one moment.

    Parameters
    ----------
    origin_s : float
        Loop time of the left edge of the first bucket; NaN before the first sample.
    width_s : float
        Length of a bucket.
    table : ndarray, shape (15, buckets)
        The rows are named by this module's constants; NaN where there was no sample.
    """

    origin_s: float
    width_s: float
    table: Array

    def first_column(self, end_s: float, column_s: float, count: int) -> int:
        """Return the number, counted from the origin, of the leftmost of `count` columns.

        Columns stand still in time, and in pairs, as a cell holds two: as the run goes on they
        move left by whole cells, and nothing shimmers.
        """
        return 2 * (math.floor((end_s - self.origin_s) / (2.0 * column_s)) + 1) - count

    def columns(self, end_s: float, column_s: float, count: int) -> Array:
        """Return the run as `count` columns of `column_s`, up to `end_s`.

        Returns
        -------
        ndarray, shape (15, count)
            Each column reduces every bucket it touches.
        """
        result = np.tile(np.array(_EMPTY)[:, None], (1, count))
        if not (math.isfinite(self.origin_s) and math.isfinite(end_s)):
            return result
        edges_s = column_s * (self.first_column(end_s, column_s, count) + np.arange(count + 1.0))
        buckets = self.table.shape[1]
        begin = np.floor(edges_s[:-1] / self.width_s + 1e-9)
        end = np.maximum(np.ceil(edges_s[1:] / self.width_s - 1e-9), begin + 1.0)
        inside = (begin < buckets) & (end > 0.0)
        if inside.any():
            starts = np.empty(2 * int(inside.sum()), dtype=np.intp)
            starts[0::2] = np.maximum(begin[inside], 0.0)
            starts[1::2] = np.minimum(end[inside], buckets)
            padded = np.concatenate([self.table, np.array(_EMPTY)[:, None]], axis=1)
            result[:, inside] = _merge(padded, starts)
        return result


class TrendRecorder:
    """Takes samples one by one and gives a `Trend` at any moment."""

    def __init__(self, period_s: float, capacity: int = CAPACITY) -> None:
        if not period_s > 0.0:
            raise ValueError(f"period_s must be positive, got {period_s!r}")
        if capacity < 2 or capacity % 2:
            raise ValueError(f"capacity must be even and at least 2, got {capacity!r}")
        self._period_s = self._width_s = period_s
        self._capacity = capacity
        self._origin_s = math.nan
        self._table = np.tile(np.array(_EMPTY)[:, None], (1, capacity))
        self._open = list(_EMPTY)
        self._at = 0

    def add(
        self, t_s: float, extremes: tuple[float, float, float], rest: tuple[float, ...]
    ) -> None:
        """Take one sample.

        Parameters
        ----------
        t_s : float
            Loop time; a sample older than the open bucket is not taken.
        extremes : tuple of 3 floats
            Temperature in °C, deviation in mK and power, of which both extremes are kept.
        rest : tuple of 7 floats
            Inflation, of which the greatest is kept; set point, gain, pole, holding power, loss and
            lag, of which the last is. NaN is unknown, everywhere.
        """
        if not math.isfinite(t_s):
            return
        if math.isnan(self._origin_s):
            # Half a period of slack keeps samples that jitter in buckets of their own.
            self._origin_s = t_s - 0.5 * self._period_s
        at = math.floor((t_s - self._origin_s) / self._width_s)
        if at < self._at:
            return
        while at >= self._capacity:
            self._fold()
            at = math.floor((t_s - self._origin_s) / self._width_s)
        if at != self._at:
            self._table[:, self._at] = self._open
            self._open, self._at = list(_EMPTY), at
        self._extend(extremes, rest)

    def _extend(self, extremes: tuple[float, float, float], rest: tuple[float, ...]) -> None:
        """Widen the open bucket by one sample."""
        row = self._open
        for i, value in enumerate(extremes):
            # Comparisons are turned so that a NaN in the bucket is replaced, one coming is not.
            if value == value:
                if not row[i] <= value:
                    row[i] = value
                if not row[TEMPERATURE_HIGH + i] >= value:
                    row[TEMPERATURE_HIGH + i] = value
        power, inflation = extremes[2], rest[0]
        if power == power:
            row[POWER_SUM] += power
            row[POWER_COUNT] += 1.0
        if inflation == inflation and not row[INFLATION_HIGH] >= inflation:
            row[INFLATION_HIGH] = inflation
        row[SETPOINT:] = rest[1:]

    def _fold(self) -> None:
        """Merge neighbouring buckets."""
        self._table[:, self._at] = self._open
        starts = np.repeat(np.arange(0, self._capacity, 2, dtype=np.intp), 2)
        starts[1::2] += 2
        padded = np.concatenate([self._table, np.array(_EMPTY)[:, None]], axis=1)
        half = self._capacity // 2
        self._table[:, :half] = _merge(padded, starts)
        self._table[:, half:] = np.array(_EMPTY)[:, None]
        self._width_s *= 2.0
        self._at //= 2
        self._open = self._table[:, self._at].tolist()

    def trend(self) -> Trend:
        """Return the run so far; what comes later does not change it."""
        table = self._table[:, : self._at + 1].copy()
        table[:, self._at] = self._open
        return Trend(self._origin_s, self._width_s, table)
