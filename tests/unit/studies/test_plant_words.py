"""What a record says of a tank whose gain, loss and lag are known."""

import math

import numpy as np
import pytest

from thermoctl.estimation import Order
from thermoctl.studies.plant_words import plant_words
from thermoctl.studies.record import Columns, Record, RecordError
from thermoctl.studies.tuning import needed, tune

GAIN_K_PER_MIN, LOSS_PER_MIN, REST_C = 2.4, 0.04, 15.0


def tank(period_s=1.0, dead=3, lag_s=8.0, noise=0.01, samples=1500, seed=2, hold=30, power=None):
    """A first-order tank behind a dead time and a lag, driven by two powers."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice((0.0, 0.5), samples // hold + 1), hold)[:samples]
    u = u if power is None else power
    water, late, y = 36.0, 0.0, np.empty(samples)
    share = 1.0 - math.exp(-period_s / lag_s) if lag_s else 1.0
    for t in range(samples):
        y[t] = water + noise * rng.standard_normal()
        late += share * ((u[t - dead] if t >= dead else 0.0) - late)
        water += (GAIN_K_PER_MIN * late - LOSS_PER_MIN * (water - REST_C)) * period_s / 60.0
    return Record("made", period_s * np.arange(samples), u, y, Columns("y", "u", "t"))


def holds(bounded, truth, reach=1.6):
    """Whether the truth lies within the bounds, a little widened: one of many seeds may miss."""
    return abs(truth - bounded.value) < reach * (bounded.high - bounded.value)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("period_s", [0.5, 1.0, 4.0])
def test_the_truth_lies_within_the_bounds(seed, period_s):
    dead, lag_s = 3, 6.0 * period_s
    record = tank(period_s, dead, lag_s, seed=seed)
    words = plant_words(record, 37.5)
    share = 1.0 - math.exp(-period_s / lag_s)
    true_loss = LOSS_PER_MIN * (37.5 - REST_C)
    assert holds(words.gain_k_per_min, GAIN_K_PER_MIN)
    assert holds(words.lag_s, period_s * (dead + 1.0 / share - 1.0))
    assert holds(words.holding_power, true_loss / GAIN_K_PER_MIN)
    assert holds(words.loss_k_per_min, true_loss)


@pytest.mark.parametrize("seed", range(4))
def test_a_lag_that_reaches_beyond_the_first_inputs_is_told_as_long_as_it_is(seed):
    dead, lag_s = 3, 16.0
    words = plant_words(tank(dead=dead, lag_s=lag_s, seed=seed), 37.5)
    assert holds(words.lag_s, dead + 1.0 / (1.0 - math.exp(-1.0 / lag_s)) - 1.0, reach=1.0)


def test_bounds_are_narrow_enough_to_be_of_use():
    words = plant_words(tank(), 37.5)
    for bounded, most in (
        (words.gain_k_per_min, 0.2),
        (words.lag_s, 2.0),
        (words.holding_power, 0.05),
        (words.loss_k_per_min, 0.15),
    ):
        assert bounded.high - bounded.low < 2.0 * most


def test_a_long_record_tells_the_time_constant_and_the_temperature_of_rest():
    words = plant_words(tank(samples=12_000, hold=300), 37.5)
    assert words.time_constant_min.low < 1.0 / LOSS_PER_MIN < words.time_constant_min.high
    assert words.rest_c.low < REST_C < words.rest_c.high


def test_a_short_record_tells_only_how_long_the_time_constant_is_at_least():
    words = plant_words(tank(samples=220, noise=0.02), 37.5)
    assert words.rest_c is None
    assert words.time_constant_min.high is None
    assert 0.0 < words.time_constant_min.value == words.time_constant_min.low < 1.0 / LOSS_PER_MIN


def test_the_mean_of_the_record_does_not_matter():
    """It begins cold, or at rest: the constant of the wide model takes up what the mean is off."""
    early, late = plant_words(tank(samples=1500), 37.5), plant_words(tank(samples=6000), 37.5)
    assert early.holding_power.value == pytest.approx(late.holding_power.value, abs=0.03)


def test_an_input_that_rests_says_nothing():
    assert plant_words(tank(power=np.full(1500, 0.3)), 37.5) is None


def test_an_input_that_does_nothing_says_nothing():
    record = tank()
    rng = np.random.default_rng(8)
    assert (
        plant_words(
            Record("made", record.t_s, rng.permutation(record.u), record.y, record.names), 37.5
        )
        is None
    )


@pytest.mark.parametrize("moved", [slice(1), slice(20), slice(-5, None), slice(-20, None)])
def test_a_power_that_moved_once_claims_no_gain(moved):
    """Too early or too late for all lags to see it: the rest of the power is a constant."""
    power = np.ones(600)
    power[moved] = 0.0
    assert plant_words(tank(noise=0.02, samples=600, power=power), 37.5) is None


@pytest.mark.parametrize("order", [Order(1, 1, 1), Order(5, 2, 40)])
def test_a_tuning_takes_no_fewer_samples_than_it_says(order):
    enough = needed([order])
    assert tune(tank(samples=enough), [order], 37.5).order == order
    with pytest.raises(RecordError, match="got"):
        tune(tank(samples=enough - 1), [order], 37.5)
