"""A set point out of reach, of a tank that is heated and cooled."""

import math

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.regulator.alarms import AlarmRegister
from thermoctl.regulator.balance.feasible import Feasibility
from thermoctl.regulator.balance.reach_alarms import DRIVEN
from thermoctl.regulator.balance.sides import FeasibilitySides
from thermoctl.regulator.balance.wanted import Wanted
from thermoctl.signals import Measurement, Mode, State

UNREACHABLE = "setpoint.unreachable"
BOARDS = {"daq": {"kind": "simulated"}}


class Tank:
    """8 l in a room about 22 degC: a loss of 6 W/K, a heater and a cooler behind lags."""

    def __init__(self, setpoint_c, heater_w=1000.0, cooler_w=60.0, seed=1, noise_k=0.01):
        loop = {
            "setpoint_c": setpoint_c,
            "trip_above_c": 90.0,
            "trip_below_c": -9.0,
            "mode": "auto",
            "controller": {"kind": "adaptive", "action": "heat-cool", "cooling_ratio": 0.1},
            "actuator": {"board": "daq", "output": "heater"},
            "cooler": {"board": "daq", "output": "cooler"},
        }
        self.regulator = regulator_for(load({"boards": BOARDS, "loops": {"tank": loop}}))
        self.heater_w, self.cooler_w, self.noise_k = heater_w, cooler_w, noise_k
        self.water_c = self.shown_c = 22.0
        self.element = self.power = self.t_s = 0.0
        self.rng, self.told = np.random.default_rng(seed), {}

    def run(self, seconds):
        for _ in range(seconds):
            self.element += (self.power - self.element) / 15.0
            full_w = self.heater_w if self.element > 0.0 else self.cooler_w
            room_c = 22.0 + 0.3 * math.sin(self.t_s / 430.0)
            flow_w = full_w * self.element - 6.0 * (self.water_c - room_c)
            self.water_c += flow_w / 33_500.0
            self.shown_c += (self.water_c - self.shown_c) / 6.0
            reading_c = self.shown_c + self.noise_k * self.rng.standard_normal()
            step = self.regulator.step(Measurement(self.t_s, reading_c))
            self.power, self.t_s = step.command.power, self.t_s + 1.0
            for alarm in step.alarms:
                self.told.setdefault(alarm.code, (step.t_s, alarm.text))
        return step


@pytest.mark.slow
def test_what_the_cooler_cannot_hold_is_told_with_the_lowest_temperature_it_can():
    tank = Tank(5.0)
    step = tank.run(5400)
    told_s, text = tank.told[UNREACHABLE]
    assert told_s < 4000.0
    assert text.startswith("expected at least ")
    assert step.state is State.RUN
    assert tank.power == -1.0
    assert set(tank.told) == {UNREACHABLE}  # and nothing else drives what the cooler is cooling
    lowest_c = 22.0 - 60.0 / 6.0
    assert abs(step.feasible.highest_c - lowest_c) < 3.0 * step.feasible.highest_sd_k
    assert step.feasible.holding_power < -1.0


@pytest.mark.slow
def test_what_the_heater_cannot_hold_is_told_as_ever():
    tank = Tank(80.0, heater_w=200.0)
    step = tank.run(5400)
    assert tank.told[UNREACHABLE][1].startswith("expected at most ")
    assert abs(step.feasible.highest_c - (22.0 + 200.0 / 6.0)) < 3.0 * step.feasible.highest_sd_k


def test_a_cooler_s_balance_begins_anew_after_the_heater_that_makes_up_for_everything():
    balance = FeasibilitySides(1.0, -1.0, AlarmRegister(), lambda name, **fields: None)
    wanted = Wanted(15.0, 1.0, Mode.AUTO)

    def run(seconds, applied, rate):
        for second in range(seconds):
            if balance.observe(1.0, applied, 22.0 + rate * second, 20.0):
                balance.reckon(wanted, float(second))

    run(900, -1.0, -0.005)
    assert balance._cooler.belief.gain_known
    heater = balance._heater.belief
    run(1, 0.3, 0.0)
    assert balance._cooler.belief is None
    assert balance._heater.belief is heater
    run(900, -1.0, -0.005)
    assert balance._cooler.belief.gain_known


@pytest.mark.slow
def test_what_holds_has_the_sign_of_whoever_gives_it():
    for setpoint_c, full_w in ((18.0, 60.0), (30.0, 1000.0)):
        tank = Tank(setpoint_c)
        holding = 6.0 * (setpoint_c - 22.0) / full_w
        assert tank.run(5400).feasible.holding_power == pytest.approx(holding, abs=0.05)
        assert tank.told == {}


def test_a_cooler_stuck_on_drives_though_it_taught_that_less_power_cools():
    told = set()
    alarms = AlarmRegister()
    balance = Feasibility(1.0, alarms, lambda name, **fields: told.add(name))
    rng, shown_c = np.random.default_rng(1), 5.0
    for second in range(10_000):
        since_s = second - 2000.0
        applied = 0.46 if since_s < 0.0 else max(0.46 - since_s / 400.0, 0.0)
        if since_s > 0.0:  # goods behind the air: it falls the slower the longer it has
            shown_c -= 0.006 * math.exp(-since_s / 600.0) + 0.0005
        if balance.observe(1.0, applied, shown_c + 0.03 * rng.standard_normal(), 150.0):
            balance.reckon(Wanted(5.0, 1.0, Mode.AUTO, power_cools=True), float(second))
    assert balance.belief.gain > 0.0
    assert {row.code for row in alarms.rows()} == {DRIVEN}
