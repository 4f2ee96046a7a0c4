"""Full power on one side of the set point, none beyond: a thermostat.

Implements section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from thermoctl.ports import Situation
from thermoctl.quantities import is_finite_number
from thermoctl.signals import Beliefs


@dataclass(frozen=True, slots=True)
class OnOff:
    """Switch on half a hysteresis below the set point and off half a one above it.

    One that cools switches on above and off below. Its belief is whether it is on.

    Parameters
    ----------
    hysteresis_k : float
        Width of the band in which nothing is switched, in K; at least 0.
    action : {'heat', 'cool'}
        What power does to the plant.

    Raises
    ------
    ValueError
        `hysteresis_k` is negative or not finite, or there is no such `action`.
    """

    hysteresis_k: float = 0.5
    action: Literal["heat", "cool"] = "heat"

    name: ClassVar[str] = "on-off"

    def __post_init__(self) -> None:
        if not is_finite_number(self.hysteresis_k) or self.hysteresis_k < 0.0:
            raise ValueError(f"hysteresis_k must be at least 0, got {self.hysteresis_k!r}")
        if self.action not in ("heat", "cool"):
            raise ValueError(f"action must be 'heat' or 'cool', got {self.action!r}")

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
            belief = (below_k > 0.0) is (self.action == "heat")
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
