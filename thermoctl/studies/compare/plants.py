"""Fleets: many plants from one seed each, the same for every controller."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from thermoctl.errors import ThermoctlError
from thermoctl.plant import thermal
from thermoctl.plant.acquisition import AcquisitionParameters
from thermoctl.plant.lab import LabParameters, lab_specimen
from thermoctl.plant.parameters import WATER_J_PER_KG_K, TankParameters
from thermoctl.plant.tolerances import specimen
from thermoctl.studies.compare.linear import rest
from thermoctl.studies.compare.scenarios import BAND_K, HELD_C

TOLERANCES = 0.1
"""Spread between specimens of one order: 10 %."""

RIG, LAB = TankParameters(), LabParameters()
"""The plants as they are ordered."""

ACQUISITION = AcquisitionParameters(bits=12)
"""The converter of every tank: bursts of 32 conversions over two mains periods."""

LAB_HELD_C = 50.0
"""Set point of a lab: about half of its power."""

LAB_BAND_K = 0.15
"""A lab has settled within this: ten times what nobody can avoid on it, as for a tank."""

LAB_ACQUISITION = AcquisitionParameters(
    bits=10, reference_v=5.0, conversions=10, burst_s=0.001, noise_v=2e-3, pickup_v=0.0
)
"""That of a lab: ten conversions at once, their mean a multiple of 49 mK that wanders by 77 mK."""

PACE_S = 1200.0
"""What the rig takes to warm up and settle; the scenarios' times are counted in it."""

_MOST_W_PER_L = 1000.0
_MOST_HOLDING = 0.5


class FleetError(ThermoctlError, ValueError):
    """A fleet that does not exist was asked for; the message names those that do."""


@dataclass(frozen=True, slots=True)
class Usage:
    """What whoever has such a plant configures for it, from its data sheet alone.

    Parameters
    ----------
    held_c : float
        Set point that the scenarios begin with.
    setpoint_max_c, trip_above_c : float or None
        Highest set point, and the trip; None: as the configuration has them.
    gain_k_per_s, heater_w : float or None
        Rise at full power, and that power; None: as the configuration has them.
    """

    held_c: float = HELD_C
    setpoint_max_c: float | None = None
    trip_above_c: float | None = None
    gain_k_per_s: float | None = None
    heater_w: float | None = None


@dataclass(frozen=True, slots=True)
class Plant:
    """One member of a fleet.

    Parameters
    ----------
    fleet : str
        The fleet it belongs to.
    seed : int
        Which one it is; equal seeds give equal plants, mains, ice, turbulence and noise.
    parameters : TankParameters or LabParameters
        The tank, or the lab.
    acquisition : AcquisitionParameters
        The converter.
    pace : float
        How many times slower than the rig it warms up and settles, at least 1.
    usage : Usage
        What is configured for it.
    band_k : float
        Settled means within this of the set point.
    """

    fleet: str
    seed: int
    parameters: TankParameters | LabParameters
    acquisition: AcquisitionParameters = ACQUISITION
    pace: float = 1.0
    usage: Usage = Usage()
    band_k: float = BAND_K

    @property
    def held_c(self) -> float:
        """Set point that the scenarios begin with."""
        return self.usage.held_c

    def sources(self) -> tuple[Generator, Generator]:
        """Return the randomness of plant and converter, anew for each run."""
        _, tank, converter = _generators(self.fleet, self.seed)
        return tank, converter


def _generators(fleet: str, seed: int) -> list[Generator]:
    """Return the sources of plant, tank and converter noise."""
    return np.random.default_rng((FLEETS[fleet].number, seed)).spawn(3)


@dataclass(frozen=True, slots=True)
class Fleet:
    """A kind of plants.

    Parameters
    ----------
    number : int
        Keeps the randomness of the fleets apart.
    text : str
        What it is, in a few words.
    scenarios : tuple of str
        What its plants go through.
    draw : callable
        Returns a tank or a lab from a generator.
    paced : bool
        Plants differ so much that each needs a pace of its own.
    acquisition : AcquisitionParameters
        The converter of its plants.
    usage : Usage
        What is configured for all of them alike.
    ordered : TankParameters or LabParameters
        What whoever built them was asked for: all that a baseline's constants may come from.
    band_k : float
        Settled means within this of the set point.
    """

    number: int
    text: str
    scenarios: tuple[str, ...]
    draw: Callable[[Generator], TankParameters | LabParameters]
    paced: bool = True
    acquisition: AcquisitionParameters = ACQUISITION
    usage: Usage = Usage()
    ordered: TankParameters | LabParameters = RIG
    band_k: float = BAND_K


def _rig(rng: Generator) -> TankParameters:
    return specimen(RIG, rng, TOLERANCES)


def _sizes(rng: Generator) -> TankParameters:
    """Return a tank in air, of any size that its heater can hold with half its power."""
    while True:
        volume_l, heater_w = _between(rng, 0.5, 200.0), _between(rng, 50.0, 5000.0)
        tank = TankParameters.scaled(volume_l, heater_w, ice_kg=0.0)
        dense = heater_w > _MOST_W_PER_L * volume_l
        if not dense and rest(tank, HELD_C).power <= _MOST_HOLDING:
            return specimen(tank, rng, TOLERANCES)


def _lags(rng: Generator) -> TankParameters:
    """Return the rig with a slow or quick sensor, and any element."""
    sensor_s, element_s = _between(rng, 1.0, 60.0), _between(rng, 4.0, 45.0)
    lagging = replace(
        RIG,
        element=replace(RIG.element, lag_s=element_s),
        probe=replace(RIG.probe, lag_s=sensor_s),
    )
    return specimen(lagging, rng, TOLERANCES)


def _lab(rng: Generator) -> LabParameters:
    return lab_specimen(LAB, rng, TOLERANCES)


def _between(rng: Generator, low: float, high: float) -> float:
    """Return a number between `low` and `high`, its logarithm uniform."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))


FLEETS: Mapping[str, Fleet] = {
    "rig": Fleet(
        1,
        "the rig of O21, as ten per cent of tolerance make it",
        (
            "warm-up",
            "regulation",
            "step",
            "cold-water",
            "ice",
            "spike-dropout",
            "stirrer-stops",
            "stirrer-back",
            "half-gone",
        ),
        _rig,
        paced=False,
    ),
    "sizes": Fleet(2, "0.5 to 200 l with 50 W to 5 kW, in air", ("warm-up", "regulation"), _sizes),
    "lags": Fleet(
        3,
        "the rig with a sensor of 1 to 60 s and an element of 4 to 45 s",
        ("warm-up", "cold-water"),
        _lags,
    ),
    "tclab": Fleet(
        4,
        "the Temperature Control Lab: 4 g and 1 W a heater, held at 50 °C",
        ("warm-up", "regulation", "step", "second-heater"),
        _lab,
        paced=False,
        acquisition=LAB_ACQUISITION,
        usage=Usage(
            held_c=LAB_HELD_C,
            setpoint_max_c=70.0,
            trip_above_c=80.0,
            gain_k_per_s=0.5,
            heater_w=1.0,
        ),
        ordered=LAB,
        band_k=LAB_BAND_K,
    ),
}
"""Every fleet by name."""


def plant(fleet: str, seed: int) -> Plant:
    """Return the member `seed` of `fleet`.

    Raises
    ------
    FleetError
        When there is no such fleet; it names those that there are.
    """
    if fleet not in FLEETS:
        raise FleetError(f"fleet must be one of {', '.join(FLEETS)}, got {fleet!r}")
    kind = FLEETS[fleet]
    parameters = kind.draw(_generators(fleet, seed)[0])
    pace = 1.0
    if kind.paced and isinstance(parameters, TankParameters):
        pace = _pace(parameters)
    return Plant(fleet, seed, parameters, kind.acquisition, pace, kind.usage, kind.band_k)


def _pace(tank: TankParameters) -> float:
    """Return how many times slower than the rig `tank` is; rounded, and at least 1."""
    lags_s = tank.element.lag_s + tank.probe.lag_s + tank.probe.transport_s
    patience_s = 1.5 * _warm_up_s(tank) + 30.0 * lags_s
    return max(1.0, math.ceil(10.0 * patience_s / PACE_S) / 10.0)


def _warm_up_s(tank: TankParameters) -> float:
    """Return about how long full power takes to the set point, at the loss that is there."""
    k = thermal.conductances(tank)
    water_j_per_k = tank.vessel.water_kg * WATER_J_PER_KG_K
    stored_j = (HELD_C - tank.initial_c) * (water_j_per_k + k.wall_j_per_k + k.element_j_per_k)
    return stored_j / tank.element.rated_w / (1.0 - rest(tank, HELD_C).power)
