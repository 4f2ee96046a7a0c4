r"""Heat that nobody gave or took: steps and slopes in the balance of a vessel.

Whatever the heater gave is taken off the reading, as late as the sensor feels it:

.. math:: R_k = y_k - \beta h \sum_{i \le k} q_i

While the plant is as it was, R falls by the loss, along a straight line. Cold water lets it fall at
once, a lid that is taken off lets it fall faster. So a line is laid through the past, up to a short
or a long time ago, and the reading held against where the line would be by now; how far it usually
is from there is measured beside it. A change is told once it is over, or clearly lasts.

Explained in ``docs/insight.md``.
"""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass, field

import numpy as np

from thermoctl.insight.lagged_power import LaggedPower
from thermoctl.quantities import Array

SPAN_S, SPAN_LAGS = 60.0, 4.0
"""Length of the short time: in s and in lags, the longer of the two."""
BLOCKS = 12
"""Number of blocks in the short time; each is the median of its samples."""
LONG, BASE = 5, 10
"""Length of the long time, and of the line, in short times."""
SIGMAS = 6.0
"""Least deviation that counts, in usual ones."""
NOISES = 5.0
"""Least deviation that counts, in standard deviations of a reading."""
FRESH, FRESH_TIMES = 2, 2.0
"""Number of short times after which deviations count, and the factor by which they have to be
larger until there are as many blocks as in the line: what is usual is not known before."""
FLAT, FLAT_USUAL = 0.05, 0.5
"""Largest growth in a short time for a change to be over: a share of the change itself, and one of
the usual deviation."""
LASTING = 6
"""Number of short times after which a change that still slopes is a lasting one."""
SLOPING = 0.3
"""Growth meanwhile, as a share of the change, beyond which it is no step."""
STILL_K = 1.0
"""Largest move in K of the past through which a line is fitted: beyond it the loss has changed
too."""
FELT = 0.2
"""Share of the lag after which a change of the water is felt."""
GAIN_LOW, GAIN_HIGH = 0.3, 4.0
"""Bounds of the rise over what the heater should have given, between which it is the gain that is
wrong."""


@dataclass(frozen=True, slots=True)
class Found:
    """A change of the balance.

    Parameters
    ----------
    t_s : float
        When it began.
    step_k, step_sd_k : float or None
        Heat that came or went, in K; None of a slope.
    slope_k_per_s, slope_sd_k_per_s : float or None
        Heat that goes on coming or going; None of a step.
    before_c : float
        What was read before.
    """

    t_s: float
    before_c: float
    step_k: float | None = None
    step_sd_k: float | None = None
    slope_k_per_s: float | None = None
    slope_sd_k_per_s: float | None = None


_TRUSTED = 12


class Usual:
    """How far a deviation usually is from 0: a root mean square with a memory."""

    def __init__(self, length: int) -> None:
        self._length, self.count, self._square = length, 0, 0.0

    def after(self, deviation: float) -> None:
        """Take one more; one far out counts as three usual ones."""
        self.count += 1
        square = deviation * deviation
        if self.count > _TRUSTED:
            square = min(square, 9.0 * self._square)
        self._square += (square - self._square) / min(self.count, self._length)

    @property
    def sd(self) -> float:
        """The deviation."""
        return math.sqrt(self._square)


@dataclass(frozen=True, slots=True)
class _Line:
    """A line through the past, and the block it ends with; `t` counts blocks."""

    end: int
    level: float
    slope: float

    @classmethod
    def through(cls, balance: Array, end: int) -> _Line:
        x = np.arange(len(balance)) - (len(balance) - 1)
        slope, level = np.polyfit(x, balance, 1)
        return cls(end, float(level), float(slope))

    def at(self, block: int) -> float:
        return self.level + self.slope * (block - self.end)


@dataclass(slots=True)
class _Blocks:
    """The past in blocks."""

    size: int
    t_s: list[float] = field(default_factory=list)
    balance: list[float] = field(default_factory=list)
    reading_c: list[float] = field(default_factory=list)
    given: list[float] = field(default_factory=list)
    _open: list[tuple[float, float, float, float]] = field(default_factory=list)

    def take(self, t_s: float, balance: float, reading_c: float, given: float) -> bool:
        """Take a sample; return whether it completed a block."""
        self._open.append((t_s, balance, reading_c, given))
        if len(self._open) < self.size:
            return False
        t, b, y, g = zip(*self._open, strict=True)
        self._open.clear()
        self.t_s.append(t[0])
        self.balance.append(statistics.median(b))
        self.reading_c.append(statistics.median(y))
        self.given.append(g[-1])
        for each in (self.t_s, self.balance, self.reading_c, self.given):
            del each[: -(BASE + LONG + LASTING + 2) * BLOCKS]
        return True


class ChangeWatch:
    """Watches the balance of one vessel.

    Parameters
    ----------
    period_s : float
        Time between two samples.
    lag_s : float
        Total lag of the plant.
    gain_k_per_s : float
        Heating rate at full power.
    power : float
        What is given when the watch begins.
    """

    def __init__(self, period_s: float, lag_s: float, gain_k_per_s: float, power: float) -> None:
        span_s = max(SPAN_S, SPAN_LAGS * lag_s)
        self.lag_s, self.gain_k_per_s = lag_s, gain_k_per_s
        self._period_s = period_s
        self._lagging = LaggedPower(lag_s, period_s, power)
        self._blocks = _Blocks(max(1, round(span_s / BLOCKS / period_s)))
        self._block_s = self._blocks.size * period_s
        self._usual = {1: Usual(60 * BLOCKS), LONG: Usual(60 * BLOCKS)}
        self._given = 0.0
        self._seen = 0
        self._from = 0
        self._suspect = 0
        self._event: _Event | None = None

    @property
    def busy(self) -> bool:
        """Whether a change is being measured."""
        return self._event is not None

    def forget(self) -> None:
        """Begin a new past: the plant was moved on purpose; what is usual is kept."""
        self._from, self._suspect, self._event = self._seen, 0, None

    def after(
        self, t_s: float, reading_c: float, applied: float, noise_sd_k: float
    ) -> Found | None:
        """Take a sample; return a change that is over, or that lasts.

        Parameters
        ----------
        t_s : float
            Its time.
        reading_c : float
            NaN when there is none.
        applied : float
            Power in the period before it.
        noise_sd_k : float
            Standard deviation of a reading.
        """
        self._given += self._lagging.after(applied) * self._period_s * self.gain_k_per_s
        if not math.isfinite(reading_c):
            return None
        if not self._blocks.take(t_s, reading_c - self._given, reading_c, self._given):
            return None
        self._seen += 1
        if self._event is not None:
            return self._measure(self._event)
        self._look(noise_sd_k)
        return None

    # -- watching --------------------------------------------------------------------------------

    def _past(self, gap: int) -> tuple[Array, _Line] | None:
        """Return the readings before `gap` short times, and a line through the balance then."""
        end = self._seen - gap * BLOCKS
        length = min(BASE * BLOCKS, end - self._from)
        if length < LONG * BLOCKS:
            return None
        first = len(self._blocks.t_s) - (self._seen - end) - length
        if first < 0:
            return None
        readings = np.array(self._blocks.reading_c[first : first + length])
        if np.ptp(readings) > STILL_K:
            return None
        return readings, _Line.through(np.array(self._blocks.balance[first : first + length]), end)

    def _look(self, noise_sd_k: float) -> None:
        """Hold the last blocks against the lines; begin to measure where they are far off."""
        suspicious = None
        for gap, usual in self._usual.items():
            past = self._past(gap)
            if past is None:
                continue
            readings, line = past
            deviation_k = self._blocks.balance[-1] - line.at(self._seen)
            limit_k = max(SIGMAS * usual.sd, NOISES * noise_sd_k)
            if usual.count < BASE * BLOCKS:
                limit_k *= FRESH_TIMES
            if usual.count >= FRESH * BLOCKS and abs(deviation_k) > limit_k:
                if suspicious is None:
                    suspicious = _Event(line, float(readings.mean()), self._usual[1].sd)
            else:
                usual.after(deviation_k)
        self._suspect = self._suspect + 1 if suspicious else 0
        if suspicious is not None and self._suspect >= 2 and not self._gain_is_wrong(suspicious):
            self._event = suspicious

    def _gain_is_wrong(self, event: _Event) -> bool:
        """Return whether the reading followed the heater, only by too much or too little."""
        blocks = min(self._seen - event.line.end, len(self._blocks.t_s) - 1)
        risen_k = self._blocks.reading_c[-1] - event.before_c
        loss_k = -event.line.slope * blocks
        given_k = self._blocks.given[-1] - self._blocks.given[-1 - blocks] - loss_k
        return given_k != 0.0 and GAIN_LOW < risen_k / given_k < GAIN_HIGH

    # -- measuring -------------------------------------------------------------------------------

    def _measure(self, event: _Event) -> Found | None:
        """Return what the event amounts to, once that can be said."""
        event.deviations_k.append(self._blocks.balance[-1] - event.line.at(self._seen))
        age = len(event.deviations_k)
        if age < BLOCKS:
            return None
        last = np.array(event.deviations_k[-BLOCKS:])
        slope = float(np.polyfit(np.arange(BLOCKS), last, 1)[0])
        if abs(slope) * BLOCKS < FLAT * abs(last.mean()) + FLAT_USUAL * event.usual_k:
            return self._ended(self._step(event, last))
        if age < LASTING * BLOCKS:
            return None
        whole = np.array(event.deviations_k[-(LASTING - 1) * BLOCKS :])
        grown = float(np.polyfit(np.arange(len(whole)), whole, 1)[0]) * len(whole)
        if abs(grown) < SLOPING * abs(whole.mean()):
            return self._ended(self._step(event, whole))
        return self._ended(self._slope(event, whole))

    def _ended(self, found: Found | None) -> Found | None:
        self.forget()
        return found

    def _time_of(self, block: float) -> float:
        """Return the time at which the block of this number began."""
        return self._blocks.t_s[-1] - (self._seen - block) * self._block_s

    def _step(self, event: _Event, last: Array) -> Found:
        step_k = float(last.mean())
        end = self._seen - len(event.deviations_k) + 1
        begin = self._onset(event, end)
        sd_k = math.hypot(event.usual_k, 0.05 * step_k)
        return Found(begin, event.before_c, step_k, sd_k)

    def _onset(self, event: _Event, end: int) -> float:
        """Return when the balance left the line for good, before the block `end`."""
        limit_k = 3.0 * event.usual_k
        block = end
        while block > event.line.end:
            index = len(self._blocks.t_s) - 1 - (self._seen - block)
            if index < 0 or abs(self._blocks.balance[index] - event.line.at(block)) < limit_k:
                break
            block -= 1
        return self._time_of(block + 1) - FELT * self.lag_s

    def _slope(self, event: _Event, whole: Array) -> Found:
        slope, level = np.polyfit(np.arange(len(whole)) - (len(whole) - 1), whole, 1)
        begin = self._time_of(self._seen - float(level / slope)) - self.lag_s
        length_s = len(whole) * self._block_s
        sd = event.usual_k * math.sqrt(12.0) / length_s
        per_s = float(slope) / self._block_s
        return Found(
            begin,
            event.before_c,
            slope_k_per_s=per_s,
            slope_sd_k_per_s=math.hypot(sd, 0.05 * per_s),
        )


@dataclass(slots=True)
class _Event:
    """A change under way: the line it left, and how far it has come."""

    line: _Line
    before_c: float
    usual_k: float
    deviations_k: list[float] = field(default_factory=list)
