"""The tank as a whole: seeds, intervals, drives and disturbances by name."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.model.actuator import Linear
from thermoctl.plant.disturbances import DISTURBANCES, disturb
from thermoctl.plant.parameters import Bath, Probe, Supply, TankParameters
from thermoctl.plant.tank import Tank

CALM = replace(
    TankParameters(),
    supply=Supply(voltage_spread=0.0, loss_spread=0.0),
    probe=replace(Probe(), turbulence_k=0.0),
)


def tank_of(parameters: TankParameters = CALM, seed: int = 0, law=None) -> Tank:
    return Tank(parameters, np.random.default_rng(seed), law)


def life(seed: int) -> list[float]:
    tank, lived = tank_of(TankParameters(), seed), []
    for number, name in enumerate(DISTURBANCES):
        disturb(tank, name)
        tank.advance(20.0, 0.1 * number)
        lived += [tank.temperature_c, tank.sensor_c, tank.heater_w]
    return lived


def test_equal_seeds_live_equal_lives_and_others_do_not():
    assert life(seed=4) == life(seed=4)
    assert life(seed=4) != life(seed=5)


def test_the_way_an_interval_is_cut_hardly_matters_to_a_calm_tank():
    whole, pieces = tank_of(), tank_of()
    whole.advance(100.0, 0.7)
    for piece_s in np.tile([0.3, 1.0, 0.05, 0.65], 50):
        pieces.advance(float(piece_s), 0.7)
    assert pieces.t_s == pytest.approx(whole.t_s)
    assert pieces.temperature_c == pytest.approx(whole.temperature_c, abs=1e-3)
    assert pieces.sensor_c == pytest.approx(whole.sensor_c, abs=2e-3)


def test_no_time_changes_nothing():
    tank = tank_of(TankParameters())
    before = tank.heat
    tank.advance(0.0, 1.0)
    assert tank.heat == before


@pytest.mark.parametrize("interval_s", [-1.0, math.nan, math.inf])
def test_time_that_does_not_pass_is_refused(interval_s):
    with pytest.raises(ValueError, match="interval_s"):
        tank_of().advance(interval_s, 0.0)


@pytest.mark.parametrize(("drive", "heater_w"), [(math.nan, 0.0), (-1.0, 0.0), (2.0, 1500.0)])
def test_a_wild_drive_is_limited_and_what_is_no_number_is_off(drive, heater_w):
    tank = tank_of()
    tank.advance(1.0, drive)
    assert tank.heater_w == heater_w


def test_the_stage_decides_what_a_drive_means():
    square, linear = tank_of(), tank_of(law=Linear())
    for tank in (square, linear):
        tank.advance(1.0, 0.5)
    assert (square.heater_w, linear.heater_w) == (375.0, 750.0)


def test_a_sag_takes_the_square_of_the_voltage_for_a_minute():
    tank = tank_of()
    disturb(tank, "sag", 0.2)
    tank.advance(30.0, 1.0)
    assert tank.heater_w == pytest.approx(1500.0 * 0.64)
    tank.advance(31.0, 1.0)
    assert tank.heater_w == pytest.approx(1500.0)


def test_mains_wander_by_a_percent():
    tank = tank_of(TankParameters(), seed=3)
    seen = []
    for _ in range(2000):
        tank.advance(10.0, 0.0)
        seen.append(tank.stage.mains)
    assert np.std(seen) == pytest.approx(0.01, rel=0.15)
    assert np.mean(seen) == pytest.approx(1.0, abs=0.003)


def test_turbulence_makes_the_sensor_restless_by_what_the_sheath_lets_through():
    probe = replace(CALM.probe, turbulence_k=0.1, turbulence_s=2.0, lag_s=6.0)
    calm, restless = tank_of(seed=1), tank_of(replace(CALM, probe=probe), seed=1)
    apart_k = []
    for _ in range(4000):
        for tank in (calm, restless):
            tank.advance(0.5, 0.4)
        apart_k.append(restless.sensor_c - calm.sensor_c)
    passed_k = 0.1 * math.sqrt(2.0 / (2.0 + 6.0))  # coloured noise through a first-order lag
    assert np.std(apart_k) == pytest.approx(passed_k, rel=0.1)


def test_the_loss_to_the_bath_is_restless():
    supply = replace(CALM.supply, loss_spread=0.05)
    calm, restless = tank_of(), tank_of(replace(CALM, supply=supply))
    for tank in (calm, restless):
        tank.advance(600.0, 0.4)
    assert 1e-3 < abs(restless.temperature_c - calm.temperature_c) < 1.0


def test_an_uncalibrated_sensor_is_wrong_by_a_gain():
    tank = tank_of(replace(CALM, probe=replace(CALM.probe, gain_error=0.01)))
    assert tank.probe.volts() == pytest.approx(1.01 * tank_of().probe.volts())


def test_a_draught_goes_on_when_the_stirrer_stops():
    tank = tank_of()
    disturb(tank, "draught", 5.0)
    before = tank.heat
    tank.advance(1.0, 0.0)
    stirred_w = tank.heat.vapour_j - before.vapour_j
    tank.stir(False)
    before = tank.heat
    tank.advance(1.0, 0.0)
    assert tank.heat.vapour_j - before.vapour_j == pytest.approx(stirred_w, rel=0.05)


def test_a_step_of_the_water_arrives_after_the_transport_and_then_by_the_lag_of_the_sheath():
    hot = tank_of(replace(CALM, initial_c=37.5))
    hot.pour(8.0, 10.0)
    start_c = hot.sensor_c
    hot.advance(CALM.probe.transport_s - 0.5, 0.4)
    assert hot.sensor_c == start_c
    hot.advance(0.75 + CALM.probe.lag_s, 0.4)
    passed = (start_c - hot.sensor_c) / (start_c - hot.temperature_c)
    assert passed == pytest.approx(1.0 - math.exp(-1.0), abs=0.04)


def test_without_the_stirrer_the_water_takes_longer_to_the_sensor():
    late_k = []
    for stirred in (True, False):
        tank = tank_of()
        tank.stir(stirred)
        tank.advance(120.0, 1.0)
        late_k.append(tank.temperatures.water_c - tank.sensor_c)
    assert late_k[1] > 1.3 * late_k[0]


def test_a_spike_spoils_one_voltage_only():
    tank = tank_of()
    sound_v = tank.probe.volts()
    disturb(tank, "spike", -50.0)
    assert tank.probe.volts() == pytest.approx(sound_v - 0.5)
    assert tank.probe.volts() == sound_v


@pytest.mark.parametrize(
    ("name", "reads"),
    [("dropout", math.isnan), ("open", math.isinf), ("short", lambda volts: volts == 0.0)],
)
def test_a_fault_of_the_wire_lasts_as_long_as_it_was_told_to(name, reads):
    tank = tank_of()
    disturb(tank, name, 10.0)
    tank.advance(9.5, 0.0)
    assert reads(tank.probe.volts())
    tank.advance(0.5, 0.0)
    assert 2.9 < tank.probe.volts() < 3.1


def test_the_stirrer_stops_and_starts_again():
    tank = tank_of()
    assert disturb(tank, "stirrer") == "stirrer stopped"
    assert not tank.stirred
    assert disturb(tank, "stirrer") == "stirrer started"
    assert tank.stirred


def test_a_draught_cools_for_five_minutes_and_is_over():
    def loss_w(tank: Tank) -> float:
        before = tank.heat
        tank.advance(1.0, 0.0)
        return tank.heat.vapour_j - before.vapour_j

    tank = tank_of()
    still_w = loss_w(tank)
    disturb(tank, "draught", 5.0)
    assert loss_w(tank) == pytest.approx(5.0 * still_w, rel=0.01)
    tank.advance(300.0, 0.4)
    assert loss_w(tank) < 1.5 * still_w


def test_what_does_not_fit_into_the_tank_runs_over():
    tank = tank_of()
    said = disturb(tank, "cold-water", 6.0)
    assert "ran over" in said
    assert tank.heat.water_kg == pytest.approx(1.5 * CALM.vessel.water_kg)


def test_half_the_water_gone_leaves_half_at_the_same_temperature():
    tank = tank_of()
    disturb(tank, "half-gone")
    assert tank.heat.water_kg == pytest.approx(0.5 * CALM.vessel.water_kg)
    assert tank.temperature_c == pytest.approx(25.0)


def test_the_heater_is_never_drained_dry():
    tank = tank_of()
    for _ in range(3):
        disturb(tank, "half-gone")
    with pytest.raises(ValueError, match="cover the heater"):
        disturb(tank, "half-gone")


def test_the_usual_amount_of_cold_water_grows_with_the_tank():
    small = tank_of(TankParameters.scaled(0.5, 100.0))
    assert disturb(small, "cold-water").startswith("0.0625 l")


@pytest.mark.parametrize(
    ("name", "amount", "named"),
    [
        ("earthquake", None, "earthquake"),
        ("sag", 1.5, "amount of sag"),
        ("cold-water", math.nan, "amount of cold-water"),
        ("ice", -1.0, "amount of ice"),
        ("dropout", math.inf, "amount of dropout"),
    ],
)
def test_a_disturbance_that_cannot_be_is_refused_by_name(name, amount, named):
    tank = tank_of()
    before = tank.heat
    with pytest.raises(ValueError, match=named):
        disturb(tank, name, amount)
    assert tank.heat == before


def test_ice_for_a_bath_that_is_not_there_is_refused():
    with pytest.raises(ValueError, match="stands in air"):
        disturb(tank_of(replace(CALM, bath=Bath.holding(0.0))), "bath-ice")
