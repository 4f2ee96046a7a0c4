"""Specimens: the same tank as different workshops would have built it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from numpy.random import Generator

from thermoctl.plant.parameters import TankParameters
from thermoctl.ranges import require

VARIED: Mapping[str, tuple[str, ...]] = {
    "vessel": (
        "exchange_w_per_k",
        "still_exchange_w_per_k",
        "inner_w_per_m2_k",
        "glass_m",
        "bath_film_w_per_m2_k",
        "room_film_w_per_m2_k",
    ),
    "element": ("above_water_k", "lag_s"),
    "bath": ("melting_w_per_kg_k",),
    "room": ("convection_w_per_m2_k", "radiation_w_per_m2_k"),
    "probe": ("transport_s", "lag_s"),
    "cooler": ("lag_s",),
}
"""What varies between specimens; size, rated power and temperatures are what was ordered."""


def specimen(parameters: TankParameters, rng: Generator, spread: float = 0.1) -> TankParameters:
    """Return `parameters`, each of `VARIED` times a log-normal factor.

    Parameters
    ----------
    parameters : TankParameters
        The tank as it was ordered.
    rng : Generator
        Where the specimen comes from.
    spread : float
        Standard deviation of the logarithm of each factor, 0 to 0.3; cut at two of them.

    Raises
    ------
    ValueError
        When `spread` lies outside its range, or a factor takes a number out of its own.
    """
    require("spread", spread, 0.0, 0.3)
    parts: dict[str, Any] = {}
    for part_name, names in VARIED.items():
        part: Any = getattr(parameters, part_name)
        varied = {name: getattr(part, name) * factor(rng, spread) for name in names}
        parts[part_name] = replace(part, **varied)
    return replace(parameters, **parts)


def factor(rng: Generator, spread: float) -> float:
    """Return one log-normal factor of this spread, within two standard deviations."""
    deviation = min(max(float(rng.standard_normal()), -2.0), 2.0)
    return math.exp(spread * deviation)
