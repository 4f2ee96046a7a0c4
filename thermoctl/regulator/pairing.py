"""Two sensors on one plant: what they show together, and whether they agree.

While they agree the mean of both is the reading; once they do not, the hotter one is, and the
colder one where the only actuator cools. Trips look at both, from the first sample on.

How far apart two healthy sensors may be depends on what the water does: the slower one lags.
A first-order lag shorter than `LAG_S` keeps its reading between two followers of the faster
reading, one that falls at once and rises with `LAG_S`, and one that does the opposite. Their
distance from the reading is therefore allowed on top of the limit (`Trace.moved_k`), and neither a
warm-up nor a jug of cold water looks like a sensor that drifts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from thermoctl.quantities import is_finite_number
from thermoctl.regulator.alarms import AlarmRegister
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.supervisor import Emit
from thermoctl.signals import Alarm, Measurement, Quality

LAG_S = 30.0
"""Largest difference in s between the lags of two healthy sensors."""
APART_S, APART_SAMPLES = 10.0, 3
"""Time in s for which they have to disagree, and number of samples in a slow loop."""
LOST_S = 5.0
"""Time in s without a reading after which a sensor is reported; open or shorted, it is at once."""
_NAMES = ("first", "second")
_WORST_FIRST = (Quality.OPEN, Quality.SHORT, Quality.STALE)
_FAULTS = {Quality.OPEN: 1, Quality.SHORT: 2}
_NO_READING = 16


def is_good(measurement: Measurement) -> bool:
    """Return whether `measurement` is a temperature to act on."""
    return measurement.quality is Quality.GOOD and is_finite_number(measurement.temperature_c)


@dataclass(frozen=True, slots=True)
class Trace:
    """What is remembered of one sensor.

    Parameters
    ----------
    last_c : float
        Its last good reading, NaN before the first.
    gap_s : float
        Time since that reading.
    above_k, below_k : float
        How far the slow followers of its readings lie above and below the last one.
    lost_s : float
        Time without a reading that was not paid back yet, at most `LOST_S`.
    lost : bool
        Whether it counts as lost.
    """

    last_c: float = math.nan
    gap_s: float = 0.0
    above_k: float = 0.0
    below_k: float = 0.0
    lost_s: float = 0.0
    lost: bool = False

    @property
    def moved_k(self) -> float:
        """How far from its last reading a healthy slower sensor may be, in K."""
        return max(self.above_k, self.below_k)

    def after(self, measurement: Measurement, interval_s: float) -> Trace:
        """Return the trace after `measurement`, `interval_s` after the one before."""
        gap_s = self.gap_s + interval_s
        if not is_good(measurement):
            broken = measurement.quality in _FAULTS
            lost_s = LOST_S if broken else min(self.lost_s + interval_s, LOST_S)
            return replace(self, gap_s=gap_s, lost_s=lost_s, lost=self.lost or lost_s >= LOST_S)
        reading_c = float(measurement.temperature_c)
        lost_s = max(self.lost_s - interval_s, 0.0)
        lost = self.lost and lost_s > 0.0
        if math.isnan(self.last_c):
            return Trace(reading_c, lost_s=lost_s, lost=lost)
        # The exact answer of a first-order lag to a straight line between two readings.
        decay = math.exp(-gap_s / LAG_S)
        behind_k = (reading_c - self.last_c) * LAG_S / gap_s * (1.0 - decay)
        above_k = max(self.above_k * decay - behind_k, 0.0)
        below_k = max(self.below_k * decay + behind_k, 0.0)
        return Trace(reading_c, 0.0, above_k, below_k, lost_s, lost)


@dataclass(frozen=True, slots=True)
class Pair:
    """What is remembered of two sensors.

    Parameters
    ----------
    first, second : Trace
        Each of them.
    apart_s : float
        For how long they have been too far apart, less the time that they were not.
    disagree : bool
        Whether they count as disagreeing.
    """

    first: Trace = Trace()
    second: Trace = Trace()
    apart_s: float = 0.0
    disagree: bool = False

    @property
    def moved_k(self) -> float:
        """Largest difference in K that their lags explain, whichever is the slower."""
        return max(self.first.moved_k, self.second.moved_k)

    @property
    def shared_k(self) -> float:
        """Move in K that both of them share: next to nothing where one jumps alone."""
        return min(self.first.moved_k, self.second.moved_k)


@dataclass(frozen=True, slots=True)
class Agreement:
    """The law of two sensors; every method returns the same when they change places.

    Parameters
    ----------
    disagreement_k : float
        How far apart they may be at rest, in K.
    patience_s : float
        For how long they may be farther apart before they count as disagreeing.
    colder_counts : bool
        Whether the colder of two that disagree is the one to go by: where power only cools.

    Raises
    ------
    ValueError
        A number is not positive and finite.
    """

    disagreement_k: float = 1.0
    patience_s: float = APART_S
    colder_counts: bool = False

    def __post_init__(self) -> None:
        for name in ("disagreement_k", "patience_s"):
            value = getattr(self, name)
            if not (is_finite_number(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value!r}")

    def allowed_k(self, pair: Pair) -> float:
        """Return how far apart the two may be just now.

        To agree again they must come to half the limit, whatever their lags explain.
        """
        if pair.disagree:
            return 0.5 * self.disagreement_k
        return self.disagreement_k + pair.moved_k

    def after(self, pair: Pair, first: Measurement, second: Measurement, interval_s: float) -> Pair:
        """Return what is remembered after one sample of both.

        As long as one of them is lost nothing can be compared: who disagreed goes on doing so.
        """
        traces = pair.first.after(first, interval_s), pair.second.after(second, interval_s)
        pair = Pair(*traces, pair.apart_s, pair.disagree)
        if not (is_good(first) and is_good(second)):
            return pair
        apart_k = abs(first.temperature_c - second.temperature_c)
        sign = 1.0 if apart_k > self.allowed_k(pair) else -1.0
        apart_s = min(max(pair.apart_s + sign * interval_s, 0.0), self.patience_s)
        disagree = apart_s > 0.0 if pair.disagree else apart_s >= self.patience_s
        return replace(pair, apart_s=apart_s, disagree=disagree)

    def reading(self, pair: Pair, first: Measurement, second: Measurement) -> Measurement:
        """Return what the two show together, `pair` being what is remembered with them.

        One that is good goes on alone. While two are too far apart, but not yet for long, the
        reading lies no farther from the safe one than where they agree: one that jumps or spikes by
        itself hardly moves it, and nothing hot is averaged away.
        """
        both = (first, second)
        good = [each for each in both if is_good(each)]
        shown_c = [
            float(each.temperature_c) for each in both if is_finite_number(each.temperature_c)
        ]
        ends_c = (min(shown_c), max(shown_c)) if shown_c else None
        t_s = max(
            (each.t_s for each in good or both if is_finite_number(each.t_s)), default=math.nan
        )
        if not good:
            worst = (each for each in _WORST_FIRST if each in (first.quality, second.quality))
            quality = next(worst, Quality.MISSING)
            old = quality is Quality.STALE and bool(shown_c)
            return Measurement(t_s, self._safe(shown_c) if old else math.nan, quality, ends_c)
        readings_c = [float(each.temperature_c) for each in good]
        return Measurement(t_s, self._together(pair, readings_c), Quality.GOOD, ends_c)

    def _safe(self, shown_c: list[float]) -> float:
        """Return the one to go by when they disagree."""
        return min(shown_c) if self.colder_counts else max(shown_c)

    def _together(self, pair: Pair, readings_c: list[float]) -> float:
        """Return one temperature for one good reading or two."""
        safe_c = self._safe(readings_c)
        if len(readings_c) < 2 or pair.disagree:
            return safe_c
        mean_c = 0.5 * (readings_c[0] + readings_c[1])
        most_k = 0.5 * (self.disagreement_k + pair.shared_k)
        return min(mean_c, safe_c + most_k) if self.colder_counts else max(mean_c, safe_c - most_k)


class Pairing:
    """Takes two sensors for one; tells when one is lost, or they disagree.

    Parameters
    ----------
    limits : Limits
        Those of the loop.
    disagreement_k : float
        How far apart the two may be at rest, in K.
    alarms : AlarmRegister
        Where alarms are raised.
    emit : callable
        Called as ``emit(name, **fields)`` when one begins.
    """

    def __init__(
        self, limits: Limits, disagreement_k: float, alarms: AlarmRegister, emit: Emit
    ) -> None:
        patience_s = max(APART_S, APART_SAMPLES * limits.period_s)
        self.law = Agreement(disagreement_k, patience_s, limits.power_cools)
        self.pair = Pair()
        self._limits, self._alarms, self._emit = limits, alarms, emit
        self._t_s = -math.inf

    def fuse(self, first: Measurement, second: Measurement) -> Measurement:
        """Return what the two show together; alarms are raised and cleared on the way."""
        t_s, interval_s = self._time(first, second)
        self.pair = self.law.after(self.pair, first, second, interval_s)
        for code, fault, text in self._doubts(first, second):
            if not text:
                self._alarms.clear(code)
            elif self._alarms.set(Alarm(code, fault, 2, t_s, text)):
                self._emit(code, text=text)
        return self.law.reading(self.pair, first, second)

    def _time(self, first: Measurement, second: Measurement) -> tuple[float, float]:
        """Return the time of these samples, and what they answer for; it never stands still."""
        times_s = [each.t_s for each in (first, second) if is_finite_number(each.t_s)]
        before_s, period_s = self._t_s, self._limits.period_s
        t_s = max(times_s, default=math.nan)
        if not t_s > before_s:
            t_s = before_s + period_s
        self._t_s = t_s if math.isfinite(t_s) else 0.0
        interval_s = self._limits.seen_s(t_s - before_s)
        return self._t_s, interval_s if 0.0 < interval_s < math.inf else period_s

    def _doubts(self, first: Measurement, second: Measurement) -> Iterator[tuple[str, int, str]]:
        """Yield code, fault number and text of every alarm; no text: it is over."""
        pair, both = self.pair, (first, second)
        for which, trace in enumerate((pair.first, pair.second)):
            seen, other = both[which], both[1 - which]
            text = f"expected a reading of the {_NAMES[which]} sensor, it is {seen.quality.value}"
            alone = f"; the {_NAMES[1 - which]} goes on alone" if is_good(other) else ""
            fault = _FAULTS.get(seen.quality, _NO_READING)
            yield f"sensor.{_NAMES[which]}_lost", fault, text + alone if trace.lost else ""
        most_k = self.law.disagreement_k + pair.moved_k
        text = (
            f"expected two sensors within {most_k:.2f} K of each other, the "
            f"first shows {pair.first.last_c:.2f} degC, the second {pair.second.last_c:.2f} degC; "
            f"the {'colder' if self.law.colder_counts else 'hotter'} counts"
        )
        yield "sensor.disagree", 7, text if pair.disagree else ""
