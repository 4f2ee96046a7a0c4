"""The watch over a heater and a cooler of one plant, which two lags part from the reading."""

from collections import deque

import numpy as np
import pytest

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.regulator.heater.check import WEAKEST_K_PER_S, HeaterCheck
from thermoctl.regulator.heater.sides import Sides, named, watch_for
from thermoctl.regulator.heater.watch import HeaterWatch
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.recollection import recall_heater, remembering
from thermoctl.regulator.supervisor import Supervisor
from thermoctl.signals import Measurement, State

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

LIMITS = Limits(200.0, -50.0, -50.0, 200.0, power_min=-1.0)
CHECK = HeaterCheck(action="heat-cool")


class Tank:
    """Water in a room of 22 °C; a heater of .04 K/s and a cooler of .01 K/s, both with lags."""

    def __init__(self, seed=1, noise_k=0.01):
        self.events = deque()
        self.supervisor = Supervisor(LIMITS, self.emit)
        self.watch = watch_for(CHECK, 1.0, self.supervisor, self.emit)
        self.rng, self.noise_k = np.random.default_rng(seed), noise_k
        self.t_s, self.water_c, self.applied = 0.0, 22.0, 0.0
        self.hot, self.cold = [0.0, 0.0], [0.0, 0.0]
        self.heats = self.cools = lambda power: power
        self.shows = lambda water_c: water_c

    def emit(self, name, **fields):
        self.events.append((self.t_s, name, fields))

    def told(self, name):
        return [fields["text"] for _, told, fields in self.events if told == name]

    def run(self, seconds, power):
        """Give `power`, a number or a function of the reading, wherever nobody forbids it."""
        reading_c = self.water_c
        for _ in range(round(seconds)):
            for lag, given in (
                (self.hot, self.heats(max(self.applied, 0.0))),
                (self.cold, self.cools(max(-self.applied, 0.0))),
            ):
                lag[0] += (given - lag[0]) / 8.0
                lag[1] += (lag[0] - lag[1]) / 8.0
            loss = 1e-4 * (self.water_c - 22.0)
            self.water_c += 0.04 * self.hot[1] - 0.01 * self.cold[1] - loss
            self.t_s += 1.0
            reading_c = self.shows(self.water_c) + self.noise_k * self.rng.standard_normal()
            self.supervisor.judge(Measurement(self.t_s, reading_c), self.t_s, 1.0)
            self.watch.observe(self.t_s, 1.0, reading_c, self.applied)
            state = self.supervisor.rule(self.t_s, 0.0)
            asked = power(reading_c) if callable(power) else power
            free = state is State.RUN and not self.watch.asks
            self.applied = float(np.clip(asked, -1.0, 1.0)) if free else 0.0
        return self

    def hold(self, setpoint_c, seconds):
        """Hold a set point by what is off it, beside what the tank loses."""
        loss = 1e-4 * (setpoint_c - 22.0)
        steady = loss / (0.04 if loss > 0.0 else 0.01)
        return self.run(seconds, lambda reading_c: steady + 0.6 * (setpoint_c - reading_c))


def known():
    """Return a tank whose heater and cooler were both seen to do what they should."""
    tank = Tank().hold(30.0, 900).hold(15.0, 2400).hold(30.0, 1200)
    assert tank.watch.heater.known.mean == pytest.approx(0.04, rel=0.3)
    assert tank.watch.cooler.known.mean == pytest.approx(0.01, rel=0.4)
    return tank


def test_a_sound_heater_and_a_sound_cooler_are_never_failed():
    tank = known().hold(15.0, 2400).hold(22.0, 1800).hold(18.0, 1800)
    assert tank.supervisor.state is State.RUN
    assert not tank.told("heater.no_response") + tank.told("heater.reversed")
    assert not tank.told("heater.stuck_on")


@pytest.mark.parametrize(
    ("does", "code"),
    [(lambda power: -power, "heater.reversed"), (lambda power: 0.0, "heater.no_response")],
    ids=["inverted", "dead"],
)
@pytest.mark.parametrize("side", ["heater", "cooler"])
def test_either_is_latched_by_its_name_when_it_fails_in_regulation(side, does, code):
    held_c = 30.0 if side == "heater" else 15.0
    tank = known().hold(held_c, 2400)
    if side == "heater":
        tank.heats = does
    else:
        tank.cools = does
    tank.hold(held_c, 3600)
    assert tank.supervisor.state is State.LATCHED
    latched = {alarm.code: alarm.text for alarm in tank.supervisor.alarms.latched()}
    assert list(latched) == [code]
    assert latched[code].startswith("cooler: ") is (side == "cooler")


@pytest.mark.parametrize("held_c", [30.0, 15.0])
def test_a_sensor_that_hangs_in_the_air_latches_on_either_side(held_c):
    tank = known().hold(held_c, 2400)
    tank.shows = lambda water_c: 22.0
    began_c = tank.water_c
    tank.hold(held_c, 3600)
    assert tank.supervisor.state is State.LATCHED
    assert abs(tank.water_c - began_c) < 10.0


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.slow
def test_a_reading_that_stops_is_missed_though_noise_is_more_than_the_cooler_does_in_a_block(seed):
    tank = Tank(seed, noise_k=0.06).hold(30.0, 900).hold(15.0, 4800)
    assert tank.supervisor.state is State.RUN
    tank.shows = lambda water_c: 22.0
    began_c = tank.water_c
    tank.hold(15.0, 1800)
    assert tank.supervisor.state is State.LATCHED
    assert began_c - tank.water_c < 6.0


def test_an_unknown_heater_has_no_more_heat_in_pulses_than_at_once():
    tank = Tank()
    tank.shows = lambda water_c: 22.0
    tank.run(400, lambda reading_c: 1.0 if tank.t_s % 60.0 < 30.0 else -0.2)
    assert len([text for text in tank.told("heater.questioned") if "100%" in text]) == 1


def test_what_the_other_one_does_is_neither_missed_nor_learnt():
    tank = known()
    before, rows = tank.watch.heater.known, len(tank.watch.heater._rows)
    assert rows > 0
    tank.hold(12.0, 1500)
    assert tank.watch.heater.known is before
    assert not tank.told("heater.questioned")[1:]  # the one of the first seconds at rest


def test_one_watch_is_enough_for_one_actuator():
    for action in ("heat", "cool"):
        watch = watch_for(HeaterCheck(action=action), 1.0, Supervisor(LIMITS, print), print)
        assert isinstance(watch, HeaterWatch)
        assert list(named(watch)) == ["heater-check"]


def test_what_either_has_learnt_is_kept_under_a_name_of_its_own():
    tank = known()
    kept = remembering((), named(tank.watch))()
    assert set(kept) == {"heater-check", "cooler-check"}
    again = Tank()

    class Stored:
        def __init__(self, model):
            self.model, self.age_s = model, 0.0

    recall_heater(again.watch, {name: Stored(model) for name, model in kept.items()}, print)
    assert again.watch.heater.known.mean == tank.watch.heater.known.mean
    assert again.watch.cooler.known.mean == tank.watch.cooler.known.mean


def test_a_heater_that_is_rated_says_nothing_of_the_cooler_beside_it():
    check = HeaterCheck(0.009, action="heat-cool")
    assert check.of_heater == HeaterCheck(0.009)
    assert check.of_cooler == HeaterCheck(WEAKEST_K_PER_S, action="cool")


def test_a_loop_with_a_cooler_is_watched_on_both_sides():
    table = {
        "setpoint_c": 20.0,
        "trip_above_c": 60.0,
        "controller": {"kind": "adaptive", "action": "heat-cool"},
        "actuator": {"board": "daq"},
        "cooler": {"board": "daq"},
    }
    settings = load({"boards": {"daq": {"kind": "simulated"}}, "loops": {"tank": table}})
    check = plan_for(settings.loop()[1]).heater_check
    assert check.action == "heat-cool"
    assert isinstance(watch_for(check, 1.0, Supervisor(LIMITS, print), print), Sides)


def test_a_bath_that_a_block_heats_is_watched_by_the_heat_that_flows():
    check = HeaterCheck(block_c=(20.0, 80.0))
    seen = []
    watch = watch_for(check, 1.0, Supervisor(LIMITS, print), print)
    watch.inner.observe = lambda t_s, interval_s, reading_c, power: seen.append(power)
    for reading_c, block_c in ((38.0, 80.0), (38.0, 38.0), (38.0, 30.0), (np.nan, 68.0)):
        watch.observe(0.0, 1.0, reading_c, (block_c - 20.0) / 60.0)
    assert seen == pytest.approx([0.7, 0.0, 0.0, 0.5])
    assert list(named(watch)) == ["heater-check"]


def test_before_the_first_reading_of_the_bath_no_heat_is_known_to_flow():
    seen = []
    watch = watch_for(HeaterCheck(block_c=(20.0, 80.0)), 1.0, Supervisor(LIMITS, print), print)
    watch.inner.observe = lambda t_s, interval_s, reading_c, power: seen.append(power)
    watch.observe(0.0, 1.0, np.nan, 1.0)
    assert seen == [0.0]


def test_a_loop_that_leads_another_is_watched_between_the_block_s_temperatures():
    bath = {
        "setpoint_c": 37.5,
        "trip_above_c": 60.0,
        "actuator": {"loop": "block", "low_c": 20.0, "high_c": 80.0},
    }
    block = {"setpoint_c": 20.0, "trip_above_c": 95.0}
    settings = load({"loops": {"bath": bath, "block": block}})
    assert plan_for(settings.loop("bath")[1]).heater_check.block_c == (20.0, 80.0)
    assert plan_for(settings.loop("block")[1]).heater_check.block_c is None
