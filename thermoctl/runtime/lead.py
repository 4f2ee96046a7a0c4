"""A power that is the set point of another loop."""

from __future__ import annotations

import math
from dataclasses import dataclass

from thermoctl.quantities import clamp
from thermoctl.signals import Measurement, Quality


@dataclass(frozen=True, slots=True)
class Lead:
    """What an outer loop does with its power: it gives an inner loop its set point.

    Parameters
    ----------
    inner : str
        Name of the loop that follows.
    low_c, high_c : float
        Its set points at power 0 and 1, in degC.
    """

    inner: str
    low_c: float
    high_c: float

    def setpoint_c(self, power: float) -> float:
        """Return the set point that `power`, a fraction in [0, 1], stands for."""
        return self.low_c + power * (self.high_c - self.low_c)

    def power_at(self, temperature_c: float) -> float:
        """Return the power that a block so warm gives, in [0, 1]; NaN: not known."""
        if not math.isfinite(temperature_c):
            return math.nan
        return clamp((temperature_c - self.low_c) / (self.high_c - self.low_c), 0.0, 1.0)

    def taken(self, outer: Measurement, inner: Measurement) -> float:
        """Return the power that the inner loop really gives, whatever it was told.

        A block that cannot be read gets no power, so it is taken to be as warm as what it heats.
        """
        read = inner if inner.quality is Quality.GOOD else outer
        return self.power_at(read.temperature_c if read.quality is Quality.GOOD else math.nan)
