"""A set point out of reach is granted, and said to be out of reach."""

import math

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.signals import Measurement, Mode, SetPoint, State

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

UNREACHABLE = "setpoint.unreachable"
DRIVEN = "plant.driven"


class Tank:
    """Water that `heater_w` warms and `loss_w_per_k` cools towards 22 degC, read with a lag."""

    def __init__(self, litres, heater_w, loss_w_per_k, water_c=22.0, seed=1, **keys):
        self.per_k = 4181.0 * litres
        self.heater_w, self.loss_w_per_k = heater_w, loss_w_per_k
        self.water_c, self.element, self.sensor_c = water_c, 0.0, water_c
        self.t_s, self.power = 0.0, 0.0
        self.shorted = None
        self.least = None
        self.rng = np.random.default_rng(seed)
        loop = {"setpoint_c": 80.0, "trip_above_c": 95.0, "mode": "auto", **keys}
        self.regulator = regulator_for(load({"loops": {"tank": loop}}))
        self.period_s = float(keys.get("period_s", 1.0))
        self.events = []

    def run(self, seconds):
        """Advance and return the last step."""
        h = self.period_s
        for _ in range(round(seconds / h)):
            given = self.power if self.shorted is None else self.shorted
            self.element += (1.0 - math.exp(-h / 12.0)) * (given - self.element)
            loss_w = self.loss_w_per_k * (self.water_c - 22.0)
            self.water_c += h * (self.heater_w * self.element - loss_w) / self.per_k
            self.sensor_c += (1.0 - math.exp(-h / 5.0)) * (self.water_c - self.sensor_c)
            reading_c = self.sensor_c + 0.01 * self.rng.standard_normal()
            self.t_s += h
            step = self.regulator.step(Measurement(self.t_s, reading_c))
            self.power = step.command.power
            if self.least is not None:
                self.power = max(self.power, self.least)
                self.regulator.applied(self.power)
            self.events += [each for each in step.events if each.name == UNREACHABLE]
        return step


def codes(step):
    return [alarm.code for alarm in step.alarms if alarm.active]


@pytest.mark.slow
def test_fifty_watts_in_twenty_litres_are_told_from_a_cold_start():
    tank = Tank(20.0, 50.0, 2.0, period_s=10.0)
    step = tank.run(3 * 3600)
    assert codes(step) == [UNREACHABLE]
    assert [each.fields["text"] for each in tank.events] == [step.alarms[0].text]
    assert step.alarms[0].priority == 2
    assert "got a set point of 80 degC" in step.alarms[0].text
    assert step.setpoint_c == 80.0
    step = tank.run(6 * 3600)
    assert abs(step.feasible.highest_c - 47.0) < 3.0 * step.feasible.highest_sd_k
    assert len(tank.events) == 1


def test_a_plant_at_its_limit_is_told_although_nothing_moves():
    check = {"enabled": False}  # it would ask, and what a question shows is another test's
    tank = Tank(20.0, 50.0, 2.0, water_c=47.0, period_s=10.0, heater_check=check)
    step = tank.run(3600)
    assert codes(step) == [UNREACHABLE]
    assert "at most about 47" in step.alarms[0].text


def test_the_alarm_ends_with_a_set_point_that_can_be_held():
    tank = Tank(2.0, 100.0, 4.0)
    assert codes(tank.run(1500)) == [UNREACHABLE]
    tank.regulator.request(SetPoint(40.0))
    assert codes(tank.run(300)) == []
    tank.regulator.request(SetPoint(80.0))
    assert codes(tank.run(300)) == [UNREACHABLE]
    assert len(tank.events) == 2


def test_nothing_is_said_while_the_mode_is_another():
    tank = Tank(2.0, 100.0, 4.0)
    assert codes(tank.run(1500)) == [UNREACHABLE]
    tank.regulator.request(Mode.OFF)
    assert codes(tank.run(30)) == []


@pytest.mark.parametrize(
    ("litres", "heater_w", "loss_w_per_k"), [(8.0, 1500.0, 5.0), (1.0, 60.0, 0.5)]
)
def test_what_can_be_held_raises_no_alarm_and_is_foretold(litres, heater_w, loss_w_per_k):
    tank = Tank(litres, heater_w, loss_w_per_k, setpoint_c=45.0)
    while tank.water_c < 40.0:
        told = tank.run(10).feasible
    began_s = tank.t_s
    while tank.water_c < 44.9:
        step = tank.run(1)
    assert abs(told.arrival_s - (tank.t_s - began_s)) < 3.0 * told.arrival_sd_s
    step = tank.run(600)
    assert step.feasible.arrival_s == 0.0
    holding = loss_w_per_k * 23.0 / heater_w
    assert abs(step.feasible.holding_power - holding) < 3.0 * step.feasible.holding_sd
    assert step.feasible.holding_sd < 0.1
    assert tank.events == []


def test_it_is_kept_beside_any_controller():
    tank = Tank(8.0, 1500.0, 5.0, setpoint_c=45.0, controller="on-off")
    step = tank.run(1800)
    assert step.feasible.holding_power == pytest.approx(5.0 * 23.0 / 1500.0, abs=0.05)


def test_a_gap_of_unknown_power_forgets_the_balance():
    tank = Tank(8.0, 1500.0, 5.0, setpoint_c=45.0)
    tank.run(600)
    tank.t_s += 3600.0
    tank.water_c = tank.sensor_c = 25.0
    tank.run(5)
    assert tank.regulator._feasibility.belief is None


def test_a_cooler_is_told_the_lowest_temperature():
    tank = Tank(2.0, -60.0, 2.0, setpoint_c=-15.0, trip_below_c=-30.0,
                controller={"kind": "adaptive", "action": "cool"})  # fmt: skip
    step = tank.run(2400)
    assert codes(step) == [UNREACHABLE]
    assert "at least" in step.alarms[0].text
    assert abs(step.feasible.highest_c - (22.0 - 30.0)) < 3.0 * step.feasible.highest_sd_k


@pytest.mark.parametrize(("stuck", "after_s"), [(0.25, 1500), (0.35, 600)])
def test_heat_that_nobody_asked_for_is_told(stuck, after_s):
    check = {"enabled": False}  # it looks for an output that is stuck at much more
    tank = Tank(8.0, 1500.0, 12.0, setpoint_c=40.0, heater_check=check)
    assert codes(tank.run(1500)) == []
    tank.shorted = stuck
    step = tank.run(after_s)
    assert step.command.power == 0.0
    assert codes(step) == [DRIVEN]
    assert "come to 40 degC without power, it moves by +" in step.alarms[0].text


def test_an_output_at_little_more_than_what_holds_is_told_when_the_water_does_not_come_back():
    tank = Tank(8.0, 1500.0, 12.0, setpoint_c=40.0)
    assert codes(tank.run(1500)) == []
    tank.shorted = 12.0 * 18.0 / 1500.0 + 0.02
    assert codes(tank.run(2700)) == [DRIVEN]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_small_plant_that_stands_far_above_its_set_point_without_power_is_told(seed):
    check = {"enabled": False}
    plant = Tank(5e-4, 1.0, 0.023, seed=seed, setpoint_c=50.0, heater_check=check)
    plant.shorted = 1.0
    step = plant.run(1200)
    assert step.command.power == 0.0
    assert plant.water_c > 64.0
    assert codes(step) == [DRIVEN]


@pytest.mark.parametrize("stuck", [0.3, 1.0])
def test_an_output_stuck_on_since_before_a_start_that_knows_nothing_is_told(stuck):
    tank = Tank(8.0, 1500.0, 12.0, water_c=40.0, setpoint_c=40.0, trip_above_c=200.0)
    tank.element = tank.shorted = stuck
    assert codes(tank.run(220)) == []  # heat of before may be on its way for so long
    step = tank.run(200)
    assert step.command.power == 0.0
    assert codes(step) == [DRIVEN]


def test_water_of_which_nothing_is_known_cools_down_without_a_word():
    tank = Tank(8.0, 1500.0, 12.0, water_c=60.0, setpoint_c=40.0)
    for _ in range(20):
        assert codes(tank.run(300)) == []


def test_water_that_cools_down_to_its_set_point_or_rests_above_it_is_not_driven():
    tank = Tank(2.0, 300.0, 4.0, setpoint_c=40.0)
    tank.run(900)
    tank.regulator.request(SetPoint(15.0))
    for _ in range(20):
        assert codes(tank.run(300)) == []


@pytest.mark.parametrize("setpoint_c", [15.0, 20.0])
def test_a_set_point_below_the_room_is_told_of_a_heater_that_never_had_to_heat(setpoint_c):
    tank = Tank(2.0, 300.0, 4.0, water_c=24.0, setpoint_c=setpoint_c, period_s=2.0)
    assert codes(tank.run(3600)) == []  # on its way still
    step = tank.run(4 * 3600)
    assert step.command.power == 0.0
    assert codes(step) == [DRIVEN]


def test_what_an_output_cannot_keep_back_drives_a_plant_though_it_says_so():
    tank = Tank(8.0, 1500.0, 2.0, water_c=30.0, setpoint_c=37.5)
    tank.run(1200)
    tank.least = 0.08
    step = tank.run(900)
    assert step.command.power == 0.0
    assert codes(step) == [DRIVEN]
    assert tank.water_c < 40.5
    tank.least = 0.0
    assert codes(tank.run(1500)) == []


def test_a_heater_that_cools_is_reversed_and_the_plant_not_driven():
    tank = Tank(8.0, -1500.0, 12.0, water_c=39.0, setpoint_c=45.0)
    step = tank.run(1500)
    assert step.state is State.LATCHED
    assert codes(step) == ["heater.reversed"]
