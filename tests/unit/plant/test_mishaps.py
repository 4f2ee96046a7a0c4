"""Mishaps of heater and sensor, on the rig."""

import numpy as np
import pytest

from thermoctl.plant.disturbances import disturb
from thermoctl.plant.parameters import TankParameters
from thermoctl.plant.tank import Tank


def rig(name=None, amount=None, drive=0.7):
    """Return the rig after a minute at half power, and what befell it before."""
    tank = Tank(TankParameters(initial_c=37.5), np.random.default_rng(1))
    if name is not None:
        disturb(tank, name, amount)
    tank.advance(60.0, drive)
    return tank


@pytest.mark.parametrize(
    ("name", "share"), [("element-dead", 0.0), ("inverted", -0.49), ("stuck-on", 1.0)]
)
def test_a_heater_gives_what_its_mishap_says_and_the_books_still_balance(name, share):
    tank = rig(name)
    assert tank.heater_w / (1500.0 * tank.stage.mains**2) == pytest.approx(share, abs=0.01)
    assert abs(tank.ledger.error_j) < 1.0
    assert "heater" in disturb(tank, name, 5.0)


def test_power_that_cools_cools_more_than_none():
    assert rig("inverted").temperature_c < rig("element-dead").temperature_c - 0.5
    assert rig().temperature_c > rig("element-dead").temperature_c + 0.5


def test_a_heater_is_sound_again_when_its_mishap_is_over():
    tank = rig("element-dead", 10.0)
    assert tank.heater_w > 600.0


def test_a_sensor_that_is_out_shows_the_room_and_comes_back_to_the_water():
    tank = rig("sensor-out", 300.0)
    assert 22.0 < tank.sensor_c < 34.0
    tank.advance(240.0, 0.3)
    assert tank.sensor_c == pytest.approx(22.0, abs=0.5)
    tank.advance(60.0, 0.3)
    assert tank.sensor_c == pytest.approx(tank.temperature_c, abs=0.3)


def test_a_sensor_that_stands_still_does_so_to_the_last_bit():
    tank = rig()
    shown_c = tank.sensor_c
    disturb(tank, "sensor-stuck", 60.0)
    tank.advance(59.0, 1.0)
    assert tank.sensor_c == shown_c
    tank.advance(60.0, 1.0)
    assert tank.sensor_c > shown_c + 1.0
