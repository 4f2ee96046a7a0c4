"""Why a loop is not as steady as its delay allows."""

from __future__ import annotations

import numpy as np
import pytest

from thermoctl.insight.harris import harris
from thermoctl.insight.performance import (
    PerformanceWatch,
    delay_samples,
    reason,
    sluggish,
    smallest_step,
)
from thermoctl.insight.swing import cycle_s, swing_of
from thermoctl.insight.values import Limit

LAG_S, DELAY = 18.0, 4


def noise(samples=3600, seed=1):
    return np.random.default_rng(seed).normal(size=samples)


def leaning(decay, samples=3600, seed=1):
    e = noise(samples, seed)
    for k in range(1, samples):
        e[k] += decay * e[k - 1]
    return e


def judged(error, noise_sd_k=0.0, step_k=0.0, limited=False):
    swing = swing_of(error, np.zeros(len(error)), 1.0, LAG_S, np.nan)
    return reason(error, harris(error, DELAY), swing, 1.0, LAG_S, noise_sd_k, step_k, limited)


def test_white_errors_are_as_steady_as_can_be():
    assert judged(noise())[0] is Limit.NONE


def test_noise_of_the_reading_is_blamed_when_it_is_most_of_the_error():
    limit, words = judged(0.02 * noise(), noise_sd_k=0.018)
    assert limit is Limit.NOISE
    assert "18 mK" in words


def test_the_step_of_the_sensor_is_blamed_when_the_error_is_made_of_it():
    error = 0.122 * np.round(0.5 * noise())
    limit, words = judged(error, step_k=smallest_step(error))
    assert limit is Limit.STEP
    assert "122 mK" in words


def test_a_power_at_its_limit_is_blamed_first():
    assert judged(noise(), noise_sd_k=1.0, limited=True)[0] is Limit.POWER


def test_a_swing_is_told_with_its_period():
    wave = np.sin(2.0 * np.pi * np.arange(3600) / 54.0) + 0.1 * noise()
    assert cycle_s(wave, 1.0, LAG_S) == pytest.approx(54.0, abs=2.0)
    limit, words = judged(wave)
    assert limit is Limit.CYCLE
    assert "54 s" in words or "53 s" in words or "55 s" in words


@pytest.mark.parametrize("seed", range(3))
def test_filtered_noise_is_no_swing(seed):
    assert cycle_s(leaning(0.9, seed=seed), 1.0, LAG_S) is None
    assert cycle_s(noise(seed=seed), 1.0, LAG_S) is None


def test_errors_that_stay_on_one_side_ask_for_a_brisker_law():
    slow, quick = leaning(0.99), leaning(0.9)
    assert sluggish(slow, 1.0, LAG_S)
    assert not sluggish(quick, 1.0, LAG_S)
    assert "brisker" in judged(slow)[1]
    assert "the lag limits you" in judged(quick)[1]


def test_the_delay_holds_the_dead_time_and_the_period_of_a_power():
    assert delay_samples(18.0, 1.0) == 4
    assert delay_samples(18.0, 10.0) == 1


def fed(watch, error, power=0.2):
    for k, each in enumerate(error):
        told = watch.after(float(k), 37.5 + each, 37.5, power, LAG_S, 0.0)
    return told


def test_too_few_samples_are_not_judged():
    told = fed(PerformanceWatch(1.0), noise(600))
    assert told.index is None
    assert "collecting" in told.verdict


def test_a_whole_stretch_is_judged_and_forgotten_when_the_loop_is_moved():
    watch = PerformanceWatch(1.0)
    told = fed(watch, 0.02 * leaning(0.9, 2400))
    assert told.index == pytest.approx(1.0 - 0.9**8, abs=0.1)
    assert told.ratio == pytest.approx(told.deviation_k / told.bound_k)
    assert told.index_error > 0.0
    watch.forget("not in mode auto")
    assert (watch.now.index, watch.now.verdict) == (None, "not in mode auto")


def test_a_power_of_nothing_is_a_bound_unless_there_is_a_cooler():
    error = 0.02 * noise(2400)
    assert fed(PerformanceWatch(1.0), error, 0.0).limit is Limit.POWER
    assert fed(PerformanceWatch(1.0, power_min=-1.0), error, 0.0).limit is Limit.NONE
