"""The reference rig reproduces the figures of the experiment it stands for."""

from dataclasses import replace

import numpy as np
import pytest

from thermoctl.plant.parameters import WATER_J_PER_KG_K, Probe, Supply, TankParameters
from thermoctl.plant.tank import Tank

CALM = replace(
    TankParameters(),
    supply=Supply(voltage_spread=0.0, loss_spread=0.0),
    probe=replace(Probe(), turbulence_k=0.0),
)


def calm_tank(initial_c: float) -> Tank:
    return Tank(replace(CALM, initial_c=initial_c), np.random.default_rng(0))


def rate_k_per_s(tank: Tank, power: float, over_s: float) -> float:
    before_c = tank.temperature_c
    tank.advance(over_s, power**0.5)
    return (tank.temperature_c - before_c) / over_s


def test_full_power_heats_by_36_millikelvin_a_second():
    tank = calm_tank(25.0)
    tank.advance(60.0, 1.0)
    assert rate_k_per_s(tank, 1.0, over_s=200.0) == pytest.approx(0.036, abs=0.001)


def test_the_water_cools_by_9_millikelvin_a_second_with_the_heater_off():
    tank = calm_tank(38.0)
    tank.advance(90.0, 0.0)  # until the element has given away what it stored
    assert rate_k_per_s(tank, 0.0, over_s=60.0) == pytest.approx(-0.009, abs=0.001)


def test_holding_the_set_point_takes_280_to_300_watts():
    tank = calm_tank(37.5)
    held = []
    for _ in range(1200):  # a stiff proportional law on the truth: what it gives is the loss
        power = min(max(0.195 + (37.5 - tank.temperature_c), 0.0), 1.0)
        tank.advance(1.0, power**0.5)
        held.append(tank.heater_w)
    assert abs(tank.temperature_c - 37.5) < 0.02
    assert 280.0 < np.mean(held[-300:]) < 300.0


def test_the_element_stands_75_kelvin_above_the_water_and_stores_an_overshoot_of_0_6_kelvin():
    tank = calm_tank(25.0)
    tank.advance(200.0, 1.0)
    excess_k = tank.temperatures.element_c - tank.temperatures.water_c
    stored_j = excess_k * CALM.element.capacity_j_per_k
    assert excess_k == pytest.approx(75.0, abs=2.0)
    assert stored_j / (tank.heat.water_kg * WATER_J_PER_KG_K) == pytest.approx(0.6, abs=0.05)


def test_without_the_stirrer_the_element_stands_higher_above_the_water():
    tank = calm_tank(25.0)
    tank.stir(False)
    tank.advance(200.0, 1.0)
    excess_k = tank.temperatures.element_c - tank.temperatures.water_c
    assert excess_k == pytest.approx(75.0 / CALM.element.still_factor, abs=3.0)


def test_the_heater_lags_10_to_30_seconds():
    tank = calm_tank(25.0)
    reached_s = 0
    while tank.temperatures.element_c - tank.temperatures.water_c < 0.632 * 75.0:
        tank.advance(1.0, 1.0)
        reached_s += 1
    assert 10 <= reached_s <= 30


def test_the_sensor_stays_behind_the_rising_water_by_transport_and_sheath():
    tank = calm_tank(25.0)
    tank.advance(150.0, 1.0)
    slope = rate_k_per_s(tank, 1.0, over_s=10.0)
    late_s = (tank.temperatures.water_c - tank.sensor_c) / slope
    expected_s = CALM.probe.transport_s + CALM.probe.lag_s
    assert late_s == pytest.approx(expected_s, abs=0.1)


def test_a_litre_of_cold_water_takes_3_kelvin():
    tank = calm_tank(37.5)
    tank.pour(1.0, 10.0)
    assert 37.5 - tank.temperature_c == pytest.approx(27.5 / 9.0, rel=1e-9)


def test_without_the_stirrer_the_zone_the_sensor_does_not_see_takes_the_mean_down_by_0_35_kelvin():
    tank = calm_tank(37.5)
    tank.stir(False)
    tank.advance(900.0, 0.44)
    unseen_k = tank.temperatures.water_c - tank.temperature_c
    assert unseen_k == pytest.approx(0.35, abs=0.07)


def test_an_hour_at_the_set_point_melts_two_to_four_kilograms_of_ice():
    tank = calm_tank(37.5)
    tank.advance(3600.0, 0.44)
    assert 2.0 < CALM.bath.ice_kg - tank.heat.bath_ice_kg < 4.0
