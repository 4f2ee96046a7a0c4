"""Heat that a block still holds is known by how the block moves."""

import math

import numpy as np
import pytest

from thermoctl.runtime.stored_heat import LONGEST_S, StoredHeat

REACH_K = 50.0
"""By so much full power would keep the block above what it heats."""


def moved(heat, lasts_s, powers, seed=0, start_k=0.0, noise_k=0.05):
    """Return what is known after `powers`, and how much warmer than its bath the block is."""
    random, above_k = np.random.default_rng(seed), start_k
    begin_s = 0.0 if math.isnan(heat.t_s) else heat.t_s + 1.0
    for second, power in enumerate(powers):
        bath_c, noise = 30.0, noise_k * random.standard_normal()
        heat = heat.after(begin_s + second, power, bath_c + above_k + noise, bath_c)
        if second + 1 < len(powers):  # the next reading comes after the next power
            reach_k = REACH_K * powers[second + 1]
            above_k = reach_k + (above_k - reach_k) * math.exp(-1.0 / lasts_s)
    return heat, above_k


@pytest.mark.parametrize("lasts_s", [10.0, 30.0, 60.0, 120.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_the_first_warm_up_tells_how_slowly_a_block_will_cool_down(lasts_s, seed):
    heat, _ = moved(StoredHeat(), lasts_s, [1.0] * round(2.0 * lasts_s + 40.0), seed)
    assert heat.lasts_s == pytest.approx(lasts_s, rel=0.15)


@pytest.mark.parametrize("lasts_s", [10.0, 60.0])
def test_a_fall_without_power_tells_it_as_well(lasts_s):
    powers = [1.0] * 20 + [0.0] * round(2.0 * lasts_s + 40.0)
    heat, _ = moved(StoredHeat(), lasts_s, powers, start_k=20.0)
    assert heat.lasts_s == pytest.approx(lasts_s, rel=0.15)


@pytest.mark.parametrize(("what", "power", "start_k"), [
    ("at rest", 0.2, 10.0), ("without a heater", 0.0, 0.0),
])  # fmt: skip
def test_a_block_that_does_not_move_tells_nothing(what, power, start_k):
    heat, _ = moved(StoredHeat(), 60.0, [power] * 2000, start_k=start_k)
    assert heat.lasts_s == 0.0, what


def test_an_hour_of_rest_leaves_what_is_known_as_it_is():
    warm, above_k = moved(StoredHeat(), 60.0, [1.0] * 120)
    rested, _ = moved(warm, 60.0, [above_k / REACH_K] * 3600, start_k=above_k)
    assert rested.lasts_s == pytest.approx(warm.lasts_s, rel=0.02)


def test_a_heater_that_is_stuck_on_makes_no_block_slow():
    heat = StoredHeat()
    for second in range(120):
        heat = heat.after(float(second), 0.0, 30.0 + 0.5 * second, 30.0)
    assert heat.lasts_s == 0.0


def test_what_nobody_knows_is_a_gap_and_what_was_known_stays():
    warm, _ = moved(StoredHeat(), 30.0, [1.0] * 100)
    for seen in ((math.nan, 50.0, 30.0), (0.5, math.nan, 30.0), (0.5, 50.0, math.nan)):
        blind = warm.after(warm.t_s + 1.0, *seen)
        assert blind.lasts_s == warm.lasts_s > 0.0
        begun = blind.after(warm.t_s + 2.0, 1.0, 80.0, 30.0).after(warm.t_s + 3.0, 1.0, 80.0, 30.0)
        assert begun.lasts_s == warm.lasts_s  # a jump over the gap is no movement
    late = warm.after(warm.t_s + 3600.0, 0.0, 31.0, 30.0)
    assert late.lasts_s == warm.lasts_s


def test_no_block_is_taken_to_be_slower_than_the_slowest():
    heat, _ = moved(StoredHeat(), 1e5, [1.0, 0.0] * 20 + [0.0] * 500, start_k=5000.0, noise_k=0.0)
    assert 0.0 <= heat.lasts_s <= LONGEST_S
