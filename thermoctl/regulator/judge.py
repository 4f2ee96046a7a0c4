"""Judges a measurement before anybody acts on it.

The verdict is about the reading, not yet about the heater: what follows from it is the
supervisor's business (`thermoctl.regulator.supervisor`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from thermoctl.quantities import is_finite_number
from thermoctl.regulator.limits import Limits
from thermoctl.signals import Measurement, Quality

_STEP_MEMORY = 0.05  # weight of the newest step: some twenty samples
_STEP_FACTOR = 8.0  # a step this many times the usual one is an outlier
_STEP_CLIP = 4.0  # and counts no more than so many thresholds when the usual step is learnt


class Verdict(StrEnum):
    """What a reading is worth."""

    GOOD = "good"
    SPIKE = "spike"
    MISSING = "missing"
    OPEN = "open"
    SHORT = "short"
    OVER = "over"
    UNDER = "under"


@dataclass(frozen=True, slots=True)
class Judged:
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
    usual_step_k : float
        Running mean of the distance between neighbouring readings.
    """

    verdict: Verdict = Verdict.MISSING
    last_good_c: float = math.nan
    suspect_c: float = math.nan
    outliers: int = 0
    usual_step_k: float = 0.0


def judge(memory: Judged, measurement: Measurement, limits: Limits) -> Judged:
    """Return the verdict on `measurement`, with the memory for the next one.

    An outlier is believed when it repeats: after two in a row, a third that agrees with the one
    before it means that the water has jumped, as it does when a jug of cold water goes in.
    """
    circuit = _CIRCUIT.get(measurement.quality)
    if circuit is not None:
        return replace(memory, verdict=circuit)
    temperature_c = measurement.temperature_c
    if not is_finite_number(temperature_c):
        return replace(memory, verdict=Verdict.MISSING)
    # Too hot is believed at once, from a stale reading as well: it only ever costs heat.
    if temperature_c > limits.trip_above_c:
        return replace(memory, verdict=Verdict.OVER)
    if measurement.quality is not Quality.GOOD:
        return replace(memory, verdict=Verdict.MISSING)
    judged = _judge_step(memory, temperature_c, limits)
    if judged.verdict is Verdict.GOOD and temperature_c < limits.trip_below_c:
        return replace(judged, verdict=Verdict.UNDER)
    return judged


_CIRCUIT = {Quality.OPEN: Verdict.OPEN, Quality.SHORT: Verdict.SHORT}


def _judge_step(memory: Judged, temperature_c: float, limits: Limits) -> Judged:
    if math.isnan(memory.last_good_c):
        return Judged(Verdict.GOOD, last_good_c=temperature_c)
    threshold_k = max(limits.jump_k, _STEP_FACTOR * memory.usual_step_k)
    step_k = abs(temperature_c - memory.last_good_c)
    learnt_k = min(step_k, _STEP_CLIP * threshold_k)
    usual_step_k = memory.usual_step_k + _STEP_MEMORY * (learnt_k - memory.usual_step_k)
    repeated = (
        memory.outliers >= limits.OUTLIERS and abs(temperature_c - memory.suspect_c) <= threshold_k
    )
    if step_k <= threshold_k or repeated:
        return Judged(Verdict.GOOD, temperature_c, usual_step_k=usual_step_k)
    return Judged(
        Verdict.SPIKE, memory.last_good_c, temperature_c, memory.outliers + 1, usual_step_k
    )
