"""A fixed power, for a loop that is to be steered by hand or by another program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from thermoctl.ports import Situation
from thermoctl.quantities import is_finite_number
from thermoctl.signals import Beliefs


@dataclass(frozen=True, slots=True)
class Manual:
    """Ask for the same power at every sample, whatever the temperature.

    Parameters
    ----------
    power : float
        Fraction in [0, 1]; 0 unless it is given.

    Raises
    ------
    ValueError
        `power` is outside [0, 1].
    """

    power: float = 0.0

    name: ClassVar[str] = "manual"

    def __post_init__(self) -> None:
        if not is_finite_number(self.power) or not 0.0 <= self.power <= 1.0:
            raise ValueError(f"power must lie in [0, 1], got {self.power!r}")

    def start(self) -> None:
        """Return None: there is nothing to remember."""

    def observe(self, belief: None, situation: Situation) -> None:
        """Return None: no sample matters."""

    def decide(self, belief: None, situation: Situation) -> tuple[None, float]:
        """Return the fixed power."""
        return None, self.power

    def beliefs(self, belief: None, situation: Situation) -> Beliefs:
        """Return nothing: a fixed power believes nothing of its plant."""
        return Beliefs()

    def ride_s(self, belief: None) -> float:
        """Return 0: it does not look at the sensor and so does not steer without one."""
        return 0.0

    def remarks(self, belief: None) -> Mapping[str, str]:
        """Return nothing: a fixed power has nothing to remark."""
        return {}
