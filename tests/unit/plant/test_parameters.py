"""Parameters: sizes, specimens and what is refused."""

import math
from dataclasses import fields

import numpy as np
import pytest

from thermoctl.plant.noise import Wander
from thermoctl.plant.parameters import Bath, Element, Room, TankParameters, Vessel
from thermoctl.plant.tolerances import VARIED, specimen


def test_scaling_to_the_size_of_the_rig_gives_the_rig():
    assert TankParameters.scaled(8.0, 1500.0) == TankParameters()


def test_eight_times_the_volume_has_four_times_the_areas_and_twice_the_way():
    rig, big = TankParameters(), TankParameters.scaled(64.0, 1500.0)
    assert big.vessel.glass_area_m2 == pytest.approx(4.0 * rig.vessel.glass_area_m2)
    assert big.bath.ice_kg == pytest.approx(4.0 * rig.bath.ice_kg)
    assert big.probe.transport_s == pytest.approx(2.0 * rig.probe.transport_s)


def test_an_element_of_any_power_stands_as_far_above_the_water():
    for rated_w in (50.0, 5000.0):
        element = Element(rated_w=rated_w)
        assert element.rated_w / element.to_water_w_per_k == pytest.approx(75.0)
        assert element.capacity_j_per_k / element.to_water_w_per_k == pytest.approx(13.5)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"volume_l": 0.4}, "volume_l"),
        ({"volume_l": 201.0}, "volume_l"),
        ({"volume_l": math.nan}, "volume_l"),
        ({"heater_w": 49.0}, "heater_w"),
        ({"heater_w": math.inf}, "heater_w"),
        ({"ambient_c": -1.0}, "ambient_c"),
        ({"initial_c": 100.0}, "initial_c"),
        ({"ice_kg": -1.0}, "ice_kg"),
    ],
)
def test_a_size_out_of_range_is_refused_by_name(arguments, named):
    with pytest.raises(ValueError, match=named):
        TankParameters.scaled(**arguments)


@pytest.mark.parametrize("part", [Vessel, Element, Room])
def test_every_number_of_a_part_is_checked(part):
    for entry in fields(part):
        with pytest.raises(ValueError, match=entry.name):
            part(**{entry.name: math.nan})


def test_a_bath_of_ice_without_water_is_refused():
    with pytest.raises(ValueError, match="water_kg"):
        Bath(ice_kg=10.0, water_kg=1.0)


def test_no_spread_gives_the_tank_that_was_ordered():
    ordered = TankParameters()
    assert specimen(ordered, np.random.default_rng(0), spread=0.0) == ordered


def test_specimens_differ_in_what_varies_and_in_nothing_else():
    ordered = TankParameters()
    made = specimen(ordered, np.random.default_rng(0), spread=0.1)
    for part_name in ("vessel", "element", "bath", "room", "probe", "supply"):
        varied = VARIED.get(part_name, ())
        for entry in fields(getattr(ordered, part_name)):
            before = getattr(getattr(ordered, part_name), entry.name)
            after = getattr(getattr(made, part_name), entry.name)
            assert (before != after) == (entry.name in varied), entry.name


def test_specimens_spread_as_they_were_told_to():
    rng = np.random.default_rng(1)
    logs = [math.log(specimen(TankParameters(), rng, 0.1).element.lag_s / 13.5) for _ in range(500)]
    assert max(np.abs(logs)) <= 0.2 + 1e-12
    assert np.std(logs) == pytest.approx(0.1, rel=0.15)


@pytest.mark.parametrize("spread", [-0.1, 0.5, math.nan])
def test_an_implausible_spread_is_refused(spread):
    with pytest.raises(ValueError, match="spread"):
        specimen(TankParameters(), np.random.default_rng(0), spread)


@pytest.mark.parametrize("step_s", [0.5, 5.0])
def test_a_wander_keeps_its_spread_and_forgets_at_its_rate_whatever_the_step(step_s):
    wander = Wander(np.random.default_rng(6), deviation=2.0, correlation_s=10.0)
    walk = np.array([wander.advance(step_s) for _ in range(60_000)])
    assert np.std(walk) == pytest.approx(2.0, rel=0.05)
    correlation = np.corrcoef(walk[1:], walk[:-1])[0, 1]
    assert correlation == pytest.approx(math.exp(-step_s / 10.0), abs=0.01)
