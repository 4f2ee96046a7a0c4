"""Gains that have settled are kept at rest, and at rest alone."""

import math
from itertools import pairwise

import numpy as np
import pytest

from thermoctl.control.adaptive import gains
from thermoctl.control.adaptive.bank import Bank
from thermoctl.control.adaptive.filters import D, X

BANK = Bank()
HELD = 0.25
"""Power that holds the plant of these tests at 37 degC."""


def powers(warm_up=120, rest=900):
    """Return those of a warm-up, and of a rest in which a controller answers to noise."""
    rng = np.random.default_rng(11)
    return [1.0] * warm_up + (HELD + 0.01 * rng.standard_normal(rest)).tolist()


def run(given, bank=BANK, seed=3, read=lambda k, y: y):
    """Return the beliefs under the powers `given`, of a plant of two lags with a little noise."""
    rng = np.random.default_rng(seed)
    belief, water, sensor, q = bank.start(), 34.0, 34.0, 0.0
    beliefs = []
    for k, u in enumerate(given):
        q += (1.0 - math.exp(-1.0 / 8.0)) * (u - q)
        water += 0.036 * (q - HELD) - 2e-4 * max(water - 37.0, 0.0)
        sensor += (1.0 - math.exp(-1.0 / 6.0)) * (water - sensor)
        belief = bank.observe(belief, read(k, sensor + 0.02 * rng.standard_normal()), u)
        beliefs.append(belief)
    return beliefs


def kept(before, after):
    """Return whether a sample has left the covariances as they were."""
    return np.array_equal(before.block[:, :X], after.block[:, :X])


@pytest.fixture(scope="module")
def rested():
    return run(powers())


def test_at_rest_gains_are_reckoned_at_every_fifteenth_sample(rested):
    last = rested[-150:]
    full = [k for k in range(1, 150) if not kept(last[k - 1], last[k])]
    assert full
    assert set(np.diff(full)) == {gains.GOOD_SAMPLES + 1}


def test_no_gain_is_kept_before_the_plant_has_come_to_rest(rested):
    assert not any(kept(before, after) for before, after in pairwise(rested[:180]))


def loss_sd(belief):
    """Return how well the loss is known, in K per sample."""
    return math.sqrt(belief.weights.share.dot(belief.block[D, D]))


def test_what_is_believed_is_what_it_would_be_were_they_reckoned_always(rested, monkeypatch):
    monkeypatch.setattr(gains, "GOOD_SAMPLES", 0)
    always = run(powers())
    for believed, exact in zip(rested, always, strict=True):
        assert loss_sd(believed) == pytest.approx(loss_sd(exact), rel=0.05)
        assert believed.outlook.coasting_c == pytest.approx(exact.outlook.coasting_c, abs=2e-3)
        assert believed.outlook.holding_power == pytest.approx(
            exact.outlook.holding_power, abs=2e-3
        )
        assert believed.outlook.gain_sd == pytest.approx(exact.outlook.gain_sd, rel=0.02)


@pytest.mark.parametrize("away", [0.15, -0.15])
def test_power_that_moves_is_learnt_from_at_every_sample(rested, away):
    belief = rested[-1]
    for _ in range(20):
        after = BANK.observe(belief, 37.0, HELD + away)
        assert after.excitation.share > 0.0
        assert not kept(belief, after)
        belief = after


def test_water_that_jumps_has_all_gains_reckoned(rested):
    belief, y = rested[-1], rested[-1].noise.last_c
    for _ in range(3):
        belief = BANK.observe(belief, y - 3.0, HELD)
    assert belief.gate.jumped
    assert belief.gains is None
    for _ in range(50):
        after = BANK.observe(belief, y - 3.0 + 0.02 * math.sin(belief.sample), HELD)
        assert not kept(belief, after)
        belief = after


def test_gains_that_are_kept_cannot_be_written_to(rested):
    for array in rested[-1].gains[:2]:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


def test_a_sample_that_keeps_gains_shares_what_it_leaves_alone(rested):
    pairs = [(a, b) for a, b in pairwise(rested[-150:]) if b.gains.kept > 0]
    assert len(pairs) > 100
    for before, after in pairs:
        assert after.full is before.full
        assert np.array_equal(after.block[:, X], after.x)
        assert kept(before, after)
        for array in (after.full, after.x, after.block):
            assert not array.flags.writeable


def test_a_missing_reading_has_them_reckoned_and_grows_the_covariance(rested):
    belief = rested[-1]
    blind = BANK.observe(belief, math.nan, HELD)
    assert blind.gains is None
    assert not kept(blind, BANK.observe(blind, math.nan, HELD))


def test_the_same_power_far_from_rest_is_no_rest():
    full = run([1.0] * 240)
    assert all(belief.gains is None for belief in full)
    assert full[-1].excitation.share == 0.0
