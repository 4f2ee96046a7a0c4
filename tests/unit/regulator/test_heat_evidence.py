"""What readings say of a heater while loads come and go."""

import math

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.regulator.heater.evidence import SOUND, SURE, odds, weigh
from thermoctl.regulator.heater.question import Answer
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen
from thermoctl.signals import Measurement, State

GAIN, SPAN_S, SD_K = Gain(0.045, 0.001, 2), 4.0, 0.01
LOAD = 0.2 * GAIN.mean
SEEDS = (0, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 2, 3)))


def rows(power, load_of, seconds=240, *, beta=GAIN.mean, seed=1):
    """Return what a heater of gain `beta` shows under a `power` and a load, both of the time."""
    rng = np.random.default_rng(seed)
    first, second = np.zeros((2, len(LAGS_S)))
    heat_s, water_c, seen = np.zeros(len(LAGS_S)), 37.5, []
    poles_s = 0.5 * np.array(LAGS_S)
    for t_s in range(seconds):
        first = first + (power(t_s) - first) / poles_s
        second = second + (first - second) / poles_s
        heat_s = heat_s + second
        water_c += beta * second[GAIN.place] - load_of(t_s)
        if t_s % SPAN_S == 0.0:
            reading_c = water_c + SD_K * rng.standard_normal()
            seen.append(Seen(float(t_s), reading_c, tuple(heat_s)))
    return seen


def answering(t_s):
    """Return the power that brings a reading back from under a load of a fifth of full power."""
    return 0.0 if t_s < 60 else 0.45 if t_s < 100 else 0.2


def cut(t_s):
    """Return the same, cut after three minutes."""
    return answering(t_s) if t_s < 180 else 0.0


def from_40_s(t_s):
    """Return a load that stays."""
    return LOAD if t_s >= 40 else 0.0


@pytest.mark.parametrize("seed", SEEDS)
def test_a_reading_that_dips_and_is_brought_back_says_that_the_heater_is_sound(seed):
    assert odds(rows(answering, from_40_s, seed=seed), 0.0, GAIN, SD_K) > SOUND


@pytest.mark.parametrize("seed", SEEDS)
def test_a_reading_that_stands_still_under_power_that_creeps_says_that_it_is_dead(seed):
    def creeping(t_s):
        return 0.1 + 0.001 * t_s if t_s < 180 else 0.0

    stood = rows(creeping, lambda _: 0.0, beta=0.0, seed=seed)
    assert odds(stood, 0.0, GAIN, SD_K) < -SURE


@pytest.mark.parametrize("seed", SEEDS)
def test_a_load_that_ends_at_the_moment_of_the_cut_does_not_condemn_a_heater(seed):
    def till_the_cut(t_s):
        return LOAD if 40 <= t_s < 190 else 0.0

    assert odds(rows(cut, till_the_cut, seed=seed), 0.0, GAIN, SD_K) > 0.0


def test_what_was_before_a_jump_says_nothing():
    seen = rows(lambda t_s: 0.3 if t_s < 180 else 0.0, lambda _: 0.0, beta=0.0)
    jumped = [
        row._replace(reading_c=row.reading_c + (0.4 if row.t_s < 60.0 else 0.0)) for row in seen
    ]
    since = [row for row in seen if row.t_s >= 60.0]
    assert odds(jumped, 0.0, GAIN, SD_K) == odds(since, 0.0, GAIN, SD_K) < -SURE


def test_too_few_readings_say_nothing():
    assert odds(rows(cut, from_40_s, seconds=40), 0.0, GAIN, SD_K) == 0.0
    assert odds(rows(cut, from_40_s), 200.0, GAIN, SD_K) == 0.0


@pytest.mark.parametrize(
    ("answer", "log_odds", "crept", "late", "made"),
    [
        (Answer.NOTHING, 6.0, False, False, Answer.HEATS),
        (Answer.NOTHING, 4.0, False, False, Answer.NOTHING),
        (Answer.COOLS, -1.0, False, False, Answer.COOLS),
        (Answer.COOLS, 4.0, True, False, Answer.HIDDEN),
        (Answer.NOTHING, -1.0, True, False, Answer.OPEN),
        (Answer.NOTHING, -4.0, True, False, Answer.NOTHING),
        (Answer.OPEN, 1.0, True, True, Answer.HIDDEN),
        (Answer.OPEN, -1.0, True, True, Answer.OPEN),
        (Answer.HEATS, -4.0, True, True, Answer.NOTHING),
    ],
)
def test_a_bad_answer_stands_where_no_load_explains_it(answer, log_odds, crept, late, made):
    assert weigh(answer, log_odds, crept=crept, late=late) is made


class Tank:
    """A regulator on 8 l that 3 % of 1,500 W hold, behind a lag of 20 s, with a load."""

    def __init__(self, seed):
        table = {"setpoint_c": 37.5, "trip_above_c": 60.0, "trip_below_c": 0.0, "mode": "auto"}
        self.regulator = regulator_for(load({"loops": {"tank": table}}))
        self.rng = np.random.default_rng(seed)
        self.water_c, self.first, self.second, self.power, self.t_s = 30.0, 0.0, 0.0, 0.0, 0.0
        self.events, self.lowest_c, self.state = [], math.inf, State.RUN

    def run(self, seconds, load_of=lambda _: 0.0):
        self.lowest_c = math.inf
        for _ in range(seconds):
            self.first += (self.power - self.first) / 10.0
            self.second += (self.first - self.second) / 10.0
            self.water_c += GAIN.mean * (self.second - 0.03 - load_of(self.t_s))
            self.t_s += 1.0
            self.lowest_c = min(self.lowest_c, self.water_c)
            reading_c = self.water_c + 0.02 * self.rng.standard_normal()
            step = self.regulator.step(Measurement(self.t_s, reading_c))
            self.power, self.state = step.command.power, step.state
            self.events += [each.name for each in step.events if each.name.startswith("heater.")]
        return self


@pytest.mark.parametrize("load_share", [0.1, 0.2])
@pytest.mark.parametrize("half_s", [75, 150])
@pytest.mark.slow
def test_a_load_that_comes_and_goes_condemns_no_heater(load_share, half_s):
    for seed in (1, 2):
        tank = Tank(seed).run(2400)
        assert tank.events == []
        tank.run(2400, lambda t_s: load_share * (t_s // half_s % 2))
        assert set(tank.events) <= {"heater.questioned", "heater.answered"}, seed
        assert tank.state is State.RUN
        assert tank.lowest_c > 36.9


@pytest.mark.parametrize("seed", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 3))])
def test_a_load_that_stays_and_is_made_up_for_is_no_question(seed):
    tank = Tank(seed).run(1500)
    tank.run(900, lambda _: 0.1)
    assert tank.events == []
