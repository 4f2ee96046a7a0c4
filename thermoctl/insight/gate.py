"""Whether there is anything to learn, as a word that does not flicker."""

from __future__ import annotations

import math

from thermoctl.insight.values import Gate
from thermoctl.signals import PlantBelief

LINGERS_S = 30.0
"""Time in s for which learning is reported after a sample that taught something."""

HELD_LAGS = 5.0
"""Time after a jump in lags in which nothing counts as evidence; the bank keeps the same."""


class GateWatch:
    """Follows what the samples were worth."""

    def __init__(self) -> None:
        self._learnt_s = self._held_s = -math.inf

    def after(self, t_s: float, plant: PlantBelief) -> Gate:
        """Return the word after a sample at `t_s`."""
        if plant.jumped:
            self._held_s = t_s + HELD_LAGS * plant.lag_s
        if plant.learning:
            self._learnt_s = t_s
        if t_s < self._held_s:
            return Gate.HELD
        if self._learnt_s == -math.inf:
            return Gate.UNKNOWN
        return Gate.LEARNING if t_s - self._learnt_s < LINGERS_S else Gate.PAUSED
