"""Randomness for the plant: normal numbers in blocks, wandering values.

Every source has a generator of its own, spawned from the one that was handed in, so that a
disturbance at one place does not change the noise at another.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain

from numpy.random import Generator

BLOCK = 512


def normals(rng: Generator) -> Iterator[float]:
    """Return standard normal numbers without end, drawn in blocks."""
    return chain.from_iterable(_blocks(rng))


def _blocks(rng: Generator) -> Iterator[list[float]]:
    while True:
        yield rng.standard_normal(BLOCK)[::-1].tolist()


class Wander:
    """An Ornstein-Uhlenbeck process: mean 0, exact for any interval.

    Parameters
    ----------
    rng : Generator
        Where its steps come from; not shared.
    deviation : float
        Stationary standard deviation, at least 0. At 0 nothing is drawn.
    correlation_s : float
        Correlation time, positive.
    """

    __slots__ = ("_correlation_s", "_decay", "_deviation", "_interval_s", "_kick", "_normals",
                 "value")  # fmt: skip

    def __init__(self, rng: Generator, deviation: float, correlation_s: float) -> None:
        self._normals = normals(rng)
        self._deviation = deviation
        self._correlation_s = correlation_s
        self._interval_s = 0.0
        self._decay, self._kick = 1.0, 0.0
        self.value = deviation * next(self._normals) if deviation > 0.0 else 0.0

    def advance(self, interval_s: float) -> float:
        """Return the value `interval_s` later."""
        if self._deviation == 0.0:
            return 0.0
        if interval_s != self._interval_s:
            self._interval_s = interval_s
            self._decay = math.exp(-interval_s / self._correlation_s)
            self._kick = self._deviation * math.sqrt(1.0 - self._decay**2)
        self.value = value = self._decay * self.value + self._kick * next(self._normals)
        return value
