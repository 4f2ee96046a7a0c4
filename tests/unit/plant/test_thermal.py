"""Single laws of the tank's physics, each where it can be checked by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.plant import handling, thermal
from thermoctl.plant.parameters import (
    FUSION_J_PER_KG,
    WATER_J_PER_KG_K,
    Bath,
    Room,
    Supply,
    TankParameters,
    Vessel,
)
from thermoctl.plant.tank import Tank
from thermoctl.plant.thermal import conductances, rates, saturation_pa, start, step

IN_AIR = replace(TankParameters(), bath=Bath.holding(0.0))


def after(parameters: TankParameters, seconds: float, step_s: float, heater_w: float):
    k, heat = conductances(parameters), start(parameters)
    for _ in range(round(seconds / step_s)):
        heat = step(k, heat, heater_w, 1.0, step_s)
    return heat


@pytest.mark.parametrize(
    ("temperature_c", "pressure_pa"),
    [(0.0, 611.2), (20.0, 2339.0), (37.5, 6453.0), (60.0, 19946.0)],
)
def test_saturation_pressure_meets_the_steam_table(temperature_c, pressure_pa):
    assert saturation_pa(temperature_c) == pytest.approx(pressure_pa, rel=5e-3)


def test_a_tank_in_saturated_air_of_its_own_temperature_stays_as_it_is():
    room = Room(temperature_c=25.0, humidity=1.0)
    heat = start(replace(IN_AIR, room=room))
    for rate in rates(conductances(replace(IN_AIR, room=room)), heat, heater_w=0.0):
        assert rate == pytest.approx(0.0, abs=1e-9)


def test_dry_air_cools_water_of_room_temperature_by_evaporation_alone():
    parameters = replace(IN_AIR, room=Room(temperature_c=25.0, humidity=0.3))
    rate = rates(conductances(parameters), start(parameters), heater_w=0.0)
    assert rate.vapour_kg > 0.0
    assert rate.room_j == pytest.approx(0.0, abs=1e-9)
    latent = thermal.vaporisation_j_per_kg(25.0) + WATER_J_PER_KG_K * 25.0
    assert rate.vapour_j == pytest.approx(rate.vapour_kg * latent)


def test_vapour_leaves_both_zones_at_the_temperature_they_have():
    parameters = replace(IN_AIR, room=Room(temperature_c=25.0, humidity=0.3))
    rate = rates(conductances(parameters), start(parameters), heater_w=0.0)
    carried_w = Vessel().still_share * rate.water_kg * WATER_J_PER_KG_K * 25.0
    assert rate.still_j == pytest.approx(carried_w)


def test_half_the_water_wets_the_base_and_half_of_the_sides():
    parameters = replace(TankParameters(), room=Room(temperature_c=25.0, humidity=1.0))
    full = start(parameters)
    half = handling.drain(full, parameters.vessel, 0.5)
    lost_w = [rates(conductances(parameters), heat, 0.0).still_j for heat in (full, half)]
    vessel = parameters.vessel
    wetted_m2 = vessel.surface_m2 + 0.5 * vessel.side_m2
    assert lost_w[1] / lost_w[0] == pytest.approx(wetted_m2 / vessel.glass_area_m2)


def test_humid_warm_air_condenses_on_cold_water():
    parameters = replace(IN_AIR, initial_c=5.0, room=Room(temperature_c=35.0, humidity=0.9))
    assert rates(conductances(parameters), start(parameters), heater_w=0.0).vapour_kg < 0.0


def test_open_water_at_the_set_point_evaporates_0_9_kilograms_per_square_metre_and_hour():
    parameters = replace(TankParameters(), initial_c=37.5)
    per_s = rates(conductances(parameters), start(parameters), 0.0).vapour_kg
    # (25 + 19 v) (x_s - x) kg/(m2 h), the usual pool formula in still air, gives 0.85.
    assert 3600.0 * per_s / Vessel().surface_m2 == pytest.approx(0.85, rel=0.15)


def test_a_draught_multiplies_evaporation():
    parameters = TankParameters()
    still, windy = (
        rates(conductances(parameters, draught=factor), start(parameters), 0.0).vapour_kg
        for factor in (1.0, 4.0)
    )
    assert windy == pytest.approx(4.0 * still)


@pytest.mark.parametrize("parameters", [TankParameters(), IN_AIR], ids=["rig", "in air"])
def test_a_step_moves_every_entry_by_its_rate_in_the_middle_of_the_step(parameters):
    k, begin = conductances(parameters), after(parameters, 300.0, 0.5, 900.0)._replace(ice_kg=0.2)
    now = rates(k, begin, 700.0, unrest=1.1, cooled_w=50.0)
    middle = thermal.Heat(*(np.array(begin) + 0.2 * np.array(now)))
    mean = rates(k, middle, 700.0, unrest=1.1, cooled_w=50.0)
    assert step(k, begin, 700.0, 1.1, 0.4, cooled_w=50.0) == pytest.approx(
        np.array(begin) + 0.4 * np.array(mean), rel=1e-12
    )


@pytest.mark.parametrize(
    "parameters",
    [
        TankParameters(),
        TankParameters.scaled(0.5, 50.0),
        TankParameters.scaled(0.5, 5000.0),
        TankParameters.scaled(200.0, 5000.0),
    ],
    ids=["rig", "smallest", "fierce", "largest"],
)
def test_steps_ten_times_as_short_change_the_bulk_by_a_millikelvin_at_most(parameters):
    heater_w = parameters.element.rated_w * 0.2
    k = conductances(parameters)
    coarse, fine = (
        thermal.temperatures(k, after(parameters, 100.0, step_s, heater_w)).bulk_c
        for step_s in (thermal.LONGEST_STEP_S, 0.05)
    )
    assert coarse == pytest.approx(fine, abs=1e-3)


def test_the_error_of_a_step_falls_with_the_square_of_its_length():
    def bulk_c(step_s: float) -> float:
        heat = after(TankParameters(), 20.0, step_s, 1500.0)
        return thermal.temperatures(conductances(TankParameters()), heat).element_c

    exact_c = bulk_c(0.01)
    assert 3.5 < (bulk_c(0.5) - exact_c) / (bulk_c(0.25) - exact_c) < 4.5


def test_a_boiling_tank_stays_near_100_degrees_until_it_is_nearly_dry():
    parameters = replace(IN_AIR, supply=Supply(0.0, 60.0, 0.0, 60.0), initial_c=90.0)
    tank = Tank(parameters, np.random.default_rng(0))
    tank.advance(3600.0, 1.0)
    assert 99.0 < tank.temperature_c < 105.0
    assert tank.heat.water_kg < 7.0


def test_ice_in_the_water_takes_its_latent_heat_and_nothing_is_lost():
    quiet_room = Room(
        temperature_c=25.0, humidity=1.0, convection_w_per_m2_k=0.0, radiation_w_per_m2_k=0.0
    )
    sealed = replace(IN_AIR, room=quiet_room, vessel=replace(Vessel(), room_film_w_per_m2_k=0.0))
    tank = Tank(sealed, np.random.default_rng(0))
    tank.throw_ice(0.5)
    tank.advance(6 * 3600.0, 0.0)
    assert tank.heat.ice_kg < 1e-6
    water_j = 7.96 * WATER_J_PER_KG_K
    glass_j = thermal.conductances(sealed).wall_j_per_k + sealed.element.capacity_j_per_k
    mixed_c = (25.0 * (water_j + glass_j) - 0.5 * FUSION_J_PER_KG) / (
        water_j + glass_j + 0.5 * WATER_J_PER_KG_K
    )
    assert tank.temperature_c == pytest.approx(mixed_c, abs=1e-6)


def test_the_bath_warms_only_once_its_ice_is_going():
    tank = Tank(replace(TankParameters(), bath=Bath.holding(1.5)), np.random.default_rng(0))
    tank.advance(60.0, 0.4)
    with_ice_c = tank.temperatures.bath_c
    tank.advance(4 * 3600.0, 0.4)
    assert with_ice_c < 4.0
    assert tank.temperatures.bath_c > 10.0


def test_a_tank_in_air_has_no_bath_to_speak_of():
    tank = Tank(IN_AIR, np.random.default_rng(0))
    tank.advance(10.0, 0.4)
    assert math.isnan(tank.temperatures.bath_c)
    assert tank.heat.bath_ice_kg == 0.0


def test_a_tank_that_boils_dry_never_gets_hotter_than_its_element():
    tank = Tank(TankParameters.scaled(0.5, 5000.0), np.random.default_rng(2))
    for _ in range(800):
        tank.advance(0.5, 1.0)
        temperatures = tank.temperatures
        assert temperatures.still_c <= temperatures.water_c + 0.1
        assert temperatures.water_c < temperatures.element_c + 0.1
    assert tank.heat.water_kg > 0.0
    assert temperatures.water_c > 300.0
