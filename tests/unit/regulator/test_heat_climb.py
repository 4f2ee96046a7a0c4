"""Faults that begin while a plant is heated up for the first time, and what is no fault then."""

import math
from collections import deque

import numpy as np
import pytest

from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.check import HeaterCheck
from thermoctl.regulator.heater.climb import Climb
from thermoctl.regulator.heater.doubt import HeatDoubt
from thermoctl.regulator.heater.response import Gain, Seen
from thermoctl.regulator.heater.watch import HeaterWatch
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.supervisor import Supervisor
from thermoctl.signals import Measurement, State

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

HEAT = (0.0,) * 6


class Plant:
    """A watched vessel; `does` is what becomes of a power, `shows` what is read of the water."""

    def __init__(self, gain=0.04, loss=0.008, lag_s=20.0, seed=1):
        self.gain, self.loss, self.pole_s = gain, loss, 0.5 * lag_s
        self.events, self.rng = deque(), np.random.default_rng(seed)
        self.supervisor = Supervisor(Limits(200.0, -50.0, -50.0, 200.0), self.emit)
        self.watch = HeaterWatch(HeaterCheck(), 1.0, self.supervisor, self.emit)
        self.t_s, self.water_c, self.applied = 0.0, 25.0, 0.0
        self.first = self.second = 0.0
        self.does = lambda power: power
        self.shows = lambda water_c: water_c

    def emit(self, name, **fields):
        self.events.append(name)

    def names(self):
        return [name for name in self.events if name.startswith("heater.")]

    def run(self, seconds, power):
        """Give `power`, a number or a function of the time, wherever nobody forbids it."""
        for _ in range(seconds):
            self.first += (self.does(self.applied) - self.first) / self.pole_s
            self.second += (self.first - self.second) / self.pole_s
            self.water_c += self.gain * self.second - self.loss
            self.t_s += 1.0
            reading_c = self.shows(self.water_c) + 0.01 * self.rng.standard_normal()
            self.supervisor.judge(Measurement(self.t_s, reading_c), self.t_s, 1.0)
            self.watch.observe(self.t_s, 1.0, reading_c, self.applied)
            free = self.supervisor.rule(self.t_s, 0.0) is State.RUN and not self.watch.asks
            asked = power(self.t_s) if callable(power) else power
            self.applied = asked if free else 0.0
        return self


def known(**keys):
    """Return a plant whose heater has been seen to heat."""
    return Plant(**keys).run(1200, lambda t_s: 0.6 if t_s % 240.0 < 120.0 else 0.0)


def heat_given(plant, seconds, power=1.0):
    """Run `plant` at `power`, and return the seconds of full power that it took."""
    given = 0.0
    for _ in range(seconds):
        plant.run(1, power)
        given += plant.applied
    return given


@pytest.mark.parametrize(
    ("lag_s", "after_s", "below_k"),
    [(20.0, 60, 1.0), (30.0, 60, 0.0), (45.0, 80, 1.0), (45.0, 120, 3.0), (70.0, 180, 3.0)],
)
def test_a_reading_that_stops_in_the_first_warm_up_ends_the_heat(lag_s, after_s, below_k):
    plant = Plant(gain=0.045, loss=0.004, lag_s=lag_s)
    plant.run(after_s, lambda t_s: 0.7 if 30.0 < t_s < 60.0 else 1.0)
    stopped_c = plant.water_c - below_k
    plant.shows = lambda _: stopped_c
    assert heat_given(plant, 2400) < 600.0
    assert plant.supervisor.state is State.LATCHED


@pytest.mark.parametrize("after_s", [8, 20, 30])
@pytest.mark.parametrize("lag_s", [15.0, 30.0])
@pytest.mark.slow
def test_a_reading_that_stops_before_there_is_a_climb_gets_four_minutes_of_heat(lag_s, after_s):
    plant = Plant(gain=0.11, loss=0.0, lag_s=lag_s).run(after_s, 1.0)
    stopped_c = plant.water_c
    plant.shows = lambda _: stopped_c
    assert heat_given(plant, 4200) < 240.0
    assert plant.supervisor.state is State.LATCHED


@pytest.mark.parametrize("after_s", [80, 120, 240])
def test_a_heater_that_dies_in_the_first_warm_up_is_named(after_s):
    plant = Plant(lag_s=40.0).run(after_s, 1.0)
    plant.does = lambda _: 0.0
    plant.run(1800, 1.0)
    assert plant.supervisor.state is State.LATCHED
    assert plant.names()[-1] == "heater.no_response"


def test_a_heater_that_fails_while_its_power_is_reduced_is_asked_once_there_is_full_power():
    plant = Plant(gain=0.1, loss=0.02, lag_s=15.0).run(120, 1.0).run(30, 0.5)
    plant.does = lambda power: 0.2 * power
    begun_s = plant.t_s
    plant.run(120, lambda t_s: min(0.5 + (t_s - begun_s) / 200.0, 1.0)).run(900, 1.0)
    assert "heater.questioned" in plant.names()


@pytest.mark.parametrize("tau_s", [20.0, 45.0])
def test_a_sensor_in_the_air_gets_no_heat_while_nothing_explains_its_fall(tau_s):
    plant = known(lag_s=30.0)
    pulled_s, warm_c = plant.t_s, plant.water_c
    plant.shows = lambda _: 22.0 + (warm_c - 22.0) * math.exp(-(plant.t_s - pulled_s) / tau_s)
    assert heat_given(plant, 1800) < 200.0
    assert plant.supervisor.state is State.LATCHED


def test_a_reading_that_stands_still_at_rest_is_asked_when_it_needs_twice_the_power():
    plant = known(gain=0.1, loss=0.002).run(2400, 0.02)
    still_c, begun_s = plant.water_c, plant.t_s
    plant.shows = lambda _: still_c
    given = heat_given(plant, 1500, lambda t_s: 0.02 + (t_s - begun_s) * 2e-4)
    assert "heater.no_response" in plant.names()
    assert 0.1 * given < 10.0


@pytest.mark.parametrize("tau_s", [10.0, 30.0, 60.0])
def test_a_sensor_that_comes_to_the_temperature_of_its_water_is_no_climb(tau_s):
    plant = Plant(gain=1e-3, loss=0.0)
    plant.shows = lambda water_c: water_c - 15.0 * math.exp(-plant.t_s / tau_s)
    plant.run(3600, 1.0)
    assert plant.supervisor.state is State.RUN
    assert set(plant.names()) <= {"heater.questioned", "heater.answered"}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_first_warm_up_to_what_a_plant_can_reach_is_no_fault(seed):
    plant = Plant(gain=0.05, loss=0.0, seed=seed)
    plant.does = lambda power: power - (plant.water_c - 25.0) / 20.0
    plant.run(3600, 1.0)
    assert plant.supervisor.state is State.RUN
    assert plant.names().count("heater.questioned") <= 1


def climbing(readings_c, powers=None, known=None):
    """Return what is thought of readings 4 s apart under `powers`, full when none are given."""
    powers = [1.0] * len(readings_c) if powers is None else powers
    climb, before = Climb(), Seen(0.0, readings_c[0], HEAT)
    for n, reading_c in enumerate(readings_c[1:], 1):
        now, block = Seen(4.0 * n, reading_c, HEAT), Block(4.0, powers[n], reading_c, 0.01)
        climb.observe(known, block, before, now, jumped=False)
        before = now
    return climb


def test_as_much_power_has_to_raise_the_reading_as_before_whatever_the_gain():
    rise = np.concatenate((np.arange(20) * 0.2, np.full(20, 3.8)))
    assert not climbing(rise[:20]).stalled(0.01)
    assert climbing(rise).stalled(0.01)
    assert climbing(rise).shown == pytest.approx(0.05)
    assert climbing(rise, known=Gain(0.1, 0.01, 2)).stalled(0.01)


def test_a_climb_that_is_weak_beside_the_gain_is_none():
    rise = np.concatenate((np.arange(20) * 0.2, np.full(20, 3.8)))
    assert not climbing(rise, known=Gain(0.5, 0.01, 2)).stalled(0.01)


def test_of_a_climb_that_is_forgotten_nothing_is_expected():
    known, sd_k = Gain(0.05, 0.001, 2, 0.005), 0.01
    rise, stand = np.arange(20) * 0.2, np.full(500, 3.8)
    fall = 3.8 - 0.02 * np.arange(400)
    climb = climbing(np.concatenate((rise, stand, fall)), [1.0] * 20 + [0.0] * 900, known)
    assert not climb.stalled(sd_k)
    assert climb.calm(sd_k)


def test_a_climb_that_goes_on_after_a_dip_is_asked_about_no_more():
    rise = np.arange(20) * 0.2
    dip = rise[-1] - 0.1 * np.arange(1, 13)
    readings_c = np.concatenate((rise, dip, dip[-1] + 0.12 * np.arange(1, 20)))
    for n in range(20, readings_c.size):
        assert not climbing(readings_c[:n]).stalled(0.01), n


@pytest.mark.parametrize(
    ("fell", "loss"),
    [(0.005, 0.005), (-1.0, 0.0), (0.5, 0.02), (math.nan, 0.02)],
)
def test_after_a_bad_answer_the_loss_is_what_was_seen_without_power(fell, loss):
    doubt, gain = HeatDoubt(), Gain(0.04, 0.001, 2)
    doubt.begin(Seen(0.0, 25.0, HEAT), Seen(4.0, 25.0, (2.0,) * 6))
    assert doubt.loss(gain) == pytest.approx(0.02)
    doubt.distrust(gain, fell)
    assert doubt.loss(gain) == pytest.approx(loss)


@pytest.mark.parametrize(("gain", "lag_s", "began_s"), [(0.045, 30.0, 120), (0.11, 15.0, 60)])
@pytest.mark.parametrize("behind_s", [50.0, 80.0])
def test_a_stirrer_that_stands_in_the_first_warm_up_is_no_heater_that_is_stuck_on(
    gain, lag_s, began_s, behind_s
):
    plant = Plant(gain=gain, loss=0.1 * gain, lag_s=lag_s).run(began_s, 1.0)
    shown = deque([plant.water_c], maxlen=1)

    def behind(water_c):
        shown.append(shown[0] + (water_c - shown[0]) / tau_s)
        return shown[0]

    plant.shows, tau_s, stops_c = behind, behind_s, plant.water_c + 150.0 * gain
    plant.run(300, lambda _: 1.0 if shown[0] < stops_c else 0.0)
    tau_s = 4.0
    plant.run(900, lambda _: 1.0 if shown[0] < stops_c else 0.0)
    assert plant.supervisor.state is State.RUN
    assert "heater.stuck_on" not in plant.names()


@pytest.mark.parametrize(("gain", "lag_s"), [(0.045, 30.0), (0.02, 60.0)])
def test_a_heater_that_sticks_before_its_power_was_ever_reduced_is_told_within_seven_minutes(
    gain, lag_s
):
    plant = Plant(gain=gain, loss=0.1 * gain, lag_s=lag_s).run(200, 1.0)
    plant.does = lambda _: 1.0
    plant.run(420, 0.0)
    assert plant.supervisor.state is State.LATCHED
    assert plant.names()[-1] == "heater.stuck_on"
