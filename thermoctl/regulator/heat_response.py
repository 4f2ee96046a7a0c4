r"""What power does to the reading, learnt beside every controller.

Time goes in blocks of some seconds. For each of a few lags the heat that has arrived is known,
since it was applied:

.. math:: H_j = \int q_j\,dt, \qquad y = y_0 - d\,t + \beta H_j

A fading straight line is taken from y and from every H by one and the same filter. What drifts, the
loss first of all, is gone from both, and a regression of what is left through the origin is the
gain beta. A lag is as good as little remains. It is learnt only while power moves: a controller
that makes up for a draught makes it look as if heat did nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from thermoctl.quantities import Array

LAGS_S = (4.0, 9.0, 20.0, 45.0, 90.0, 150.0)
"""Total lags from power to reading; each is two equal poles."""
TREND_S = 100.0
"""Memory of the straight line."""
MEMORY_S = 1500.0
"""Memory of the regression, in time during which power moved."""
MOVES = 0.05
"""Power this close to its mean teaches nothing."""
MEAN_S = 50.0
"""Memory of that mean."""
ALIKE = 4.0
"""What remains of one block resembles the next, so errors are larger than they look."""
BLOCKS_LEAST = 4.0
JUMP_K, JUMP_SDS, JUMP_GAINS = 0.5, 10.0, 3.0
"""A reading that moves by more in a block than these is no drift: somebody poured."""


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


class Gain(NamedTuple):
    """Rise at full power in K/s, its sd, and the place of its lag in `LAGS_S`."""

    mean: float
    sd: float
    place: int

    @property
    def lag_s(self) -> float:
        """Total lag in s."""
        return LAGS_S[self.place]

    @property
    def stored_k(self) -> float:
        """Rise in a lag at full power, in K: what is under way, and nobody can see yet."""
        return self.mean * self.lag_s


class HeatResponse:
    """Learns gain and lag from blocks.

    Attributes
    ----------
    heat_s : ndarray, shape (lags,)
        Heat that has arrived under each lag, in seconds of full power; replaced, never changed.
    gain : Gain or None
        What has been learnt.
    jumped : bool
        Whether the last reading moved as no heater and no loss can move it.
    """

    def __init__(self) -> None:
        n = len(LAGS_S)
        self._pole_s = 0.5 * np.array(LAGS_S)
        self._span_s = math.nan
        self._step: Array = np.ones(n)
        self._fade = 1.0
        self._mean_power, self._moving_s = 0.0, 0.0
        self._heat_squares, self._products = np.zeros(n), np.zeros(n)
        self._squares = self._blocks = 0.0
        self.gain: Gain | None = None
        self.begin_again()

    def begin_again(self) -> None:
        """Forget where heat and reading are; what was learnt of the plant stays."""
        n = len(LAGS_S)
        self._first, self._second = np.zeros(n), np.zeros(n)
        self.heat_s: Array = np.zeros(n)
        self._line, self._slope = np.zeros(n + 1), np.zeros(n + 1)
        self._last_c = math.nan
        self.jumped = False

    def observe(self, block: Block, *, learn: bool) -> None:
        """Take one more block in, and learn from it if that is wanted."""
        span_s, reading_c = block.span_s, block.reading_c
        self._arrive(span_s, block.power)
        self.jumped = False
        now = np.empty(len(self._line))
        now[:-1], now[-1] = self.heat_s, reading_c
        if math.isnan(self._last_c):
            self._line, self._last_c = now, reading_c
            return
        self._line = self._line + span_s * self._slope
        if math.isnan(reading_c):
            return
        moved_k = reading_c - self._last_c
        self._last_c = reading_c
        if abs(moved_k) > self._most_k(block):
            self.jumped = True
            self._line[-1] += moved_k
            return
        off = now - self._line
        fade = self._fade
        self._line += (1.0 - fade * fade) * off
        self._slope = self._slope + ((1.0 - fade) ** 2 / span_s) * off
        if learn and self._moving_s > 0.0:
            self._learn(off, block)

    def _arrive(self, span_s: float, power: float) -> None:
        """Let `span_s` of `power` go through every lag."""
        if span_s != self._span_s:
            self._span_s = span_s
            self._step, self._fade = -np.expm1(-span_s / self._pole_s), math.exp(-span_s / TREND_S)
        self._first += self._step * (power - self._first)
        self._second += self._step * (self._first - self._second)
        self.heat_s = self.heat_s + span_s * self._second
        away = power - self._mean_power
        self._mean_power += min(span_s / MEAN_S, 1.0) * away
        self._moving_s = TREND_S if abs(away) > MOVES else self._moving_s - span_s

    def _most_k(self, block: Block) -> float:
        """Return how far a reading may move in a block."""
        gain = math.inf if self.gain is None else self.gain.mean
        return max(JUMP_K, JUMP_SDS * block.sd_k, JUMP_GAINS * gain * block.span_s)

    def _learn(self, off: Array, block: Block) -> None:
        """Add what is left of a block to the regression."""
        keep, heat, rest_k = math.exp(-block.span_s / MEMORY_S), off[:-1], float(off[-1])
        self._heat_squares = keep * self._heat_squares + heat * heat
        self._products = keep * self._products + heat * rest_k
        self._squares = keep * self._squares + rest_k * rest_k
        self._blocks = keep * self._blocks + 1.0
        if self._blocks < BLOCKS_LEAST or not self._heat_squares.all():
            return
        mean = self._products / self._heat_squares
        left = np.maximum(self._squares - mean * self._products, 0.0)
        place = int(left.argmin())
        variance = max(float(left[place]) / self._blocks, block.sd_k**2)
        sd = ALIKE * math.sqrt(variance / float(self._heat_squares[place]))
        self.gain = Gain(float(mean[place]), sd, place)
