"""What is to be held, as a balance of heat is asked about it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from thermoctl.signals import Mode

BEYOND_K = 0.5
"""Distance in K beyond the set point from which on a plant is driven, and distance of a set point
beyond the ceiling from which on it is out of reach. Less is regulation."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is to be held, in `mode`: a set point in degC, with at most `power_max`.

    `ramp_s` is how long the reference is still on its way there; `power_cools` says what power does
    where it is wired as it should be. `led`: it is another loop that wants it, and never all of it
    at once: nothing is told of such a set point. `ceiling_c` is what the plant was seen to come to,
    and not to pass for all its power.
    """

    setpoint_c: float
    power_max: float
    mode: Mode
    ramp_s: float = 0.0
    power_cools: bool = False
    led: bool = False
    ceiling_c: float = math.nan

    @property
    def counts(self) -> bool:
        """Whether anybody is told that it cannot be held."""
        return self.mode is Mode.AUTO and not self.led

    @property
    def beyond_ceiling(self) -> bool:
        """Whether the plant has been seen not to come near the set point."""
        beyond_k = self.setpoint_c - self.ceiling_c
        return (-beyond_k if self.power_cools else beyond_k) > BEYOND_K
