"""Whatever befalls a tank, its books of energy and mass close to rounding."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from thermoctl.plant.disturbances import DISTURBANCES, disturb
from thermoctl.plant.ledger import stored_j, stored_kg
from thermoctl.plant.parameters import Bath, Cooler, TankParameters
from thermoctl.plant.tank import Tank

SIZES = {
    "rig": TankParameters(),
    "smallest": TankParameters.scaled(0.5, 50.0),
    "fierce": TankParameters.scaled(0.5, 5000.0),
    "largest": TankParameters.scaled(200.0, 5000.0),
    "sluggish": TankParameters.scaled(200.0, 50.0),
    "in air": replace(TankParameters(), bath=Bath.holding(0.0)),
    "cooled": replace(TankParameters(), cooler=Cooler(800.0)),
}


def assert_books_close(tank: Tank) -> None:
    ledger = tank.ledger
    turnover_j = abs(stored_j(ledger.before)) + ledger.electric_j + abs(ledger.poured_j)
    assert abs(ledger.error_j) < 1e-9 * (turnover_j + abs(ledger.lost_j))
    assert abs(ledger.error_kg) < 1e-9 * stored_kg(ledger.before)


@pytest.mark.parametrize("size", SIZES)
def test_the_books_close_over_a_run_with_every_disturbance(size):
    tank = Tank(SIZES[size], np.random.default_rng(11))
    for name in DISTURBANCES:
        if name == "bath-ice" and not tank.parameters.bath.exists:
            continue
        disturb(tank, name)
        tank.advance(90.0, 0.5, cooling=0.5)
        assert_books_close(tank)
    assert tank.ledger.electric_j > 0.0
    assert tank.ledger.lost_j != 0.0


ACTS = st.one_of(
    st.tuples(st.just("advance"), st.floats(0.0, 40.0), st.floats(0.0, 1.0)),
    st.tuples(st.just("pour"), st.floats(0.0, 3.0), st.floats(0.0, 95.0)),
    st.tuples(st.just("drain"), st.floats(0.0, 0.3), st.none()),
    st.tuples(st.just("ice"), st.floats(0.0, 0.3), st.none()),
    st.tuples(st.just("bath"), st.floats(0.0, 1.0), st.none()),
    st.tuples(st.just("stir"), st.booleans(), st.none()),
)


def act(tank: Tank, name: str, amount: float, second: float | None) -> None:
    match name:
        case "advance":
            tank.advance(amount, second)
        case "pour":
            tank.pour(amount, second)
        case "drain" if tank.heat.water_kg > 0.2 * tank.parameters.vessel.water_kg:
            tank.drain(amount)
        case "ice" if tank.heat.ice_kg < 5.0:
            tank.throw_ice(amount)
        case "bath":
            tank.refill_bath(amount)
        case "stir":
            tank.stir(bool(amount))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.lists(ACTS, max_size=12))
def test_the_books_close_whatever_is_done_in_whatever_order(acts):
    tank = Tank(TankParameters(), np.random.default_rng(3))
    for name, amount, second in acts:
        act(tank, name, amount, second)
    assert_books_close(tank)


@example(volume_l=0.5, heater_w=5000.0, drive=1.0, stirred=True)  # boils down to its last film
@example(volume_l=200.0, heater_w=50.0, drive=0.0, stirred=False)
@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    volume_l=st.floats(0.5, 200.0),
    heater_w=st.floats(50.0, 5000.0),
    drive=st.floats(0.0, 1.0),
    stirred=st.booleans(),
)
def test_every_tank_stays_between_freezing_and_boiling(volume_l, heater_w, drive, stirred):
    tank = Tank(TankParameters.scaled(volume_l, heater_w), np.random.default_rng(2))
    tank.stir(stirred)
    for _ in range(20):
        tank.advance(30.0, drive)
        assert tank.heat.water_kg > 0.0
        if tank.heat.water_kg > 0.5 * tank.parameters.vessel.water_kg:
            assert 0.0 <= tank.temperature_c < 110.0
            assert 0.0 <= tank.temperatures.still_c < 110.0
        assert 0.0 <= tank.heat.bath_ice_kg <= tank.parameters.bath.ice_kg
    assert_books_close(tank)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(weak=st.floats(0.0, 1.0), strong=st.floats(0.0, 1.0))
def test_more_drive_never_leaves_the_water_colder(weak, strong):
    bulk_c = []
    for drive in sorted((weak, strong)):
        tank = Tank(TankParameters(), np.random.default_rng(9))
        tank.advance(60.0, drive)
        bulk_c.append(tank.temperature_c)
    assert bulk_c[0] <= bulk_c[1] + 1e-9


def test_a_nearly_empty_tank_keeps_its_zones_together():
    tank = Tank(TankParameters.scaled(0.5, 50.0), np.random.default_rng(1))
    tank.drain(0.89)
    tank.advance(60.0, 0.4)
    tank.stir(False)
    tank.stir(True)
    tank.advance(60.0, 0.4)
    assert abs(tank.temperatures.water_c - tank.temperatures.still_c) < 3.0
    assert_books_close(tank)
