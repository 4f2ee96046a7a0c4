"""The cooler takes the heat it is rated for, late, and never makes ice."""

from dataclasses import replace

import numpy as np
import pytest

from thermoctl.plant.coil import CoolingCoil
from thermoctl.plant.parameters import Cooler, TankParameters
from thermoctl.plant.tank import Tank

IN_AIR = TankParameters.scaled(8.0, 1500.0, ice_kg=0.0)


def cooled(rated_w: float, initial_c: float = 25.0) -> Tank:
    parameters = replace(IN_AIR, cooler=Cooler(rated_w, 20.0), initial_c=initial_c)
    return Tank(parameters, np.random.default_rng(3))


def test_a_tank_without_a_cooler_is_the_same_whatever_drive_it_is_given():
    one, other = (Tank(IN_AIR, np.random.default_rng(3)) for _ in range(2))
    one.advance(300.0, 0.3)
    other.advance(300.0, 0.3, cooling=1.0)
    assert one.heat == other.heat


def test_heat_comes_out_behind_the_lag_and_in_the_end_as_much_as_rated():
    coil = CoolingCoil(Cooler(300.0, 20.0))
    flows_w = [coil.advance(1.0, 1.0, 20.0) for _ in range(400)]
    assert flows_w[0] < 10.0
    assert np.mean(flows_w[19:21]) == pytest.approx(300.0 * (1.0 - np.exp(-1.0)), rel=0.02)
    assert flows_w[-1] == pytest.approx(300.0)
    assert np.all(np.diff(flows_w) > 0.0)


def test_a_lag_in_halves_is_the_same_lag():
    whole, halves = CoolingCoil(Cooler(300.0, 20.0)), CoolingCoil(Cooler(300.0, 20.0))
    taken_j = whole.advance(1.0, 0.7, 20.0)
    assert sum(0.5 * halves.advance(0.5, 0.7, 20.0) for _ in range(2)) == pytest.approx(taken_j)


def test_the_water_loses_what_the_books_say_and_they_close():
    tank = cooled(300.0)
    tank.advance(600.0, 0.0, cooling=0.5)
    heat = tank.heat
    assert heat.cooled_j == pytest.approx(150.0 * (600.0 - 20.0), rel=0.01)
    assert abs(tank.ledger.error_j) < 1e-6 * heat.cooled_j
    assert tank.temperature_c < 25.0 - 0.8 * heat.cooled_j / (8.0 * 4181.0)


@pytest.mark.parametrize("drive", [float("nan"), -1.0])
def test_a_drive_that_is_none_cools_nothing(drive):
    tank = cooled(300.0)
    tank.advance(60.0, 0.0, cooling=drive)
    assert tank.cooled_w == 0.0


def test_five_kilowatts_cannot_bring_it_below_the_freezing_point():
    tank = cooled(5000.0, initial_c=5.0)
    for _ in range(60):
        tank.advance(10.0, 0.0, cooling=1.0)
        assert tank.temperatures.water_c > -0.1


@pytest.mark.parametrize(("key", "value"), [("rated_w", -1.0), ("lag_s", 1.0)])
def test_a_cooler_out_of_range_is_refused_by_name(key, value):
    with pytest.raises(ValueError, match=key):
        Cooler(**{key: value})
