"""Judges a measurement before anybody acts on it.

The verdict is about the reading, not yet about the heater: what follows from it is the
supervisor's business (`thermoctl.regulator.supervisor`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple

from thermoctl.quantities import is_finite_number
from thermoctl.regulator.limits import Limits
from thermoctl.signals import Measurement, Quality

_STEPS = 24  # steps between readings that are remembered
_STEP_FACTOR = 16.0  # five standard deviations of a step, were the noise normal
_THRESHOLDS_MAX = 20.0  # noise widens the threshold to this many `Limits.jump_k` at most


class Verdict(StrEnum):
    """What a reading is worth."""

    GOOD = "good"
    SPIKE = "spike"
    MISSING = "missing"
    OPEN = "open"
    SHORT = "short"
    OVER = "over"
    UNDER = "under"


class Judged(NamedTuple):
    """A verdict, and what the judge has to remember for the next one.

    Parameters
    ----------
    verdict : Verdict
        What the reading is worth.
    last_good_c : float
        The last reading that was believed, NaN before the first.
    suspect_c : float
        The last outlier, NaN when there is none.
    outliers : int
        Outliers in a row.
    steps_k : tuple of float
        Distance from the last good reading of the latest readings, oldest first.
    """

    verdict: Verdict = Verdict.MISSING
    last_good_c: float = math.nan
    suspect_c: float = math.nan
    outliers: int = 0
    steps_k: tuple[float, ...] = ()

    @property
    def usual_step_k(self) -> float:
        """Lower quartile of the latest steps: spikes leave it alone, noise moves it.

        A mean would be drawn along by spikes until they were usual themselves.
        """
        return sorted(self.steps_k)[len(self.steps_k) // 4] if self.steps_k else 0.0


def judge(
    memory: Judged,
    measurement: Measurement,
    limits: Limits,
    jump_k: Callable[[], float] | None = None,
) -> Judged:
    """Return the verdict on `measurement`, with the memory for the next one.

    `jump_k` returns the jump that the plant could make, that of `limits` when not given; it is
    asked where a reading lies farther off than that.

    An outlier is believed when it repeats: after two in a row, a third that agrees with the one
    before it means that the water has jumped, as it does when a jug of cold water goes in.
    """
    quality = measurement.quality  # a plug-in's may be anything, even what has no hash
    good = quality is Quality.GOOD
    circuit = _CIRCUIT.get(quality) if not good and isinstance(quality, str) else None
    if circuit is not None:
        return memory._replace(verdict=circuit)
    temperature_c = measurement.temperature_c
    if not is_finite_number(temperature_c):
        return memory._replace(verdict=Verdict.MISSING)
    over_c, under_c = farthest(measurement, limits)
    over, under = over_c > limits.trip_above_c, under_c < limits.trip_below_c
    # Too hot is believed at once, from a stale reading as well: it only ever costs heat. So is too
    # cold where something cools.
    if over and limits.can_heat:
        return memory._replace(verdict=Verdict.OVER)
    if under and limits.can_cool:
        return memory._replace(verdict=Verdict.UNDER)
    if not good:
        return memory._replace(verdict=Verdict.MISSING)
    judged = _judge_step(memory, temperature_c, limits, jump_k)
    if (over or under) and judged.verdict is Verdict.GOOD:
        return judged._replace(verdict=Verdict.OVER if over else Verdict.UNDER)
    return judged


def farthest(measurement: Measurement, limits: Limits) -> tuple[float, float]:
    """Return the readings, in degC, to hold against the upper and the lower trip.

    Of two sensors the hotter where something heats, and the colder where something cools; else
    what is controlled by, for the other one may drift where no actuator could bring the plant.
    """
    shown_c = measurement.temperature_c
    if not measurement.ends_c:
        return shown_c, shown_c
    cold_c, hot_c = measurement.ends_c
    return hot_c if limits.can_heat else shown_c, cold_c if limits.can_cool else shown_c


_CIRCUIT = {Quality.OPEN: Verdict.OPEN, Quality.SHORT: Verdict.SHORT}


def _judge_step(
    memory: Judged, temperature_c: float, limits: Limits, jump_k: Callable[[], float] | None
) -> Judged:
    if math.isnan(memory.last_good_c):
        return Judged(Verdict.GOOD, last_good_c=temperature_c)
    step_k = abs(temperature_c - memory.last_good_c)
    steps_k = (*memory.steps_k[1 - _STEPS :], step_k)
    if step_k <= limits.jump_k:  # nearly always, and no threshold is lower
        return Judged(Verdict.GOOD, temperature_c, math.nan, 0, steps_k)
    widened_k = min(_STEP_FACTOR * memory.usual_step_k, _THRESHOLDS_MAX * limits.jump_k)
    threshold_k = max(limits.jump_k if jump_k is None else jump_k(), widened_k)
    repeated = (
        memory.outliers >= limits.OUTLIERS and abs(temperature_c - memory.suspect_c) <= threshold_k
    )
    if step_k <= threshold_k or repeated:
        return Judged(Verdict.GOOD, temperature_c, math.nan, 0, steps_k)
    return Judged(Verdict.SPIKE, memory.last_good_c, temperature_c, memory.outliers + 1, steps_k)
