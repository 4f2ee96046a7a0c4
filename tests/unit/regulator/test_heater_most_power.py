"""The watch over a heater of which a loop never asks for more than a part."""

import pytest

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.regulator.heater.account import Account
from thermoctl.regulator.heater.check import HeaterCheck
from thermoctl.regulator.heater.known import KnownHeater
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen
from thermoctl.signals import State

LITRES = 0.009  # K/s: a fifth of what 1.5 kW make of 8 l


@pytest.mark.parametrize("power_max", [1.0, 0.85, 0.5, 0.3, 0.1])
def test_a_sensor_elsewhere_ends_the_heat_whatever_the_most_power_is(vessel_with, power_max):
    plant = vessel_with(gain=0.045, weakest_k_per_s=LITRES, power_max=power_max)
    plant.shows = lambda water_c: 30.0
    plant.run(7000)
    assert plant.names() == ["heater.questioned"] * 2 + ["heater.no_response"]
    assert plant.supervisor.state is State.LATCHED
    assert plant.given_s < 60.0 / power_max + 70.0  # of full power


@pytest.mark.parametrize("power", [0.5, 0.3, 0.2])
def test_little_power_latches_at_the_second_bad_answer_however_late_it_is(vessel_with, power):
    plant = vessel_with(gain=0.045, weakest_k_per_s=LITRES)
    plant.shows, plant.asks_for = lambda water_c: 30.0, power
    plant.run(4.0 * 60.0 / power**3)
    assert plant.names() == ["heater.questioned"] * 2 + ["heater.no_response"]
    assert plant.supervisor.state is State.LATCHED


@pytest.mark.parametrize("power_max", [0.5, 0.2])
@pytest.mark.parametrize("gain", [0.045, 0.01, 0.002])
def test_a_sound_heater_of_which_little_is_asked_is_not_condemned(vessel_with, gain, power_max):
    plant = vessel_with(gain=gain, weakest_k_per_s=0.2 * gain, power_max=power_max)
    plant.run(4 * 3600)
    assert plant.supervisor.state is State.RUN
    assert plant.water_c > 20.0 + 0.5 * power_max * gain / plant.cools_per_s


def test_a_bad_answer_stands_however_long_little_power_takes_to_the_next(vessel_with):
    plant = vessel_with(gain=0.045, weakest_k_per_s=LITRES)
    plant.shows, plant.asks_for = lambda water_c: 30.0, 0.5
    assert plant.run(600).names() == ["heater.questioned"]
    plant.asks_for = 0.015
    assert plant.run(1800).names() == ["heater.questioned"]
    plant.run(900)
    assert plant.supervisor.state is State.LATCHED


@pytest.mark.slow
def test_a_reading_that_stands_under_the_most_power_there_is_is_asked(vessel_with):
    plant = vessel_with(gain=0.02, power_max=0.5)
    plant.run(6 * 3600)
    assert set(plant.names()) == {"heater.questioned", "heater.answered"}
    assert plant.supervisor.state is State.RUN


@pytest.mark.parametrize("power_max", [1.0, 0.85, 0.3])
def test_all_the_heat_counts_that_a_loop_gives_at_most(power_max):
    account, before = Account(LITRES, power_max), Seen(0.0, 25.0, (0.0,) * len(LAGS_S))
    for count in range(1, 51):
        now = Seen(4.0 * count, 25.0, (4.0 * count * power_max,) * len(LAGS_S))
        account.add(power_max, before, now)
        before = now
    assert account.denies_any(0.005)
    held = Account(LITRES, power_max)
    held.add(0.8 * power_max, Seen(0.0, 25.0, (0.0,) * len(LAGS_S)), now)
    assert not held.denies_any(0.005)


@pytest.mark.parametrize("power_max", [1.0, 0.5])
def test_a_remembered_heater_is_outdone_by_what_no_such_power_brings(power_max):
    heater, known = KnownHeater(power_max), Gain(0.01, 1e-4, 2)
    heater.recall(known)
    before, more = Seen(0.0, 25.0, (0.0,) * len(LAGS_S)), 1.5 * known.mean * power_max
    outdone = [
        heater.outdone(power_max, before, Seen(400.0, 25.0 + 400.0 * rate, before.heat_s), 0.005)
        for rate in (known.mean * power_max, more)
    ]
    assert outdone == [False, True]


def test_the_check_is_told_the_most_power_of_its_loop():
    table = {"setpoint_c": 37.5, "trip_above_c": 60.0, "heater_w": 1500.0, "power_max": 0.3}
    assert plan_for(load({"loops": {"tank": table}}).loops["tank"]).heater_check == HeaterCheck(
        1500.0 / 400.0 / 4186.0, power_max=0.3
    )
