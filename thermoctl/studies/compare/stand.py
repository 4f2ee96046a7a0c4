"""What a regulator is wired to: a simulated plant, its sensor, its power stage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from numpy.random import Generator

from thermoctl.model.actuator import ActuatorLaw, Linear, SquareLaw
from thermoctl.model.sensor import LM335, TMP36, Conversion
from thermoctl.plant.disturbances import disturb
from thermoctl.plant.lab import LabParameters, TemperatureLab
from thermoctl.plant.tank import Tank
from thermoctl.studies.compare.plants import Plant

SECOND_HEATER = "second-heater"
"""What befalls a lab: its second heater goes to the power that is the amount."""

_TWELVE_BITS, _EIGHT_BITS = 2**12 - 1, 2**8 - 1


class Simulated(Protocol):
    """A plant that a drive goes into, judged by its temperature."""

    @property
    def temperature_c(self) -> float:
        """The true temperature."""
        ...

    def advance(self, interval_s: float, drive: float) -> None:
        """Let `interval_s` pass at `drive`."""
        ...


@dataclass(frozen=True, slots=True)
class Stand:
    """A plant and what is between it and a regulator.

    Parameters
    ----------
    plant : Simulated
        The plant.
    volts : callable
        Returns the voltage of its sensor, NaN when there is none.
    curve : Conversion
        What that voltage means.
    law : ActuatorLaw
        How its power stage answers a drive.
    drive_steps : int
        Steps of what sets the drive.
    befall : callable
        Does to the plant what a name and an amount say; raises `ValueError` where that cannot be.
    """

    plant: Simulated
    volts: Callable[[], float]
    curve: Conversion
    law: ActuatorLaw
    drive_steps: int
    befall: Callable[[str, float | None], object]


def stand_for(plant: Plant, rng: Generator) -> Stand:
    """Return `plant` built anew, its randomness from `rng`."""
    if isinstance(plant.parameters, LabParameters):
        lab = TemperatureLab(plant.parameters, rng)
        return Stand(lab, lab.volts, TMP36, Linear(), _EIGHT_BITS, partial(_befall, lab))
    law = SquareLaw()
    tank = Tank(plant.parameters, rng, law)
    return Stand(tank, tank.probe.volts, LM335, law, _TWELVE_BITS, partial(disturb, tank))


def _befall(lab: TemperatureLab, name: str, amount: float | None) -> None:
    """Set the second heater, which is all that can be done to a lab."""
    if name != SECOND_HEATER or amount is None:
        raise ValueError(f"expected {SECOND_HEATER} and a power, got {name!r} and {amount!r}")
    lab.second_heater(amount)
