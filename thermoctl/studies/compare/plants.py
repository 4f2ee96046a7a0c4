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
from thermoctl.plant.parameters import WATER_J_PER_KG_K, TankParameters
from thermoctl.plant.tolerances import specimen
from thermoctl.studies.compare.linear import rest
from thermoctl.studies.compare.scenarios import HELD_C

TOLERANCES = 0.1
"""Spread between specimens of one order: 10 %."""

ACQUISITION = AcquisitionParameters(bits=12)
"""The converter of every plant: bursts of 32 conversions over two mains periods."""

PACE_S = 1200.0
"""What the rig takes to warm up and settle; the scenarios' times are counted in it."""

_MOST_W_PER_L = 1000.0
_MOST_HOLDING = 0.5


class FleetError(ThermoctlError, ValueError):
    """A fleet that does not exist was asked for; the message names those that do."""


@dataclass(frozen=True, slots=True)
class Plant:
    """One member of a fleet.

    Parameters
    ----------
    fleet : str
        The fleet it belongs to.
    seed : int
        Which one it is; equal seeds give equal plants, mains, ice, turbulence and noise.
    parameters : TankParameters
        The tank.
    acquisition : AcquisitionParameters
        The converter.
    pace : float
        How many times slower than the rig it warms up and settles, at least 1.
    """

    fleet: str
    seed: int
    parameters: TankParameters
    acquisition: AcquisitionParameters = ACQUISITION
    pace: float = 1.0

    def sources(self) -> tuple[Generator, Generator]:
        """Return the randomness of tank and converter, anew for each run."""
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
        Returns a tank from a generator.
    paced : bool
        Plants differ so much that each needs a pace of its own.
    """

    number: int
    text: str
    scenarios: tuple[str, ...]
    draw: Callable[[Generator], TankParameters]
    paced: bool = True


def _rig(rng: Generator) -> TankParameters:
    return specimen(TankParameters(), rng, TOLERANCES)


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
    tank = TankParameters()
    lagging = replace(
        tank,
        element=replace(tank.element, lag_s=element_s),
        probe=replace(tank.probe, lag_s=sensor_s),
    )
    return specimen(lagging, rng, TOLERANCES)


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
    return Plant(fleet, seed, parameters, pace=_pace(parameters) if kind.paced else 1.0)


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
