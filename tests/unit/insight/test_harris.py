"""The index against processes whose index is known."""

from __future__ import annotations

import numpy as np
import pytest

from thermoctl.insight.harris import autocorrelation, harris, impulse_response

DELAY = 4


def process(psi, samples, seed):
    """Return a moving average of white noise, at rest from its first sample on."""
    noise = np.random.default_rng(seed).normal(size=samples + len(psi))
    return np.convolve(noise, psi)[len(psi) : len(psi) + samples]


def test_minimum_variance_control_has_the_index_1():
    found = harris(process([1.0, 0.9, 0.8, 0.7], 3600, seed=1), DELAY)
    assert found.index == pytest.approx(1.0, abs=0.02)
    assert found.ratio == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("decay", [0.9, 0.97])
def test_a_first_order_error_has_the_index_of_its_first_weights(decay):
    psi = decay ** np.arange(400)
    known = 1.0 - decay ** (2 * DELAY)
    found = [harris(process(psi, 3600, seed), DELAY).index for seed in range(20)]
    assert np.mean(found) == pytest.approx(known, rel=0.06)


def test_the_error_of_the_index_is_how_far_it_strays():
    psi = 0.95 ** np.arange(300)
    found = [harris(process(psi, 2400, seed), DELAY) for seed in range(50)]
    strayed = np.std([each.index for each in found])
    assert np.mean([each.index_sd for each in found]) == pytest.approx(strayed, rel=0.3)


def test_the_bound_does_not_depend_on_how_the_loop_is_tuned():
    calm, brisk = (process(0.98 ** np.arange(600), 3600, 3), process(0.8 ** np.arange(60), 3600, 3))
    # Both have other weights from the second on, but the same first innovation.
    assert harris(calm, 1).bound_k == pytest.approx(harris(brisk, 1).bound_k, rel=0.02)
    assert harris(calm, 1).ratio > 2.0 * harris(brisk, 1).ratio


def test_scale_and_mean_of_the_error_change_nothing():
    e = process(0.9 ** np.arange(100), 2000, seed=5)
    one, other = harris(e, DELAY), harris(1e-3 * e + 7.0, DELAY)
    assert other.index == pytest.approx(one.index, rel=1e-9)
    assert other.bound_k == pytest.approx(1e-3 * one.bound_k, rel=1e-9)


def test_nothing_is_said_of_too_few_samples_or_of_none_that_move():
    assert harris(process([1.0], 250, seed=1), DELAY) is None
    assert harris(np.full(3600, 37.5), DELAY) is None


@pytest.mark.parametrize(("delay", "order"), [(0, 30), (4, 0)])
def test_a_delay_or_order_below_1_is_refused(delay, order):
    with pytest.raises(ValueError, match="must be at least 1, got"):
        harris(np.ones(1000), delay, order)


def test_weights_of_an_autoregression_are_its_powers():
    assert impulse_response(np.array([0.5]), 4) == pytest.approx([1.0, 0.5, 0.25, 0.125])
    assert impulse_response(np.array([0.5, 0.2]), 3) == pytest.approx([1.0, 0.5, 0.45])


def test_a_wave_is_alike_after_a_turn_and_unlike_after_half_of_one():
    r = autocorrelation(np.sin(2 * np.pi * np.arange(5000) / 50), 50)
    assert r[0] == 1.0
    assert r[25] == pytest.approx(-1.0, abs=0.02)
    assert r[50] == pytest.approx(1.0, abs=0.02)
