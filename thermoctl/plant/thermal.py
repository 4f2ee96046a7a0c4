"""Heat and mass of the tank: a frozen state, its rates, one step.

The state holds enthalpies (0 for liquid water at 0 degC) and masses, not temperatures. Its rates
are sums of flows, each of which leaves one entry and enters another, so that any Runge-Kutta step
conserves energy and mass to rounding; `tests/property/test_plant_balance.py` shows it.
Equations: `docs/tank.md`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from thermoctl.plant.parameters import FUSION_J_PER_KG, WATER_J_PER_KG_K, TankParameters

EVAPORATION_KG_PER_J_K = 0.622 / (1006.0 * 0.90 * 101_325.0)
"""kg/(s m2 Pa) per W/(m2 K) of convection: Lewis, with Le^(2/3) = 0.90 and 0.622 = M_w/M_air."""
BOILING_S = 2.0
"""How fast water above 100 degC sheds its excess: 5 kW keep half a litre 5 K above 100 degC."""
DRY_PART = 0.05
"""Part of the nominal mass that stays as a film. Vapour fades out from twice as much: cut off
sharply, it would vanish from the second stage of a step only, and the water would overheat."""
LONGEST_STEP_S = 0.5
"""The fastest time constant, mixing in the smallest tank, is 2.6 s."""


class Heat(NamedTuple):
    """The state: enthalpies in J, masses in kg, and what crossed the boundary."""

    element_j: float
    water_j: float
    still_j: float
    wall_j: float
    bath_j: float
    water_kg: float
    ice_kg: float
    bath_kg: float
    bath_ice_kg: float
    electric_j: float = 0.0
    room_j: float = 0.0
    vapour_j: float = 0.0
    vapour_kg: float = 0.0
    cooled_j: float = 0.0
    poured_j: float = 0.0
    poured_kg: float = 0.0
    drained_j: float = 0.0
    drained_kg: float = 0.0


_STORED = Heat._fields.index("electric_j")
_HANDLED = Heat._fields.index("poured_j")  # from here on only people move anything
_EMPTY = (0.0,) * _STORED


class Temperatures(NamedTuple):
    """What the state means in degC; the bath is NaN where there is none."""

    element_c: float
    water_c: float
    still_c: float
    wall_c: float
    bath_c: float
    bulk_c: float


@dataclass(frozen=True, slots=True)
class Conductances:
    """Coefficients of the rates in one situation: stirring, draught."""

    element_j_per_k: float
    wall_j_per_k: float
    still_share: float
    stirred_share: float
    nominal_kg: float
    element_w_per_k: float
    exchange_w_per_k: float
    inner_w_per_k: float
    still_wall_share: float
    stirred_wall_share: float
    base_share: float
    side_share: float
    outer_w_per_k: float
    bath_room_w_per_k: float
    bath_melting_w_per_kg_k: float
    ice_melting_w_per_kg_k: float
    surface_w_per_k: float
    evaporation_kg_per_pa_s: float
    room_c: float
    vapour_pa: float


def saturation_pa(temperature_c: float) -> float:
    """Return the vapour pressure over water (Alduchov and Eskridge, 1996)."""
    return 610.94 * math.exp(17.625 * temperature_c / (temperature_c + 243.04))


def vaporisation_j_per_kg(temperature_c: float) -> float:
    """Return the latent heat of evaporation, within 0.3 % from 0 to 100 degC."""
    return 2.501e6 - 2.361e3 * temperature_c


def conductances(
    parameters: TankParameters, *, stirred: bool = True, draught: float = 1.0
) -> Conductances:
    """Return the coefficients; `draught` multiplies what the air carries off."""
    vessel, element, room = parameters.vessel, parameters.element, parameters.room
    area = vessel.glass_area_m2
    film = vessel.inner_w_per_m2_k if stirred else vessel.still_inner_w_per_m2_k
    outside = vessel.bath_film_w_per_m2_k if parameters.bath.exists else vessel.room_film_w_per_m2_k
    half_glass = 0.5 * vessel.glass_m / vessel.glass_w_per_m_k  # the node sits in mid-glass
    convection = room.convection_w_per_m2_k * draught
    base_share = vessel.surface_m2 / area
    return Conductances(
        element_j_per_k=element.capacity_j_per_k,
        wall_j_per_k=area * vessel.glass_m * vessel.glass_j_per_m3_k,
        still_share=vessel.still_share,
        stirred_share=1.0 - vessel.still_share,
        nominal_kg=vessel.water_kg,
        element_w_per_k=element.to_water_w_per_k * (1.0 if stirred else element.still_factor),
        exchange_w_per_k=(vessel.exchange_w_per_k if stirred else vessel.still_exchange_w_per_k),
        inner_w_per_k=area / (1.0 / film + half_glass),
        still_wall_share=vessel.still_wall_share,
        stirred_wall_share=1.0 - vessel.still_wall_share,
        base_share=base_share,
        side_share=1.0 - base_share,
        outer_w_per_k=area / (1.0 / outside + half_glass) if outside > 0.0 else 0.0,
        bath_room_w_per_k=parameters.bath.from_room_w_per_k,
        bath_melting_w_per_kg_k=parameters.bath.melting_w_per_kg_k,
        # 0.2 m2 of cubes per kg, as in the bath, but 600 W/(m2 K) in stirred water.
        ice_melting_w_per_kg_k=120.0 if stirred else 60.0,
        surface_w_per_k=vessel.surface_m2 * (convection + room.radiation_w_per_m2_k),
        evaporation_kg_per_pa_s=vessel.surface_m2 * convection * EVAPORATION_KG_PER_J_K,
        room_c=room.temperature_c,
        vapour_pa=room.humidity * saturation_pa(room.temperature_c),
    )


def start(parameters: TankParameters) -> Heat:
    """Return the state at the start: everything at `initial_c`, the bath at 0 degC."""
    t_c, share = parameters.initial_c, parameters.vessel.still_share
    k = conductances(parameters)
    water_j = parameters.vessel.water_kg * WATER_J_PER_KG_K * t_c
    outside_c = 0.0 if parameters.bath.exists else parameters.room.temperature_c
    wall_c = (k.inner_w_per_k * t_c + k.outer_w_per_k * outside_c) / (
        k.inner_w_per_k + k.outer_w_per_k
    )
    return Heat(
        element_j=k.element_j_per_k * t_c,
        water_j=(1.0 - share) * water_j,
        still_j=share * water_j,
        wall_j=k.wall_j_per_k * wall_c,
        bath_j=0.0,
        water_kg=parameters.vessel.water_kg,
        ice_kg=0.0,
        bath_kg=parameters.bath.water_kg,
        bath_ice_kg=parameters.bath.ice_kg,
    )


def temperatures(k: Conductances, heat: Heat) -> Temperatures:
    """Return the temperatures of the state."""
    element_j, water_j, still_j, wall_j, bath_j, water_kg, _, bath_kg, _ = heat[:_STORED]
    zone = water_kg * WATER_J_PER_KG_K
    element_c = element_j / k.element_j_per_k
    water_c = water_j / (zone * k.stirred_share)
    still_c = still_j / (zone * k.still_share)
    wall_c = wall_j / k.wall_j_per_k
    bath_c = bath_j / (bath_kg * WATER_J_PER_KG_K) if bath_kg > 0.0 else math.nan
    bulk_c = (water_j + still_j) / zone
    return Temperatures(element_c, water_c, still_c, wall_c, bath_c, bulk_c)


def evaporation_kg_per_s(k: Conductances, water_c: float, water_kg: float) -> float:
    """Return the vapour that leaves the surface; negative: it condenses."""
    level = water_kg / k.nominal_kg
    if level <= DRY_PART:
        return 0.0
    vapour = k.evaporation_kg_per_pa_s * (saturation_pa(water_c) - k.vapour_pa)
    if water_c > 100.0:
        excess_w = water_kg * WATER_J_PER_KG_K * (water_c - 100.0) / BOILING_S
        vapour += excess_w / vaporisation_j_per_kg(water_c)
    return vapour if level >= 2.0 * DRY_PART else (level - DRY_PART) / DRY_PART * vapour


def rates(
    k: Conductances, heat: Heat, heater_w: float, unrest: float = 1.0, cooled_w: float = 0.0
) -> Heat:
    """Return the rate of change of every entry of `heat`, per second.

    Parameters
    ----------
    k : Conductances
        Coefficients of the present situation.
    heat : Heat
        The state.
    heater_w : float
        Electrical power.
    unrest : float
        Factor on the heat that passes from the glass to the bath.
    cooled_w : float
        Heat that a cooler takes out of the stirred water.
    """
    stored, crossed = _rates(k, heat[:_STORED], heater_w, unrest, cooled_w)
    return Heat(*_stored_after(_EMPTY, 1.0, stored), *crossed)


def step(
    k: Conductances,
    heat: Heat,
    heater_w: float,
    unrest: float,
    step_s: float,
    cooled_w: float = 0.0,
) -> Heat:
    """Return the state `step_s` later by the midpoint rule; at most `LONGEST_STEP_S`."""
    stored = heat[:_STORED]
    now, _ = _rates(k, stored, heater_w, unrest, cooled_w)
    middle = _stored_after(stored, 0.5 * step_s, now)
    mean, crossing = _rates(k, middle, heater_w, unrest, cooled_w)
    crossed = _crossed_after(heat[_STORED:_HANDLED], step_s, crossing)
    return Heat._make(_stored_after(stored, step_s, mean) + crossed + heat[_HANDLED:])


def _rates(
    k: Conductances, stored: Sequence[float], heater_w: float, unrest: float, cooled_w: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return by how much what is stored grows a second, and what crosses the boundary.

    Bare numbers, here as in what follows: a tank takes four of these a second, and with entries
    that are taken one after the other in a loop, a step would take half as long again.
    """
    element_j, water_j, still_j, wall_j, bath_j, water_kg, ice_kg, bath_kg, bath_ice_kg = stored
    zone_j_per_k = water_kg * WATER_J_PER_KG_K
    water_c = water_j / (zone_j_per_k * k.stirred_share)
    still_c = still_j / (zone_j_per_k * k.still_share)
    wall_c = wall_j / k.wall_j_per_k
    heating_w = k.element_w_per_k * (element_j / k.element_j_per_k - water_c)
    level = water_kg / k.nominal_kg  # a stirrer turns over all there is in the same time
    mixing_w = level * k.exchange_w_per_k * (water_c - still_c)
    surface_w = k.surface_w_per_k * (water_c - k.room_c)
    wetted = k.base_share + k.side_share * level
    still_glass_w = wetted * k.still_wall_share * k.inner_w_per_k * (still_c - wall_c)
    glass_w = wetted * k.stirred_wall_share * k.inner_w_per_k * (water_c - wall_c)
    vapour_kg = evaporation_kg_per_s(k, water_c, water_kg)
    vapour_w = vapour_kg * (WATER_J_PER_KG_K * water_c + vaporisation_j_per_kg(water_c))
    melting_w = k.ice_melting_w_per_kg_k * ice_kg * water_c
    melted_kg = melting_w / FUSION_J_PER_KG
    gained_kg = melted_kg - vapour_kg
    # The zones keep their shares: what the one gains or loses flows on to or from the other.
    passed_c = water_c if gained_kg > 0.0 else still_c
    passed_w = k.still_share * gained_kg * WATER_J_PER_KG_K * passed_c
    wall_w, bath_w, room_w, thawed_kg = _outside(k, wall_c, unrest, bath_j, bath_kg, bath_ice_kg)
    return (
        heater_w - heating_w,
        heating_w - mixing_w - glass_w - surface_w - vapour_w - melting_w - passed_w - cooled_w,
        mixing_w - still_glass_w + passed_w,
        glass_w + still_glass_w - wall_w,
        bath_w,
        gained_kg,
        melted_kg,
        thawed_kg,
    ), (heater_w, surface_w + room_w, vapour_w, vapour_kg, cooled_w)


def _outside(
    k: Conductances,
    wall_c: float,
    unrest: float,
    bath_j: float,
    bath_kg: float,
    bath_ice_kg: float,
) -> tuple[float, float, float, float]:
    """Return the flows beyond the glass: W to wall, bath and room; kg/s of melting."""
    if bath_kg <= 0.0:  # bare air
        wall_w = k.outer_w_per_k * (wall_c - k.room_c)
        return wall_w, 0.0, wall_w, 0.0
    bath_c = bath_j / (bath_kg * WATER_J_PER_KG_K)
    wall_w = unrest * k.outer_w_per_k * (wall_c - bath_c)
    room_w = k.bath_room_w_per_k * (bath_c - k.room_c)
    melting_w = k.bath_melting_w_per_kg_k * bath_ice_kg * bath_c
    return wall_w, wall_w - room_w - melting_w, room_w, melting_w / FUSION_J_PER_KG


def _stored_after(
    stored: Sequence[float], step_s: float, rates: Sequence[float]
) -> tuple[float, ...]:
    """Return what is stored after `rates` of `step_s`."""
    element_j, water_j, still_j, wall_j, bath_j, water_kg, ice_kg, bath_kg, bath_ice_kg = stored
    element_w, water_w, still_w, wall_w, bath_w, gained_kg, melted_kg, thawed_kg = rates
    thawn_kg = step_s * thawed_kg
    return (
        element_j + step_s * element_w,
        water_j + step_s * water_w,
        still_j + step_s * still_w,
        wall_j + step_s * wall_w,
        bath_j + step_s * bath_w,
        water_kg + step_s * gained_kg,
        ice_kg - step_s * melted_kg,
        bath_kg + thawn_kg,
        bath_ice_kg - thawn_kg,
    )


def _crossed_after(
    crossed: Sequence[float], step_s: float, rates: Sequence[float]
) -> tuple[float, ...]:
    """Return what has crossed the boundary after `rates` of `step_s`."""
    electric_j, room_j, vapour_j, vapour_kg, cooled_j = crossed
    heater_w, room_w, vapour_w, evaporated_kg, cooled_w = rates
    return (
        electric_j + step_s * heater_w,
        room_j + step_s * room_w,
        vapour_j + step_s * vapour_w,
        vapour_kg + step_s * evaporated_kg,
        cooled_j + step_s * cooled_w,
    )
