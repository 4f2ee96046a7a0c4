"""A reading that stands under full power is asked, and one that is at its limit answers."""

from collections import deque

import numpy as np
import pytest

from thermoctl.regulator.heater.blocks import NEARLY_FULL, Block
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen, clear_k
from thermoctl.regulator.heater.standing import (
    ANSWERED_S,
    STANDS_K,
    STANDS_S,
    STILL_K,
    Standing,
)
from thermoctl.signals import State

BLOCK_S, NOISE_K, WEAKEST = 4.0, 0.005, 9e-4
PLACES = len(LAGS_S)


def asked_s(seconds, gain=0.04, rise_k_per_s=0.0, power=1.0, answers_s=0.0, power_max=1.0):
    """Return when a reading that rises by so much is asked; it answers for so long after."""
    standing, known, at_s = Standing(power_max), Gain(gain, 0.01 * gain, 0), []
    before = Seen(0.0, 20.0, (0.0,) * PLACES)
    while before.t_s < seconds:
        t_s = before.t_s + BLOCK_S
        now = Seen(t_s, 20.0 + rise_k_per_s * t_s, (power * t_s,) * PLACES)
        standing.add(Block(BLOCK_S, power, now.reading_c, NOISE_K), before)
        answered = bool(at_s) and t_s - at_s[-1] < answers_s
        if standing.question(known, WEAKEST, now, NOISE_K, answered=answered) is not None:
            at_s.append(t_s)
        before = now
    return at_s


def test_what_stands_is_asked_and_what_has_answered_is_left_alone_for_longer():
    tardy_s = 2.0 * BLOCK_S
    assert np.diff([0.0, *asked_s(10_000.0)]) == pytest.approx(STANDS_S, abs=tardy_s)
    waits_s = np.diff([0.0, *asked_s(20_000.0, answers_s=100.0)])
    assert waits_s == pytest.approx([STANDS_S, ANSWERED_S, ANSWERED_S], abs=tardy_s)


def test_full_power_is_the_most_that_the_loop_gives():
    assert asked_s(1000.0, power=0.5, power_max=0.5) == asked_s(1000.0)
    assert asked_s(7200.0, power=0.4, power_max=0.5) == []


@pytest.mark.parametrize(
    "sound",
    [
        {"rise_k_per_s": 1.2 * clear_k(NOISE_K) / STANDS_S},  # it is still getting warmer
        {"power": 0.99 * NEARLY_FULL},  # it is held
        {"gain": 0.9 * STANDS_K / 7200.0},  # so little would not show
    ],
    ids=lambda keys: next(iter(keys)),
)
def test_nothing_is_asked_of_what_may_well_be_sound(sound):
    assert asked_s(7200.0, **sound) == []


def test_a_rise_beyond_where_it_answered_is_news():
    standing, known = Standing(), Gain(0.04, 4e-4, 0)

    def asked(t_s, reading_c, answered=False):
        seen = Seen(t_s, reading_c, (t_s,) * PLACES)
        told = standing.question(known, WEAKEST, seen, NOISE_K, answered=answered)
        standing.add(Block(BLOCK_S, 1.0, reading_c, NOISE_K), seen)
        return told is not None

    assert not asked(0.0, 20.0, answered=True)
    begin_s = 0.0
    for back_c, again in ((20.0, False), (21.0, True)):
        for t_s, reading_c in ((0.0, 19.8), (ANSWERED_S, back_c), (ANSWERED_S + STANDS_S, back_c)):
            last = asked(begin_s + t_s, reading_c)
        assert last is again
        standing.clear()
        begin_s += 2.0 * ANSWERED_S


def test_what_moves_to_and_fro_does_not_stand():
    standing, known, told = Standing(), Gain(0.04, 4e-4, 0), []
    for k in range(int(3.0 * STANDS_S / BLOCK_S)):
        reading_c = 20.0 - (k % 40 < 10) * 1.2 * STILL_K
        seen = Seen(k * BLOCK_S, reading_c, (k * BLOCK_S,) * PLACES)
        standing.add(Block(BLOCK_S, 1.0, reading_c, NOISE_K), seen)
        told.append(standing.question(known, WEAKEST, seen, NOISE_K, answered=False))
    assert told == [None] * len(told)


def test_less_power_begins_the_stretch_anew():
    standing, known = Standing(), Gain(0.04, 4e-4, 0)
    for t_s, power in ((0.0, 1.0), (STANDS_S - 1.0, 0.5), (STANDS_S, 1.0)):
        before = Seen(t_s, 20.0, (t_s,) * PLACES)
        standing.add(Block(BLOCK_S, power, 20.0, NOISE_K), before)
    now = Seen(2.0 * STANDS_S - 1.0, 20.0, (2.0 * STANDS_S,) * PLACES)
    assert standing.question(known, WEAKEST, now, NOISE_K, answered=False) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gain", "cools_per_s", "lag_s"),
    [(0.02, 4e-4, 20.0), (0.005, 2e-4, 60.0), (0.15, 4e-3, 10.0), (0.002, 2e-4, 40.0)],
)
def test_a_vessel_at_its_limit_answers_and_goes_on(vessel_with, gain, cools_per_s, lag_s):
    vessel = vessel_with(gain, cools_per_s, lag_s).run(20 * 3600)
    assert set(vessel.names()) == {"heater.questioned", "heater.answered"}
    assert vessel.given_s > 0.97 * vessel.t_s
    assert vessel.supervisor.state is State.RUN


@pytest.mark.slow
@pytest.mark.parametrize("from_c", [20.0, 30.0], ids=["jacket", "ptc"])
@pytest.mark.parametrize("cools_per_s", [5e-5, 2e-4])
def test_a_heater_that_gives_less_the_hotter_its_vessel_is_answers_at_its_limit(
    vessel_with, from_c, cools_per_s
):
    vessel = vessel_with(0.02, cools_per_s, 10.0, weakest_k_per_s=9e-4)
    vessel.left = lambda water_c: min(max((55.0 - water_c) / (55.0 - from_c), 0.0), 1.0)
    vessel.run(6 * 3600)
    assert set(vessel.names()) == {"heater.questioned", "heater.answered"}
    assert vessel.supervisor.state is State.RUN


@pytest.mark.slow
@pytest.mark.parametrize(("share", "every_s"), [(0.03, 300.0), (0.03, 600.0)])
def test_cold_portions_at_a_limit_condemn_no_heater(vessel_with, share, every_s):
    for seed in range(4):
        vessel = vessel_with(0.006, 3.3e-4, 6.0, seed, weakest_k_per_s=9e-4)
        vessel.poured = lambda t_s: share / 40.0 if t_s % every_s < 40.0 else 0.0
        vessel.run(4 * 3600)
        assert set(vessel.names()) <= {"heater.questioned", "heater.answered"}, seed
        assert vessel.given_s > 0.95 * vessel.t_s, seed


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 4])
def test_air_that_warmed_like_a_heater_is_told_once_it_stands(vessel_with, seed):
    """By then all the heat counts as lost, and the air wanders by a fiftieth of a kelvin."""
    vessel, rng = vessel_with(seed=seed, weakest_k_per_s=9e-4), np.random.default_rng(100 + seed)
    off_k = deque([0.0], maxlen=1)

    def shows(_):
        off_k.append(0.995 * off_k[0] + 0.002 * rng.standard_normal())
        return 22.0 + off_k[0] + 2e-3 * min(vessel.t_s, 3600.0)

    vessel.shows = shows
    before_s = vessel.run(3600).given_s
    vessel.run(2 * 3600)
    assert vessel.supervisor.state is State.LATCHED
    assert vessel.given_s - before_s < 3600.0
