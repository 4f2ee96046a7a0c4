"""What people do to the water: pour, drain, throw ice."""

from __future__ import annotations

from thermoctl.plant.parameters import (
    FUSION_J_PER_KG,
    WATER_J_PER_KG_K,
    WATER_KG_PER_L,
    Vessel,
)
from thermoctl.plant.thermal import Heat
from thermoctl.ranges import require

LEAST_FILL = 0.1
"""Part of the nominal water that must stay in, or the heater would be dry."""
SLUSH = 20.0
"""Most ice a bath takes, as a multiple of the water in it; beyond, hardly a cube is wet."""


def pour(heat: Heat, vessel: Vessel, litres: float, temperature_c: float) -> Heat:
    """Return the state after water came in; what overflows is drained.

    Raises
    ------
    ValueError
        When `litres` lies outside 0 to 1,000, or `temperature_c` outside 0 to 95 degC.
    """
    require("litres", litres, 0.0, 1000.0)
    require("temperature_c", temperature_c, 0.0, 95.0)
    poured_kg = litres * WATER_KG_PER_L
    poured_j = poured_kg * WATER_J_PER_KG_K * temperature_c
    fuller = heat._replace(
        water_j=heat.water_j + (1.0 - vessel.still_share) * poured_j,
        still_j=heat.still_j + vessel.still_share * poured_j,
        water_kg=heat.water_kg + poured_kg,
        poured_j=heat.poured_j + poured_j,
        poured_kg=heat.poured_kg + poured_kg,
    )
    return _without(fuller, max(fuller.water_kg - vessel.brim_ratio * vessel.water_kg, 0.0))


def drain(heat: Heat, vessel: Vessel, fraction: float) -> Heat:
    """Return the state after `fraction` of the water ran out.

    Raises
    ------
    ValueError
        When `fraction` lies outside 0 to 1, or the heater would run dry.
    """
    require("fraction", fraction, 0.0, 1.0)
    left_kg, least_kg = (1.0 - fraction) * heat.water_kg, LEAST_FILL * vessel.water_kg
    if left_kg < least_kg:
        raise ValueError(
            f"fraction must leave {least_kg:.2f} kg of water to cover the heater, "
            f"got {fraction!r}, which leaves {left_kg:.2f}"
        )
    return _without(heat, heat.water_kg - left_kg)


def _without(heat: Heat, drained_kg: float) -> Heat:
    """Take water out of both zones in proportion, with the heat it carries."""
    part = drained_kg / heat.water_kg
    water_j, still_j = part * heat.water_j, part * heat.still_j
    return heat._replace(
        water_j=heat.water_j - water_j,
        still_j=heat.still_j - still_j,
        water_kg=heat.water_kg - drained_kg,
        drained_j=heat.drained_j + water_j + still_j,
        drained_kg=heat.drained_kg + drained_kg,
    )


def throw_ice(heat: Heat, vessel: Vessel, ice_kg: float) -> Heat:
    """Return the state after ice of 0 degC came into the water.

    Raises
    ------
    ValueError
        When the ice would be more than the water of a full tank.
    """
    require("ice_kg", ice_kg, 0.0, max(vessel.water_kg - heat.ice_kg, 0.0))
    return _with_poured_ice(heat._replace(ice_kg=heat.ice_kg + ice_kg), ice_kg)


def refill_bath(heat: Heat, ice_kg: float) -> Heat:
    """Return the state after ice of 0 degC came into the bath around the tank.

    Raises
    ------
    ValueError
        When there is no bath, or more ice than it takes.
    """
    if heat.bath_kg <= 0.0:
        raise ValueError("bath ice needs a tank that stands in a bath; this one stands in air")
    require("ice_kg", ice_kg, 0.0, max(SLUSH * heat.bath_kg - heat.bath_ice_kg, 0.0))
    return _with_poured_ice(heat._replace(bath_ice_kg=heat.bath_ice_kg + ice_kg), ice_kg)


def _with_poured_ice(heat: Heat, ice_kg: float) -> Heat:
    """Book ice as poured, with the enthalpy it lacks against water of 0 degC."""
    return heat._replace(
        poured_kg=heat.poured_kg + ice_kg,
        poured_j=heat.poured_j - FUSION_J_PER_KG * ice_kg,
    )
