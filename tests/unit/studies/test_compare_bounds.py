"""The tank as a linear plant, and bounds that nobody beats on it."""

from dataclasses import replace

import numpy as np
import pytest

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.app.sim import profile
from thermoctl.control.on_off import OnOff
from thermoctl.plant import thermal
from thermoctl.plant.acquisition import Acquisition
from thermoctl.plant.parameters import Supply, TankParameters
from thermoctl.plant.tank import Tank
from thermoctl.studies.compare.bounds import bounds, realisable
from thermoctl.studies.compare.linear import KELVIN_PER_V, linear_tank, rest
from thermoctl.studies.compare.plants import ACQUISITION, Plant, plant
from thermoctl.studies.compare.play import play
from thermoctl.studies.compare.riccati import regulated, riccati
from thermoctl.studies.compare.scenarios import SCENARIOS
from thermoctl.studies.compare.score import measured
from thermoctl.studies.compare.swift import NoiselessTank

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

RIG = TankParameters()
NOMINAL = Plant("rig", 0, RIG)


def test_a_tank_at_rest_stays_there():
    held, known = rest(RIG, 37.5), NoiselessTank.of(RIG)
    heat = held.heat
    for _ in range(60):
        heat = known.advance(heat, held.power)
    assert known.bulk_c(held.heat) == pytest.approx(37.5, abs=1e-6)
    assert known.bulk_c(heat) == pytest.approx(37.5, abs=1e-4)
    assert 280.0 < held.power * RIG.element.rated_w < 300.0


def test_a_little_more_power_does_to_the_linear_tank_what_it_does_to_the_tank():
    held, known = rest(RIG, 37.5), NoiselessTank.of(RIG)
    linear = linear_tank(RIG, ACQUISITION, held)
    x, more, less = np.zeros((len(linear.A), 1)), held.heat, held.heat
    for _ in range(120):
        x = linear.A @ x + 0.05 * linear.B
        more, less = known.advance(more, held.power + 0.05), known.advance(less, held.power)
    expected_k = known.bulk_c(more) - known.bulk_c(less)
    assert (linear.z @ x).item() == pytest.approx(expected_k, rel=1e-3)


def test_the_linear_probe_follows_as_the_probe_of_the_tank():
    quiet = replace(RIG, supply=Supply(voltage_spread=0.0, loss_spread=0.0),
                    probe=replace(RIG.probe, turbulence_k=0.0, transport_s=2.3))  # fmt: skip
    tank = Tank(replace(quiet, initial_c=30.0), np.random.default_rng(0))
    linear = linear_tank(quiet, ACQUISITION, rest(quiet, 30.0))
    # Driven by the water's own path, so that only transport and sheath are compared.
    water = 1
    x = np.zeros((len(linear.A), 1))
    for _ in range(40):
        tank.advance(1.0, 0.7)
        x = linear.A @ x
        x[water] = tank.temperatures.water_c - 30.0
    assert (linear.C @ x).item() == pytest.approx(tank.sensor_c - 30.0, abs=0.02)


def test_the_rig_allows_what_its_physics_allow():
    found = {name: bounds(NOMINAL, SCENARIOS[name]) for name in SCENARIOS}
    print({name: {k: round(v, 4) for k, v in figures.items()} for name, figures in found.items()})
    assert 350.0 < found["warm-up"]["settled_s"] < 360.0
    assert 80.0 < found["step"]["settled_s"] < 86.0
    assert 100.0 < found["cold-water"]["settled_s"] < 107.0
    assert found["cold-water"]["dip_k"] == pytest.approx(27.5 / 9.0, abs=1e-3)
    assert 0.0095 < found["regulation"]["deviation_k"] < 0.0105
    assert 1.02 < found["regulation"]["realisable_k"] / found["regulation"]["deviation_k"] < 1.05
    assert found["spike-dropout"] == {}


def test_an_input_that_must_be_quiet_costs_deviation():
    linear = linear_tank(RIG, ACQUISITION, rest(RIG, 37.5))
    loud, quiet = realisable(linear, 0.1), realisable(linear, 0.02)
    assert loud.input <= 0.1
    assert quiet.input == pytest.approx(0.02, rel=1e-3)
    assert loud.judged < quiet.judged
    with pytest.raises(ValueError, match="quiet"):
        realisable(linear, 1e-9)


def test_the_law_that_knows_the_plant_reaches_the_bound_on_the_simulated_tank():
    held = rest(RIG, 37.5)
    linear = linear_tank(RIG, ACQUISITION, held)
    price = 0.01
    expected = regulated(linear, price)
    P = riccati(linear.A.T, linear.C.T, linear.Q, np.array([[linear.R]]))
    K = P @ linear.C.T / (linear.C @ P @ linear.C.T + linear.R)
    X = riccati(linear.A, linear.B, linear.z.T @ linear.z, np.array([[price]]))
    L = np.linalg.solve(price + linear.B.T @ X @ linear.B, linear.B.T @ X @ linear.A)
    off_k = []
    for seed in range(3):
        off_k += _held_by(K, L, linear, held.power, seed)
    print(f"{1e3 * np.std(off_k):.2f} mK, expected {1e3 * expected.judged:.2f}")
    assert np.std(off_k) == pytest.approx(expected.judged, rel=0.1)


def _held_by(K, L, linear, holding, seed):
    """Return deviations of the tank under a known filter and law, once it is settled."""
    rngs = np.random.default_rng(seed).spawn(2)
    tank, converter = Tank(RIG, rngs[0]), Acquisition(ACQUISITION, rngs[1])
    sensor_off_k = thermal.temperatures(thermal.conductances(RIG), rest(RIG, 37.5).heat).water_c
    x, off_k, drift = np.zeros((len(linear.A), 1)), [], 0.0
    for second in range(3600):
        volts = converter.convert(tank.probe.volts()) / ACQUISITION.full_scale
        y = KELVIN_PER_V * ACQUISITION.reference_v * volts - 273.15 - sensor_off_k
        if second < 600:  # warm it up and let it settle, whatever the law
            u = holding - 0.3 * y
            x[:] = 0.0
        else:
            x = x + K * (y - linear.C @ x)
            drift += 2e-5 * y  # a trace of integral action: the ice melts
            u = holding - (L @ x).item() - drift
            if second > 1500:
                off_k.append(tank.temperature_c - 37.5)
        power = min(max(u, 0.0), 1.0)
        x = linear.A @ x + linear.B * (power - holding + (drift if second >= 600 else 0.0))
        tank.advance(1.0, np.sqrt(power))
    return list(np.array(off_k) - np.mean(off_k))


_, TABLE = load(profile("aquarium")).loop()
PLAN = plan_for(TABLE)


@pytest.mark.parametrize("name", ["warm-up", "step", "cold-water", "ice"])
@pytest.mark.parametrize("law", [PLAN.controller, OnOff(0.02)], ids=lambda law: law.name)
def test_no_controller_arrives_before_the_bound(name, law):
    where = plant("rig", 3)
    trace = play(replace(PLAN, controller=law), where, SCENARIOS[name])
    settled_s = measured(trace)["settled_s"]
    assert trace.failure is None
    assert settled_s is None or settled_s > 0.97 * bounds(where, SCENARIOS[name])["settled_s"]


@pytest.mark.parametrize("seed", [0, 1])
def test_no_controller_is_calmer_than_minimum_variance(seed):
    where, regulation = plant("rig", seed), SCENARIOS["regulation"]
    deviation_k = measured(play(PLAN, where, regulation))["deviation_k"]
    assert deviation_k > 0.95 * bounds(where, regulation)["deviation_k"]
