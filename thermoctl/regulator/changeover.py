"""Heater and cooler take turns: between the two, both are off."""

from __future__ import annotations

import math
from typing import NamedTuple


class Changeover(NamedTuple):
    """Which of two actuators was on last, and for how long neither has been.

    Parameters
    ----------
    side : float
        1 for the heater, -1 for the cooler, 0 while neither ever was.
    off_s : float
        For how long both have been off.
    """

    side: float = 0.0
    off_s: float = 0.0

    def after(self, taken: float, interval_s: float) -> Changeover:
        """Return this after the signed power `taken` for `interval_s`."""
        if taken != 0.0:
            return Changeover(math.copysign(1.0, taken))
        return Changeover(self.side, self.off_s + interval_s)

    def waits(self, power: float, least_s: float) -> bool:
        """Return whether `power` is the other one's, and has to wait until both were off.

        They are off for at least one command, whatever `least_s`, and one that was taken: so no
        board that answers late, and no second board that is written after the first, ever has one
        on while the other is not off yet.
        """
        turned = power * self.side < 0.0
        return turned and not (self.off_s > 0.0 and self.off_s >= least_s)
