"""A watch that begins in the middle of things: heat may be on its way that it has not seen."""

import copy
import math
from collections import deque

import numpy as np
import pytest

from thermoctl.regulator.heater import memory as heater_memory
from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.check import HeaterCheck
from thermoctl.regulator.heater.known import OFF_LAGS, KnownHeater
from thermoctl.regulator.heater.past import FirstReadings
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen
from thermoctl.regulator.heater.watch import HeaterWatch
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.supervisor import Supervisor
from thermoctl.signals import Measurement, State

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

LIMITS = Limits(200.0, -50.0, -50.0, 200.0)


class Vessel:
    """A watch that is put to work anew, on a plant that is not: a gain behind two equal poles."""

    def __init__(self, gain=0.045, lag_s=45.0, loss=0.009, seed=1, noise_k=0.03):
        self.gain, self.pole_s, self.loss = gain, 0.5 * lag_s, loss
        self.rng, self.noise_k = np.random.default_rng(seed), noise_k
        self.t_s, self.water_c, self.applied = 0.0, 25.0, 0.0
        self.first = self.second = 0.0
        self.does = lambda power: power
        self.begin()

    def begin(self):
        self.events = deque()
        self.supervisor = Supervisor(LIMITS, self.emit)
        self.watch = HeaterWatch(HeaterCheck(), 1.0, self.supervisor, self.emit)
        self.applied = 0.0
        return self

    def emit(self, name, **fields):
        self.events.append((name, fields))

    def names(self):
        return [name for name, _ in self.events if name.startswith("heater.")]

    def pass_by(self, seconds):
        """Let time pass with nobody at the wheel, and no power."""
        for _ in range(seconds):
            self._flow(0.0)

    def warm_up(self, seconds, to_c=37.5, law=None):
        """Give full power below `to_c`, and none above; or what `law` makes of the reading."""
        law = law or (lambda reading_c: 1.0 if reading_c < to_c else 0.0)
        for _ in range(seconds):
            self._flow(self.does(self.applied))
            reading_c = self.water_c + self.noise_k * self.rng.standard_normal()
            self.supervisor.judge(Measurement(self.t_s, reading_c), self.t_s, 1.0)
            self.watch.observe(self.t_s, 1.0, reading_c, self.applied)
            free = self.supervisor.rule(self.t_s, 0.0) is State.RUN and not self.watch.asks
            self.applied = law(reading_c) if free else 0.0
        return self

    def _flow(self, power):
        self.first += (power - self.first) / self.pole_s
        self.second += (self.first - self.second) / self.pole_s
        self.water_c += self.gain * self.second - self.loss
        self.t_s += 1.0


@pytest.mark.parametrize("lag_s", [10.0, 20.0, 45.0, 90.0])
@pytest.mark.parametrize("down_s", [0, 3, 10])
def test_heat_from_before_a_quick_restart_is_no_heater_that_is_stuck_on(lag_s, down_s):
    for began_s in (90, 180, 270):
        vessel = Vessel(lag_s=lag_s).warm_up(began_s)
        vessel.pass_by(down_s)
        vessel.begin().warm_up(900)
        assert vessel.names() == [], began_s
        assert vessel.supervisor.state is State.RUN


def test_the_lag_that_seemed_to_be_none_is_learnt_from_the_first_move_of_the_power():
    vessel = Vessel().warm_up(150).begin().warm_up(60)
    assert vessel.watch.known.lag_s < 10.0
    vessel.warm_up(600)
    assert vessel.watch.known.lag_s == 45.0
    assert abs(vessel.watch.known.mean / vessel.gain - 1.0) < 0.3


def test_a_slope_that_nobody_can_tell_proves_nothing():
    vessel = Vessel().warm_up(900)
    known = vessel.watch.known
    vessel.watch._heater.gain = known._replace(place=0, mean=0.2 * known.mean)
    vessel.watch._rows.clear()
    vessel.watch._doubt._extra_k = math.inf
    vessel.applied = 0.0
    vessel.warm_up(12, to_c=0.0)
    assert "nan" not in " ".join(str(fields.get("text")) for _, fields in vessel.events)


def recalled(vessel):
    """Return the vessel under a new watch that was told what the one before knew."""
    known = heater_memory.recall(heater_memory.remember(vessel.watch.known))
    vessel.begin().watch.recall(known)
    return vessel


def held(vessel, seconds, power):
    """Hold `power`, wherever nobody forbids it."""
    return vessel.warm_up(seconds, law=lambda _: power)


def test_a_heater_that_an_earlier_run_knew_is_not_asked_at_rest():
    at_rest = held(Vessel(loss=0.0225).warm_up(900), 400, 0.5)
    new, told = copy.deepcopy(at_rest).begin(), recalled(copy.deepcopy(at_rest))
    assert "heater.questioned" in held(new, 1500, 0.5).names()
    assert held(told, 1500, 0.5).names() == []


@pytest.mark.parametrize(("lag_s", "pulse_s"), [(20.0, 16), (30.0, 24)])
def test_what_a_pulse_brings_is_not_expected_of_the_power_that_holds(lag_s, pulse_s):
    known = Vessel(lag_s=lag_s).warm_up(900).watch.known
    for seed in range(4):
        vessel = Vessel(lag_s=lag_s, seed=seed)
        vessel.first = vessel.second = 0.2
        vessel.pass_by(60)
        vessel.begin().watch.recall(known)
        held(vessel, pulse_s, 1.0)
        assert held(vessel, 900, 0.2).names() == [], seed


@pytest.mark.parametrize("began_s", [90, 180, 270])
@pytest.mark.parametrize("down_s", [0, 10])
def test_a_restart_that_remembers_finds_no_fault_in_heat_from_before(began_s, down_s):
    known = Vessel().warm_up(900).watch.known
    vessel = Vessel().warm_up(began_s)
    vessel.pass_by(down_s)
    vessel.begin().watch.recall(known)
    assert vessel.warm_up(900).names() == []


def test_a_heater_stuck_on_since_before_a_restart_is_found_by_who_remembers_it():
    vessel = recalled(Vessel().warm_up(900))
    began_c = vessel.water_c
    vessel.does = lambda _: 1.0
    vessel.warm_up(300)
    assert vessel.names() == ["heater.stuck_on"]
    assert vessel.supervisor.state is State.LATCHED
    assert vessel.water_c - began_c < 0.036 * 300


def test_another_heater_than_was_remembered_is_not_condemned():
    known = Vessel(gain=0.1, lag_s=10.0).warm_up(900).watch.known
    for lag_s in (20.0, 45.0, 90.0):
        vessel = Vessel(gain=0.02, lag_s=lag_s, loss=0.004)
        vessel.watch.recall(known)
        vessel.warm_up(2400)
        assert set(vessel.names()) <= {"heater.questioned", "heater.answered"}, lag_s
        assert abs(vessel.watch.known.mean / 0.02 - 1.0) < 0.4


@pytest.mark.parametrize("litres", [1.1, 1.2, 1.5, 2.0, 4.0])
@pytest.mark.parametrize("loss", [0.0012, 0.008])
def test_a_heater_remembered_of_more_water_is_not_asked_at_rest(litres, loss):
    vessel = Vessel(lag_s=20.0, loss=loss)
    vessel.watch.recall(Gain(vessel.gain / litres, 0.0003, 2))
    holds = loss / vessel.gain
    law = lambda reading_c: min(max(holds + 0.7 * (37.5 - reading_c), 0.0), 1.0)  # noqa: E731
    assert vessel.warm_up(2400, law=law).names() == []
    assert abs(vessel.watch.known.mean / vessel.gain - 1.0) < 0.2


def test_a_heater_stuck_on_is_found_by_who_remembers_one_of_more_water():
    vessel = Vessel(lag_s=20.0)
    vessel.water_c, vessel.first, vessel.second = 37.2, 0.2, 0.2
    vessel.watch.recall(Gain(0.6 * vessel.gain, 0.0003, 2))
    law = lambda reading_c: min(max(0.2 + 0.7 * (37.5 - reading_c), 0.0), 1.0)  # noqa: E731
    assert vessel.warm_up(700, law=law).names() == []
    vessel.does = lambda _: 1.0
    vessel.warm_up(180, law=law)
    assert vessel.supervisor.state is State.LATCHED
    assert vessel.names() == ["heater.stuck_on"]


def remembered(now_s=700.0):
    heater = KnownHeater()
    heater.recall(Gain(0.04, 0.0003, 1))
    return heater, Seen(now_s, 37.5, (100.0,) * len(LAGS_S))


def test_what_is_learnt_at_rest_does_not_replace_a_heater_of_ten_times_the_gain():
    heater, now = remembered()
    heater.learn(Gain(0.004, 0.0006, 0), now, 0.07, 0.01)
    assert heater.recalled
    assert heater.gain.mean == 0.04


@pytest.mark.parametrize(("mean", "moved_k"), [(0.004, 0.2), (0.035, 0.07)])
def test_what_has_moved_the_reading_or_agrees_replaces_what_was_remembered(mean, moved_k):
    heater, now = remembered()
    heater.learn(Gain(mean, 0.0006, 1), now, moved_k, 0.01)
    assert heater.seen
    assert heater.gain.mean == mean


@pytest.mark.parametrize(("place", "proven"), [(0, False), (1, True), (2, False)])
def test_a_lag_that_differs_from_the_one_remembered_has_yet_to_be_seen(place, proven):
    heater, now = remembered()
    heater.learn(Gain(0.035, 0.0006, place), now, 0.5, 0.01)
    assert heater.proven is proven


def test_an_answer_does_not_show_the_lag_of_a_heater_that_was_remembered():
    heater, _ = remembered()
    heater.accept(Gain(0.035, 0.0006, 1))
    assert heater.seen
    assert heater.under_way_s == OFF_LAGS * LAGS_S[-1]


@pytest.mark.parametrize("does", [lambda power: 0.0, lambda power: -power])
def test_a_remembered_heater_that_has_failed_is_latched(does):
    vessel = recalled(Vessel().warm_up(900))
    vessel.does = does
    vessel.warm_up(2400)
    assert vessel.supervisor.state is State.LATCHED


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("gain_k_per_s", 0.0),
        ("gain_k_per_s", math.nan),
        ("gain_sd_k_per_s", "0.1"),
        ("lag_s", -4.0),
        ("cools_per_s", None),
        ("gian_k_per_s", 0.1),
    ],
)
def test_a_memory_that_makes_no_sense_is_refused_by_its_name(name, value):
    model = heater_memory.remember(Gain(0.04, 0.001, 3, 0.001))
    assert heater_memory.recall(model) == Gain(0.04, 0.001, 3, 0.001)
    with pytest.raises(ValueError, match=name):
        heater_memory.recall(model | {name: value})


def seen(readings_c, sd_k=0.01, powers=None, span_s=4.0):
    first = FirstReadings()
    for n, reading_c in enumerate(readings_c):
        power = 1.0 if powers is None else powers[n]
        first.observe(Block(span_s, power, reading_c, sd_k))
    return first


def test_a_reading_that_rises_from_the_first_second_on_rises_with_heat_from_before():
    first = seen([20.0 + 0.18 * n for n in range(8)], powers=[0.75] + 7 * [0.9])
    assert first.power == 0.9
    assert first.rate == pytest.approx(0.18)


@pytest.mark.parametrize("lag_s", [4.0, 9.0, 20.0, 45.0, 150.0])
def test_a_start_from_cold_bends(lag_s):
    pole_s = 0.5 * lag_s
    at_s = [4.0 * n + 2.0 for n in range(70)]
    rises_k = [0.05 * (t - lag_s + math.exp(-t / pole_s) * (t + lag_s)) for t in at_s]
    assert math.isnan(seen([20.0 + rise_k for rise_k in rises_k]).power)


def test_in_long_blocks_a_power_that_is_taken_back_bends_the_reading():
    powers, readings_c = [0.0, 1.0, 0.6, 0.3, 0.2, 0.15], [22.8, 24.6, 27.8, 30.0, 31.1, 31.7]
    assert seen(readings_c, powers=powers).power == 1.0
    cold = seen(readings_c, powers=powers, span_s=10.0)
    assert cold.told
    assert math.isnan(cold.power)


def test_a_reading_at_rest_or_falling_says_nothing_of_heat():
    assert math.isnan(seen([37.5 + 0.005 * (n % 3) for n in range(100)]).power)
    assert math.isnan(seen([37.5 - 0.2 * n for n in range(100)]).power)
    assert math.isnan(seen([math.nan] * 100).power)


def test_a_reading_that_turns_with_the_power_says_nothing_of_heat_from_before():
    readings_c = [37.5 + min(0.01 * n, 0.05) for n in range(60)] + [
        37.5 - 0.04 * n for n in range(9)
    ]
    assert math.isnan(seen(readings_c, powers=40 * [0.7] + 20 * [0.2] + 9 * [0.0]).power)


@pytest.mark.parametrize("lag_s", [15.0, 20.0, 30.0])
def test_a_rise_by_heat_of_before_is_no_gain_of_the_little_power_there_is_now(lag_s):
    for seed in range(4):
        vessel = Vessel(lag_s=lag_s, seed=seed)
        while vessel.water_c < 37.0:
            vessel.warm_up(1)
        vessel.begin()
        for second in range(40):
            vessel.warm_up(1, law=lambda _, power=0.25 * 0.9**second: power)
        assert vessel.watch.known is None


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_no_heater_is_known_by_a_rise_of_which_nobody_can_tell_when_its_heat_was_given(seed):
    vessel = Vessel(gain=0.038, lag_s=12.0, loss=0.006, seed=seed, noise_k=0.0075).warm_up(230)
    vessel.pass_by(3)
    began_s = vessel.begin().t_s

    def brakes(_):
        """Return the power of a law that finds heat on its way."""
        return 0.2 if vessel.t_s - began_s < 10.0 else 1.0

    vessel.warm_up(36, law=brakes)
    assert vessel.watch.known is None
    vessel.warm_up(600)
    assert vessel.watch.known.mean == pytest.approx(vessel.gain, rel=0.3)
    assert vessel.names() == []


def disowned(place):
    """Return a heater of which the gain that was remembered is given up, and one learnt since."""
    now = Seen(100.0, 30.0, (90.0,) * len(LAGS_S))
    heater = KnownHeater()
    heater.recall(Gain(0.02, 0.001, 2))
    heater.disown()
    assert heater.gain is None
    heater.learn(Gain(0.04, 0.001, place), now, 1.0, 0.01)
    heater.follow(1.0, now)
    heater.follow(0.0, now)
    assert heater.seen
    assert not heater.proven
    return heater


def test_a_lag_that_is_found_again_outlives_the_gain_that_was_remembered_with_it():
    assert disowned(2).under_way_s == OFF_LAGS * LAGS_S[3]
    assert disowned(2).over_s == OFF_LAGS * LAGS_S[3] + LAGS_S[3]
    assert disowned(2).longer_s == LAGS_S[2]
    for place in (1, 3):
        assert disowned(place).under_way_s == OFF_LAGS * LAGS_S[-1]
        assert disowned(place).over_s == OFF_LAGS * LAGS_S[-1] + LAGS_S[place]


def test_an_output_that_sticks_on_is_told_as_soon_where_the_gain_remembered_is_given_up():
    told_s = []
    for share in (1.0, 0.6):
        vessel = Vessel(lag_s=20.0).warm_up(900)
        known = vessel.watch.known
        vessel.water_c, vessel.first, vessel.second = 25.0, 0.0, 0.0
        vessel.begin().watch.recall(known._replace(mean=share * known.mean))
        vessel.warm_up(200)
        assert vessel.watch._heater.recalled is (share == 1.0)
        vessel.does = lambda _: 1.0
        began_s = vessel.t_s
        while vessel.supervisor.state is not State.LATCHED and vessel.t_s < began_s + 600.0:
            vessel.warm_up(1)
        told_s.append(vessel.t_s - began_s)
    assert "heater.stuck_on" in vessel.names()
    assert told_s[1] <= told_s[0] + 10.0
