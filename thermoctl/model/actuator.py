"""Actuator laws: the drive an output takes for a power, and back.

Power and drive are fractions in [0, 1]; 0 is off and 1 is full for every law, and both directions
rise. Whatever is not a number becomes 0, whatever lies outside is limited. The plant applies
`power_from`, the loop applies `drive_for`; the equations stand in `docs/tank.md`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from thermoctl.quantities import clamp, is_finite_number

TWO_PI = 2.0 * math.pi


class ActuatorLaw(Protocol):
    """How a power stage answers its drive; both ways rising, [0, 1] to [0, 1]."""

    def drive_for(self, power: float) -> float:
        """Return the drive that gives `power`; NaN gives 0."""
        ...

    def power_from(self, drive: float) -> float:
        """Return the power that `drive` gives; NaN gives 0."""
        ...


@dataclass(frozen=True, slots=True)
class Linear:
    """A stage that takes power itself, such as a relay with a linear input."""

    def drive_for(self, power: float) -> float:
        """Return the drive that gives `power`."""
        return clamp(power, 0.0, 1.0)

    def power_from(self, drive: float) -> float:
        """Return the power that `drive` gives."""
        return clamp(drive, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class SquareLaw:
    """A stage that sets the voltage of a resistive load: P goes with V squared.

    The drive is the fraction of full voltage, as in the triac module of O21 (0 to 220 V).
    """

    def drive_for(self, power: float) -> float:
        """Return the fraction of full voltage that gives `power`."""
        return math.sqrt(clamp(power, 0.0, 1.0))

    def power_from(self, drive: float) -> float:
        """Return the power at the fraction `drive` of full voltage."""
        return clamp(drive, 0.0, 1.0) ** 2


@dataclass(frozen=True, slots=True)
class PhaseAngle:
    r"""A triac fired late in each half wave of a resistive load.

    .. math:: P/P_0 = 1 - \alpha/\pi + \sin(2\alpha) / (2\pi)

    The drive is the conducting part of the half wave, d = 1 - alpha/pi, so that 0 is off and
    P = d - sin(2 pi d)/(2 pi), which is symmetric: P(1 - d) = 1 - P(d).
    """

    def drive_for(self, power: float) -> float:
        """Return the conducting part of the half wave that gives `power`."""
        p = clamp(power, 0.0, 1.0)
        return self._conduction(p) if p <= 0.5 else 1.0 - self._conduction(1.0 - p)

    def power_from(self, drive: float) -> float:
        """Return the power when the part `drive` of every half wave conducts."""
        d = clamp(drive, 0.0, 1.0)
        # At d = 0 and 1 the sine is not exactly zero; off must be off.
        return clamp(d - math.sin(TWO_PI * d) / TWO_PI, 0.0, 1.0) if 0.0 < d < 1.0 else d

    @staticmethod
    def _conduction(p: float) -> float:
        """Solve d - sin(2 pi d)/(2 pi) = p for d, where 0 <= p <= 1/2."""
        # The first term of the series starts below the root of a convex function, so the
        # first Newton step lands above it and the rest fall towards it.
        d = math.cbrt(1.5 * p / math.pi**2)
        if d < 1e-3:  # the next term is 2e-6 of this one, and the slope fades to zero
            return d
        for _ in range(5):
            excess = d - math.sin(TWO_PI * d) / TWO_PI - p
            d -= excess / (1.0 - math.cos(TWO_PI * d))
        return d


@dataclass(frozen=True, slots=True)
class WholeCycleBurst:
    """A relay that passes `k` of every `cycles` mains cycles, each whole.

    Parameters
    ----------
    cycles : int
        Length of the pattern; the power has `cycles` + 1 values. At least 1.

    Raises
    ------
    ValueError
        When `cycles` is not a whole number of at least 1.
    """

    cycles: int = 50

    def __post_init__(self) -> None:
        whole = is_finite_number(self.cycles) and self.cycles == int(self.cycles)
        if not (whole and self.cycles >= 1):
            raise ValueError(f"cycles must be a whole number of at least 1, got {self.cycles!r}")

    def drive_for(self, power: float) -> float:
        """Return the nearest fraction of whole cycles to `power`."""
        return self._quantise(power)

    def power_from(self, drive: float) -> float:
        """Return the fraction of cycles that `drive` lets pass."""
        return self._quantise(drive)

    def _quantise(self, fraction: float) -> float:
        """Return the nearest multiple of 1/cycles; halves round up, as the pattern generator."""
        return math.floor(clamp(fraction, 0.0, 1.0) * self.cycles + 0.5) / self.cycles
