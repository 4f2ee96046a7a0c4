"""The gain, assayed on plants whose gain is known."""

from __future__ import annotations

import numpy as np
import pytest

from thermoctl.insight.assay import Stretch, assay, noise_of
from thermoctl.insight.lagged_power import felt

GAIN, LAG_S, NOISE_K = 0.045, 18.0, 0.02


def vessel(power, seed=1, period_s=1.0, slope=0.0):
    """Return readings of a vessel that loses 9 mK/s at 37.5 degC, and `slope` more per K."""
    rng = np.random.default_rng(seed)
    q = felt(power, LAG_S, period_s)
    water, readings = 37.5, []
    for each in q:
        water += period_s * (GAIN * each - 0.009 - slope * (water - 37.5))
        readings.append(water + NOISE_K * rng.normal())
    return Stretch(np.array(readings), power, period_s)


def at_rest(seed=9, period_s=1.0):
    power = np.full(2000, 0.2) + 0.02 * np.random.default_rng(seed).normal(size=2000)
    return vessel(power, seed, period_s)


def a_move(samples=900):
    power = np.full(samples, 0.2)
    power[200:300], power[300:350] = 1.0, 0.0
    return power


@pytest.mark.parametrize("seed", range(3))
def test_a_move_tells_the_gain_within_its_error(seed):
    whitener = noise_of(at_rest(), LAG_S, GAIN)
    found = assay(vessel(a_move(), seed), LAG_S, whitener)
    assert found.gain.mean == pytest.approx(GAIN, abs=4.0 * found.gain.sd)
    assert found.gain.sd < 0.03 * GAIN


def test_a_slower_clock_changes_nothing():
    whitener = noise_of(at_rest(period_s=2.0), LAG_S, GAIN)
    found = assay(vessel(a_move(), 1, period_s=2.0), LAG_S, whitener)
    assert found.gain.mean == pytest.approx(GAIN, abs=4.0 * found.gain.sd)


def test_how_the_loss_grows_is_told_only_where_the_temperature_moved():
    whitener = noise_of(at_rest(), LAG_S, GAIN)
    quiet = assay(vessel(np.full(900, 0.2), 2), LAG_S, whitener)
    moved = assay(vessel(a_move(), 2, slope=1e-3), LAG_S, whitener)
    assert quiet.slope is None
    assert moved.slope.mean == pytest.approx(1e-3, abs=4.0 * moved.slope.sd)


def test_a_power_that_rests_says_nothing_of_the_gain():
    whitener = noise_of(at_rest(), LAG_S, GAIN)
    found = assay(vessel(np.full(900, 0.2), 3), LAG_S, whitener)
    assert found is None or not found.gain.sd < 0.1 * abs(found.gain.mean)


def test_too_short_a_stretch_says_nothing():
    whitener = noise_of(at_rest(), LAG_S, GAIN)
    assert noise_of(vessel(np.full(300, 0.2)), LAG_S, GAIN) is None
    assert assay(vessel(a_move(220)), LAG_S, whitener) is None
