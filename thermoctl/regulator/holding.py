"""The power that has been holding the set point, whatever asked for it."""

from __future__ import annotations

import math
from typing import NamedTuple

NEAR_K = 0.5
"""Distance in K from the set point within which the plant is being held."""
KNOWN_AFTER_S = 60.0
MEMORY_S = 120.0


class Holding(NamedTuple):
    """Mean of the applied power while the plant was held without a break.

    Parameters
    ----------
    power : float
        The mean, a fraction in [0, 1].
    held_s : float
        For how long the plant has been held.
    """

    power: float = 0.0
    held_s: float = 0.0

    def after(self, deviation_k: float, applied: float, interval_s: float) -> Holding:
        """Return the mean after `applied` for `interval_s`; NaN deviation: no sample."""
        if math.isnan(deviation_k):
            return self
        if abs(deviation_k) > NEAR_K:
            return Holding()
        power, held_s = self
        held_s += interval_s
        share = interval_s / (held_s if held_s < MEMORY_S else MEMORY_S)
        share = 1.0 if share > 1.0 else share
        return Holding(power + share * (applied - power), held_s)

    @property
    def known(self) -> float | None:
        """The holding power, None until the plant has been held for a minute."""
        return self.power if self.held_s >= KNOWN_AFTER_S else None
