"""What is believed of the gain of a plant and of what it loses; see `heat_loss`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from thermoctl.filling import quickly_filled

T, BETA, D, K, G = range(5)
Row = tuple[float, ...]
"""A number for each of the five."""

SIGN_SDS = 1.5
"""Standard deviations from 0 beyond which the direction of the gain is known."""
WARMS_AT_MOST_K = 500.0
"""Largest rise in K above rest that full power holds; it bounds the slope from below."""
R_FIRST = 4e-4
"""Variance in K² of the mean reading of a stretch, before there was one."""


@quickly_filled
@dataclass(frozen=True, slots=True, eq=False)
class HeatBelief:
    """What is believed of gain and loss.

    Plain numbers: for so few of them arrays take twice as long.

    Parameters
    ----------
    x : tuple of float
        Mean of T in degC, beta and d in K/s, k and g in 1/s.
    P : tuple of tuple of float
        Their covariance, row by row.
    centre_c : float
        Temperature of which d is the loss.
    wall_c : float
        Temperature of what follows more slowly.
    stretches : int
        How many had a reading.
    R : float
        Variance of a mean reading in K².
    before_c : tuple of float
        The last two mean readings.
    jumps : float
        Stretches that ended where the plant could not be, as far as they are not forgiven.
    scaled : bool
        Whether the plant's own rate has taken the place of `START_SD`.
    """

    x: Row
    P: tuple[Row, ...]
    centre_c: float
    wall_c: float
    stretches: int = 0
    R: float = R_FIRST
    before_c: tuple[float, float] = (math.nan, math.nan)
    jumps: float = 0.0
    scaled: bool = False

    @property
    def finite(self) -> bool:
        """Whether every number of mean and covariance is finite."""
        return math.isfinite(sum(self.x) + sum(map(sum, self.P)))

    @property
    def gain(self) -> float:
        """Heating rate at full power in K/s; negative where power cools."""
        return self.x[BETA]

    @property
    def gain_known(self) -> bool:
        """Whether it is certain that power does something, and in which direction."""
        return abs(self.gain) > SIGN_SDS * math.sqrt(self.P[BETA][BETA])

    @property
    def ahead_k(self) -> float:
        """How far the plant is ahead of its walls."""
        return self.x[T] - self.wall_c

    @property
    def slope(self) -> float:
        """Slope of the loss in 1/s, at least what `WARMS_AT_MOST_K` allows."""
        return max(self.x[K], abs(self.gain) / WARMS_AT_MOST_K)

    @property
    def soaks(self) -> float:
        """Rate in 1/s at which walls take up heat; one that gives it off is none."""
        return max(self.x[G], 0.0)
