"""Heaters that fail on a Temperature Control Lab, which loses in two minutes what it is given.

Every test prints when the power was cut, when it latched, and how far the heater rose.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.app.commands.compare import contender
from thermoctl.app.settings import load
from thermoctl.app.sim import profile
from thermoctl.model.sensor import TMP36, Sensor
from thermoctl.plant.acquisition import Acquisition
from thermoctl.plant.lab import followed, start, step
from thermoctl.regulator import Regulator
from thermoctl.regulator.heater.check import HeaterCheck
from thermoctl.signals import Mode, RawSample, State
from thermoctl.studies.compare.plants import plant

_, TABLE = load(profile("aquarium")).loop()
HALF_S = 0.5
IN_AIR_S = 20.0
"""What a sensor takes to come to the temperature of the room."""
FAULTS = {
    "dead": (lambda power: 0.0, {"heater.no_response"}),
    "inverted": (lambda power: -power, {"heater.reversed", "trip.under_temperature"}),
    "stuck on": (lambda power: 1.0, {"heater.stuck_on"}),
    "sensor out": (lambda power: power, {"heater.no_response"}),
}

TOLD = {"heater.stuck_on", "plant.driven"}


class Lab:
    """A board under a controller; a second is a cycle."""

    def __init__(self, controller, seed):
        where = plant("tclab", seed)
        plan = contender(controller, TABLE).plan_for(where)
        plan = replace(plan, setpoint_c=where.held_c, mode=Mode.AUTO, heater_check=HeaterCheck())
        self.regulator, self.parameters = Regulator(plan), where.parameters
        self.acquisition = Acquisition(where.acquisition, np.random.default_rng(seed))
        self.sensor = Sensor(TMP36, where.acquisition.reference_v)
        self.scale = float(where.acquisition.full_scale)
        self.heat = start(self.parameters)
        self.sensor_c, self.t_s, self.power = self.heat.first_c, 0.0, 0.0
        self.does, self.fallen, self.steps = lambda power: power, False, []
        self.stands_c = math.nan  # where a reading stands still, but for its noise

    def live(self, seconds):
        for _ in range(seconds):
            self._warm()
            seen_c = self.sensor_c if math.isnan(self.stands_c) else self.stands_c
            counts = self.acquisition.convert(TMP36.volts(seen_c))
            raw = RawSample(self.t_s, float(counts), self.scale)
            told = self.regulator.step(self.sensor.measure(raw, self.t_s))
            self.power = round(255.0 * told.command.power) / 255.0
            self.regulator.applied(self.power)
            self.steps.append(told)
            self.t_s += 1.0
        return self.steps[-1]

    def _warm(self):
        p = self.parameters
        self.acquisition.advance(1.0)
        watts = (self.does(self.power) * p.first_w, 0.0)
        for _ in range(2):
            before_c = self.heat.first_c
            self.heat = step(p, self.heat, watts, p.room_c, HALF_S)
            where_c = (p.room_c, p.room_c) if self.fallen else (before_c, self.heat.first_c)
            lag_s = IN_AIR_S if self.fallen else p.sensor_lag_s
            self.sensor_c = followed(self.sensor_c, *where_c, HALF_S / lag_s)

    def questions(self):
        events = [event.name for told in self.steps for event in told.events]
        return events.count("heater.questioned")


@pytest.mark.parametrize("controller", ["adaptive", "pid"])
@pytest.mark.slow
def test_a_healthy_lab_is_brought_to_its_set_point_and_is_not_asked(controller):
    for seed in range(8):
        lab = Lab(controller, seed)
        assert lab.live(1200).state is State.RUN
        assert lab.questions() == 0, seed
        assert abs(lab.heat.first_c - 50.0) < 0.5


# An output that is stuck on looks sound while it warms up, until it should be off.
CASES = [
    *((fault, 60, 400, 10.0) for fault in FAULTS if fault != "stuck on"),
    *((fault, 700, 480, 18.0) for fault in FAULTS),
]


@pytest.mark.parametrize("controller", ["adaptive", "pid"])
@pytest.mark.parametrize(("fault", "at_s", "latched_s", "rise_k"), CASES)
@pytest.mark.slow
def test_a_fault_of_a_lab_ends_latched_by_its_name(controller, fault, at_s, latched_s, rise_k):
    does, codes = FAULTS[fault]
    for seed in range(4):
        lab = Lab(controller, seed)
        lab.live(at_s)
        lab.does, lab.fallen = does, fault == "sensor out"
        began_c, top_c, cut_s, after_s = lab.heat.first_c, -math.inf, math.nan, 0
        while (told := lab.live(1)).state is not State.LATCHED:
            after_s += 1
            top_c = max(top_c, lab.heat.first_c)
            if lab.power == 0.0 and math.isnan(cut_s):
                cut_s = after_s
            assert after_s < latched_s, (seed, told.alarms)
        code = next(alarm.code for alarm in told.alarms if alarm.latched)
        print(
            f"{fault}, {controller}, {at_s} s, lab {seed}: {code}, cut after {cut_s:.0f} s, "
            f"latched after {after_s} s, {top_c - began_c:+.1f} K"
        )
        assert code in codes
        assert lab.power == 0.0
        assert top_c - began_c < rise_k


@pytest.mark.parametrize("controller", ["adaptive", "pid"])
@pytest.mark.parametrize("below_k", [1.0, 3.0])
@pytest.mark.slow
def test_a_reading_that_stands_still_below_the_set_point_of_a_lab_is_latched(controller, below_k):
    for seed in range(4):
        lab = Lab(controller, seed)
        lab.live(1500)
        lab.stands_c, began_c = 50.0 - below_k, lab.heat.first_c
        top_c, after_s = -math.inf, 0
        while lab.live(1).state is not State.LATCHED:
            after_s += 1
            top_c = max(top_c, lab.heat.first_c)
            assert after_s < 400, seed
        print(f"{controller}, lab {seed}: latched after {after_s} s, {top_c - began_c:+.1f} K")
        assert top_c - began_c < 25.0


@pytest.mark.parametrize("controller", ["adaptive", "pid"])
@pytest.mark.slow
def test_an_output_of_a_lab_that_sticks_above_what_holds_gets_no_power_and_is_told(controller):
    for seed in range(3):
        lab = Lab(controller, seed)
        lab.live(1200)
        held = np.mean([told.command.power for told in lab.steps[-200:]])
        lab.does, began = lambda _, share=held + 0.15: share, len(lab.steps)
        lab.live(500)
        after = lab.steps[began:]
        told_s = next(n for n, told in enumerate(after) if TOLD & {a.code for a in told.alarms})
        above_k = lab.heat.first_c - 50.0
        print(f"stuck above what holds, {controller}, lab {seed}: {told_s} s, {above_k:+.1f} K")
        assert told_s < 480
        assert max(told.command.power for told in after[60:]) < 0.05


@pytest.mark.parametrize(
    ("seed", "swing_k", "period_s"), [(1, 2.5, 60), (1, 2.0, 40), (2, 1.5, 55), (7, 2.5, 40)]
)
@pytest.mark.slow
def test_a_sensor_in_air_that_swings_is_not_taken_for_one_that_answers(seed, swing_k, period_s):
    lab = Lab("adaptive", seed)
    lab.live(700)
    lab.fallen, room_c, began_s = True, lab.parameters.room_c, lab.t_s
    while lab.steps[-1].state is not State.LATCHED:
        after_s = lab.t_s - began_s
        assert after_s < 480, lab.questions()
        air_c = room_c + swing_k * math.sin(2.0 * math.pi * after_s / period_s)
        lab.parameters = replace(lab.parameters, room_c=air_c)
        lab.live(1)
    print(f"air that swings by {swing_k} K in {period_s} s, lab {seed}: latched after {after_s} s")
