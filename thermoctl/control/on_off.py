"""Full power below the set point, none above: a thermostat with hysteresis.

Implements section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from thermoctl.ports import Situation
from thermoctl.quantities import is_finite_number
from thermoctl.signals import Beliefs


@dataclass(frozen=True, slots=True)
class OnOff:
    """Switch on half a hysteresis below the set point and off half a one above it.

    Its belief is whether it is on.

    Parameters
    ----------
    hysteresis_k : float
        Width of the band in which nothing is switched, in K; at least 0.

    Raises
    ------
    ValueError
        `hysteresis_k` is negative or not finite.
    """

    hysteresis_k: float = 0.5

    name: ClassVar[str] = "on-off"

    def __post_init__(self) -> None:
        if not is_finite_number(self.hysteresis_k) or self.hysteresis_k < 0.0:
            raise ValueError(f"hysteresis_k must be at least 0, got {self.hysteresis_k!r}")

    def start(self) -> bool:
        """Return that it is off."""
        return False

    def observe(self, belief: bool, situation: Situation) -> bool:
        """Return the belief as it was: only what it decides itself counts."""
        return belief

    def decide(self, belief: bool, situation: Situation) -> tuple[bool, float]:
        """Return whether it is on, and 1 or 0; NaN while the temperature is not known."""
        below_k = situation.setpoint_c - situation.temperature_c
        if not math.isfinite(below_k):
            return belief, math.nan
        if abs(below_k) > 0.5 * self.hysteresis_k:
            belief = below_k > 0.0
        return belief, 1.0 if belief else 0.0

    def beliefs(self, belief: bool, situation: Situation) -> Beliefs:
        """Return nothing: a thermostat believes nothing of its plant."""
        return Beliefs()

    def ride_s(self, belief: bool) -> float:
        """Return 0: without a sensor it cannot steer."""
        return 0.0

    def remarks(self, belief: bool) -> Mapping[str, str]:
        """Return nothing: a thermostat is always itself."""
        return {}
