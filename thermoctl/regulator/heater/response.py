r"""What power does to the reading, learnt beside every controller.

Time goes in blocks of some seconds. For each of a few lags the heat that has arrived is known,
since it was applied:

.. math:: H_j = \int q_j\,dt, \qquad y = y_0 - d\,t + \beta H_j

A fading straight line is taken from y and from every H by one and the same filter. What drifts, the
loss first of all, is gone from both, and a regression of what is left through the origin is the
gain beta. A lag is as good as little remains. It is learnt only while power moves: a controller
that makes up for a draught makes it look as if heat did nothing.

A small plant cools within those same minutes, and its loss is no straight line. It is as a lag of
heat shows it, k times the reading, so that the integral of the reading is one regressor more, for
all lags the same:

.. math:: y = y_0 - d\,t + \beta H_j - k \int y\,dt

Without it a gain of .5 K/s is taken for .3, and half of what holds such a plant seems to be lost.
It counts only where it is sure: the bend of a lag that lies between two of those that are tried, or
of a heater that has just died, looks like a loss as well.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.past import MOVES, FirstReadings, Past

Heat = tuple[float, ...]
"""Heat that has arrived under each lag, in seconds of full power."""

LAGS_S = (4.0, 9.0, 20.0, 45.0, 90.0, 150.0)
"""Total lags from power to reading; each is two equal poles."""
BETWEEN_S = (6.0, 13.0, 30.0, 64.0)
"""More lags in s, for the regression alone: between two of LAGS_S the gain would be wrong by
half."""
TREND_S = 100.0
"""Time constant in s of the fading straight line."""
MEMORY_S = 1500.0
"""Time constant in s of the regression, counted while power moves."""
RISE_K, RISE_SDS = 0.1, 6.0
"""A rise counts beyond both, in K and in standard deviations of a reading."""
MEAN_S = 50.0
"""Time constant in s of the mean power, from which a move is told."""
ALIKE, ALIKE_S = 4.0, 6.0
"""Factor on all errors: the remainder of one block resembles the next. Of blocks that are longer
than ALIKE_S in s, fewer do, and it falls with the root of the length."""
BLOCKS_LEAST = 4.0
COOLS_SURE = 3.0
"""Standard deviations beyond which a loss that grows with the reading counts."""
COOLS_S, COOLS_MOST = 100.0, 1.0 / 30.0
"""Such a cooling is expected to be one part in COOLS_S seconds, if any, and taken as COOLS_MOST per
second at most."""
JUMP_K, JUMP_SDS, JUMP_GAINS = 0.5, 10.0, 3.0
"""A reading that moves in a block by more than all three has jumped, since somebody poured: in K,
in its standard deviations, and in rises at full power."""
STORED_K = 60.0
"""Most heat under way in K; a lag under which there were more is left out. A block that gives its
heat away within seconds follows its power, and so does a long lag with ten times the gain, for the
few minutes of a warm-up."""
MIXES_S = 100.0
"""Time in s after a jump in which nothing is learnt: the water is still mixing, and the rebound of
the reading would pass for a heater of thirty times the gain."""


class Gain(NamedTuple):
    """Rise at full power in K/s, its sd, and the place of its lag in `LAGS_S`.

    A reading that is higher by a K falls faster by `cools_per_s` in K/s.
    """

    mean: float
    sd: float
    place: int
    cools_per_s: float = 0.0

    @property
    def lag_s(self) -> float:
        """Total lag in s."""
        return LAGS_S[self.place]

    @property
    def stored_k(self) -> float:
        """Rise in a lag at full power, in K: what is under way, and nobody can see yet."""
        return self.mean * self.lag_s


class Seen(NamedTuple):
    """Reading in degC and heat under every lag in s, at a time in s."""

    t_s: float
    reading_c: float
    heat_s: Heat


def clear_k(sd_k: float) -> float:
    """Return the least rise in K that counts; `sd_k` is the noise of a reading."""
    return max(RISE_K, RISE_SDS * sd_k)


class _Path:
    """One lag: heat on its way, a straight line through what has arrived, and the regression.

    Plain numbers: for so few lags they are several times as fast as arrays. What is done with every
    lag in every block stands in a loop, for a call of a method would cost more than what it does.
    """

    __slots__ = (
        "along",
        "first",
        "heat_s",
        "line",
        "off",
        "pole_s",
        "products",
        "second",
        "slope",
        "squares",
        "step",
    )

    def __init__(self, lag_s: float) -> None:
        self.pole_s = 0.5 * lag_s
        self.step = 1.0
        self.squares = self.products = self.along = 0.0
        self.begin_again()

    def begin_again(self) -> None:
        self.first = self.second = self.heat_s = self.line = self.slope = self.off = 0.0

    def stand(self) -> None:
        self.line, self.off = self.heat_s, 0.0


class _Total:
    """The integral of the reading, less its own fading line, and what it has in common with it."""

    __slots__ = ("off", "products", "slope_c", "squares")

    def __init__(self) -> None:
        self.squares = self.products = 0.0
        self.begin_again(0.0)

    def begin_again(self, reading_c: float) -> None:
        self.off, self.slope_c = 0.0, reading_c

    def follow(self, by: float, by_per_s: float) -> None:
        self.slope_c += by_per_s * self.off
        self.off -= by * self.off

    def learn(self, keep: float, rest_k: float) -> None:
        self.squares = keep * self.squares + self.off * self.off
        self.products = keep * self.products + self.off * rest_k


class HeatResponse:
    """Learns gain and lag from blocks.

    Attributes
    ----------
    heat_s : tuple of float
        Heat that has arrived under each lag, in seconds of full power.
    gain : Gain or None
        What has been learnt.
    jumped : bool
        Whether the last reading moved as no heater and no loss can move it.
    retracted : bool
        Whether with the last block all that was learnt since a start has turned out to be
        worth nothing: what rose may have been heat from before.
    """

    def __init__(self) -> None:
        self._paths = [_Path(lag_s) for lag_s in LAGS_S + BETWEEN_S]
        self._total = _Total()
        self._span_s = math.nan
        self._fade, self._alike = 1.0, ALIKE
        self._mean_power, self._moving_s = 0.0, 0.0
        self._squares = self._blocks = self._variance = 0.0
        self.gain: Gain | None = None
        self.begin_again()

    def begin_again(self) -> None:
        """Forget where heat and reading are; what was learnt of the plant stays."""
        for path in self._paths:
            path.begin_again()
        self.heat_s: Heat = (0.0,) * len(LAGS_S)
        self._line_c = self._slope = self._mixes_s = 0.0
        self._last_c = math.nan
        self._start = FirstReadings(Past.OPEN if self.gain is None else Past.NOTHING)
        self.jumped = self.retracted = False

    def observe(self, block: Block, *, learn: bool) -> None:
        """Take one more block in, and learn from it if that is wanted."""
        span_s, reading_c, paths, total = block.span_s, block.reading_c, self._paths, self._total
        self.jumped = self.retracted = False
        if learn and abs(block.power - self._start.power) > MOVES:
            self._learn_anew()
        self._arrive(span_s, block.power)
        self._start.observe(block)
        self._mixes_s -= span_s
        if math.isnan(self._last_c):
            self._line_c = self._last_c = reading_c
            total.begin_again(reading_c)
            for path in paths:
                path.line = path.heat_s
            return
        self._line_c += span_s * self._slope
        if math.isnan(reading_c):
            return
        total.off += span_s * (0.5 * (reading_c + self._last_c) - total.slope_c)
        moved_k, self._last_c = reading_c - self._last_c, reading_c
        if abs(moved_k) > self._most_k(block):
            self.jumped, self._mixes_s = True, MIXES_S
        if self._mixes_s > 0.0:
            self._line_c, total.off = reading_c, 0.0
            for path in paths:
                path.stand()
            return
        rest_k, fade = reading_c - self._line_c, self._fade
        by, by_per_s = 1.0 - fade * fade, (1.0 - fade) ** 2 / span_s
        self._line_c += by * rest_k
        self._slope += by_per_s * rest_k
        if learn and self._moving_s > 0.0:
            self._learn(rest_k, block)
        total.follow(by, by_per_s)
        for path in paths:
            path.line += by * path.off
            path.slope += by_per_s * path.off

    @property
    def ripe(self) -> bool:
        """Whether heat of before the start can be told from what was learnt since."""
        return self._start.told

    @property
    def moved_k(self) -> float:
        """How far heat has moved the reading that taught the gain, in K."""
        if self.gain is None or not self._blocks:
            return 0.0
        squares = self._paths[self.gain.place].squares
        return abs(self.gain.mean) * math.sqrt(squares / self._blocks)

    def forget(self) -> None:
        """Forget what was learnt; where heat and reading are stays."""
        for path in self._paths:
            path.squares = path.products = path.along = 0.0
        self._total.squares = self._total.products = 0.0
        self._squares = self._blocks = self._variance = 0.0
        self.gain = None

    def _learn_anew(self) -> None:
        """Go on as if heat had come for long as it was given since the start."""
        self.forget()
        for path in self._paths:
            path.first = path.second = path.slope = self._start.power
            path.stand()
        self._total.begin_again(self._last_c)
        self._moving_s = 0.0
        self._line_c, self._slope = self._last_c, self._start.rate / self._span_s
        self._mean_power, self._start = self._start.power, FirstReadings(Past.NOTHING)
        self.retracted = True

    def _arrive(self, span_s: float, power: float) -> None:
        """Let `span_s` of `power` go through every lag."""
        if span_s != self._span_s:
            self._span_s, self._fade = span_s, math.exp(-span_s / TREND_S)
            self._alike = max(ALIKE * math.sqrt(ALIKE_S / max(span_s, ALIKE_S)), 1.0)
            for path in self._paths:
                path.step = -math.expm1(-span_s / path.pole_s)
        for path in self._paths:
            step = path.step
            path.first = first = path.first + step * (power - path.first)
            path.second = second = path.second + step * (first - path.second)
            path.heat_s = heat_s = path.heat_s + span_s * second
            path.line = line = path.line + span_s * path.slope
            path.off = heat_s - line
        self.heat_s = tuple([path.heat_s for path in self._paths[: len(LAGS_S)]])
        away = power - self._mean_power
        self._mean_power += min(span_s / MEAN_S, 1.0) * away
        self._moving_s = TREND_S if abs(away) > MOVES else self._moving_s - span_s

    def _most_k(self, block: Block) -> float:
        """Return how far a reading may move in a block."""
        gain = math.inf if self.gain is None else self.gain.mean
        return max(JUMP_K, JUMP_SDS * block.sd_k, JUMP_GAINS * gain * block.span_s)

    def _learn(self, rest_k: float, block: Block) -> None:
        """Add what is left of a block to the regression."""
        keep, total = math.exp(-block.span_s / MEMORY_S), self._total
        total_ks = total.off
        for path in self._paths:
            off = path.off
            path.squares = keep * path.squares + off * off
            path.products = keep * path.products + off * rest_k
            path.along = keep * path.along + off * total_ks
        total.learn(keep, rest_k)
        self._squares = keep * self._squares + rest_k * rest_k
        self._blocks = keep * self._blocks + 1.0
        if self._blocks >= BLOCKS_LEAST and self._paths[0].squares:
            self.gain = self._fit(block)

    def _fit(self, block: Block) -> Gain:
        """Return the gain under the lag that explains most; of a plant that cools, if that is sure.

        How fast it cools is a ridge regression: about nothing, unless the readings know better.
        """
        paths, total, least, alike = self._paths, self._total, block.sd_k**2, self._alike
        own = total.squares + (alike * COOLS_S) ** 2 * max(self._variance, least)
        products, plain, cooling = total.products, [], []
        for path in paths:
            squares, along = path.squares, path.along
            if 2.0 * path.pole_s * path.products > STORED_K * squares:
                plain.append(0.0)
                cooling.append(0.0)
                continue
            alone = path.products * path.products / squares
            rest = along * path.products - squares * products
            plain.append(alone)
            if rest > 0.0:
                alone += rest * rest / (squares * (squares * own - along * along))
            cooling.append(alone)
        most = max(cooling)
        best = paths[cooling.index(most)]
        self._variance = variance = max((self._squares - most) / self._blocks, least)
        across = best.squares * own - best.along * best.along
        cools_per_s = (best.along * best.products - best.squares * products) / across
        if cools_per_s > COOLS_SURE * alike * math.sqrt(variance * best.squares / across):
            cools_per_s = min(cools_per_s, COOLS_MOST)
            mean = (best.products + cools_per_s * best.along) / best.squares
            sd = alike * math.sqrt(variance * own / across)
            return Gain(mean, sd, _place(cooling), cools_per_s)
        most = max(plain)
        best = paths[plain.index(most)]
        variance = max((self._squares - most) / self._blocks, least)
        sd = alike * math.sqrt(variance / best.squares)
        return Gain(best.products / best.squares, sd, _place(plain))


def _place(explained: list[float]) -> int:
    """Return the place in `LAGS_S` that explains the most."""
    known = explained[: len(LAGS_S)]
    return known.index(max(known))
