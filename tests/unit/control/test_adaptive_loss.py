"""A loss that grows with the temperature is not learnt anew at every set point."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.control.adaptive import Adaptive, filters
from thermoctl.control.adaptive.bank import Bank
from thermoctl.control.adaptive.evidence import NEARER, Noise
from thermoctl.control.adaptive.filters import D, T, X
from thermoctl.estimation import start
from thermoctl.ports import Situation

NOTHING, EMPTY = start(1), np.empty(0)


class Board:
    """Something small and quick: `gain` K/s at full power, a lag of 8 s, and a room of 22 degC.

    `steep` is the share of full power that makes up for a kelvin.
    """

    def __init__(self, steep, seed, gain=0.4):
        self.gain = gain
        self.steep, self.warm_c, self.sensor_c, self.heat = steep, 25.0, 25.0, 0.0
        self.rng = np.random.default_rng(seed)

    def reading(self, power):
        """Return what is read a second later."""
        self.heat += (1.0 - math.exp(-1.0 / 2.5)) * (power - self.heat)
        self.warm_c += self.gain * (self.heat - self.steep * (self.warm_c - 22.0))
        self.sensor_c += (1.0 - math.exp(-1.0 / 5.5)) * (self.warm_c - self.sensor_c)
        return self.sensor_c + 0.01 * self.rng.standard_normal()


def led(board, *setpoints_c, each_s=600):
    """Return how far a board that nobody knows is from each of the set points, in time."""
    law, power, errors = Adaptive(), 0.0, []
    belief, y = law.start(), board.warm_c
    for r in setpoints_c:
        away = np.empty(each_s)
        for k in range(each_s):
            now = Situation(0.0, 1.0, y, r, power, NOTHING, EMPTY, EMPTY, y)
            belief, power = law.decide(law.observe(belief, now), now)
            y = board.reading(power)
            away[k] = board.warm_c - r
        errors.append(away)
    return errors


def settled_s(errors):
    """Return when the last error beyond .1 K has passed."""
    return 1 + np.nonzero(np.abs(errors) > 0.1)[0].max()


def block_of(bank, loss):
    """Return the block of water at 45 degC whose gain is .04 and whose loss is `loss`, in K/s."""
    return filters.start(bank.hypotheses, 45.0, filters.Prior(0.04, 0.001, loss, 0.001))


@pytest.mark.parametrize(("loss", "heat"), [(0.01, 1.0), (0.01, 0.0), (-0.01, 1.0)])
def test_a_loss_grows_in_a_kelvin_as_if_the_room_were_40_k_colder_and_a_gift_does_not(loss, heat):
    bank = Bank()
    before = block_of(bank, loss)
    after = filters.predicted(before, np.full(len(bank.hypotheses), heat), bank.constants)
    moved_k = after[T, X] - before[T, X]
    assert np.abs(moved_k).min() > 0.005
    assert (after[D, X] - before[D, X]) / moved_k == pytest.approx(max(loss, 0.0) / 40.0)


def test_a_loss_that_is_nil_stays_nil_however_warm_it_gets():
    bank = Bank()
    block = block_of(bank, 0.0)
    for _ in range(50):
        block = filters.predicted(block, np.ones(len(bank.hypotheses)), bank.constants)
    assert block[T, X].min() > 46.0
    assert not block[D, X].any()


def test_water_that_was_poured_in_is_colder_and_loses_less():
    bank = Bank()
    belief = bank.start()._replace(prior=filters.Prior(0.04, 0.001, 0.01, 0.001))
    for _ in range(900):
        belief = bank.observe(belief, 45.0, 0.25)
    before = belief.outlook.holding_power
    for _ in range(10):
        belief = bank.observe(belief, 37.0, 0.25)
    assert before == pytest.approx(0.25, abs=0.01)
    assert belief.outlook.holding_power == pytest.approx(0.25 * (1.0 - 8.0 / 40.0), abs=0.02)


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from([0.05, 1.0, 30.0, 3600.0]),
    st.floats(-0.5, 0.5),
    st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=60),
)
def test_however_long_a_period_is_the_loss_keeps_its_sign_and_does_not_run_away(h, loss, heats):
    bank = Bank(h, -1.0)
    block = block_of(bank, loss)
    most = max(abs(loss), 2.0 * (0.04 + 1e-12)) * h
    for heat in heats:
        block = filters.predicted(block, np.full(len(bank.hypotheses), heat), bank.constants)
        assert (np.sign(block[D, X]) == np.sign(loss)).all() or not block[D, X].any()
        assert np.abs(block[D, X]).max() <= most


@pytest.mark.parametrize("seed", [1, 2])
def test_the_loss_at_a_warmer_set_point_is_known_when_it_is_reached(seed):
    _, step = led(Board(0.015, seed), 40.0, 50.0)
    assert settled_s(step) < 90  # 105 and more, were it left to be learnt


@pytest.mark.parametrize("steep", [0.0, 0.002, 0.03])
def test_a_loss_that_grows_otherwise_than_expected_is_learnt_all_the_same(steep):
    warm_up, step = led(Board(steep, 1), 40.0, 42.0)
    assert warm_up.max() < 0.1
    assert step.max() < 0.1
    assert steep == 0.0 or np.abs(step[-200:]).max() < 0.03  # nothing cools it, once it is too hot


@pytest.mark.parametrize("loss", [0.01, -0.01, 0.0])
def test_far_above_its_room_a_loss_and_its_error_grow_as_if_that_were_far(loss):
    bank = Bank()
    before, heat = block_of(bank, loss), np.ones(len(bank.hypotheses))
    near, far = (filters.predicted(before, heat, bank.constants, 0.0, k) for k in (40.0, 200.0))
    moved_k, growth = far[T, X] - before[T, X], far[D, X] - before[D, X]
    assert growth / moved_k == pytest.approx(max(loss, 0.0) / 200.0)
    scale = np.ones((4, len(moved_k)))
    if loss > 0.0:
        scale[D] += growth / loss
    noise = np.zeros((4, 4))  # which is added afterwards, and is no larger for it
    noise[D, D] = bank.constants.noise_loss * 0.04**2
    P = scale[:, None] * (near[:, :X] - noise[:, :, None]) * scale + noise[:, :, None]
    assert far[:, :X] == pytest.approx(P, rel=1e-12)


def read(*readings_c):
    """Return the noise after these readings."""
    noise = Noise()
    for y in readings_c:
        noise = noise.after(y)
    return noise


def test_the_coldest_counts_once_three_readings_in_a_row_were_no_warmer():
    assert read(20.0, 20.0).coldest_c == math.inf
    assert read(-70.0, 22.0, 21.0, 20.0).coldest_c == 22.0
    assert read(50.0, 50.0, 50.0, 3.0, 4.0, 50.0, 50.0).coldest_c == 50.0
    assert read(50.0, 50.0, 50.0, 3.0, 4.0, 2.0, 50.0).coldest_c == 4.0


def test_how_far_a_plant_is_above_its_room_is_not_known_before():
    assert not read().above_k > 0.0
    assert not read(90.0, 20.0).above_k > 0.0
    assert read(20.0, 20.0, 20.0, 120.0).above_k == pytest.approx(100.0 * NEARER)


def test_a_plant_that_is_cooled_as_well_may_be_colder_than_its_room():
    block, heat = block_of(Bank(), 0.01), np.ones(len(Bank().hypotheses))
    constants = Bank(u_min=-0.2).constants
    for far in (0.0, 200.0):
        after = filters.predicted(block, heat, constants, 0.0, far)
        moved_k = after[T, X] - block[T, X]
        assert (after[D, X] - block[D, X]) / moved_k == pytest.approx(0.01 / 40.0)


HOT = [  # K/s at full power, which warms by so many K
    pytest.param(4.0, 370.0, id="as a hot end"),
    pytest.param(7.0, 700.0, id="as an iron", marks=pytest.mark.slow),
    pytest.param(2.0, 200.0, id="half as hot", marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("gain", "warms_k"), HOT)
def test_what_is_hot_and_quick_goes_down_and_up_again_without_overshoot(gain, warms_k):
    hot, less = 22.0 + 0.5 * warms_k, 22.0 + 0.35 * warms_k
    warm_up, *steps = led(Board(1.0 / warms_k, 1, gain), hot, less, hot, less, hot, each_s=300)
    assert warm_up.max() < 0.005 * warms_k
    for up, step in zip((-1.0, 1.0, -1.0, 1.0), steps, strict=True):
        assert (up * step).max() < 0.002 * warms_k  # 1.3 % of a step; 3 to 35 % with 40 K
        assert np.abs(step[120:]).max() < 0.002 * warms_k
