"""Noise that is not white: readings in steps, and readings that hum."""

import math

import numpy as np
import pytest

from thermoctl.control.adaptive import Adaptive
from thermoctl.control.adaptive.colour import WHITE
from thermoctl.control.adaptive.constants import Hearing
from thermoctl.control.adaptive.evidence import NOISE_MIN_K2, Noise, weighted
from thermoctl.estimation import start
from thermoctl.ports import Situation

SETPOINT_C = 37.5
STEP_K = 0.39
"""An LM335 on eight bits of 100 K."""


def noise_of(readings_c):
    noise = Noise()
    for y_c in readings_c:
        noise = noise.after(y_c)
    return noise


def in_steps(values, step_k=STEP_K):
    return np.round(np.asarray(values) / step_k) * step_k


def test_a_reading_that_stands_on_its_step_is_still_known_no_better_than_the_step():
    noise = noise_of(in_steps(np.concatenate([np.linspace(20.0, 37.5, 400), np.full(3000, 37.5)])))
    assert noise.variance < 1e-3 * STEP_K**2
    assert noise.believed == pytest.approx(STEP_K**2 / 12.0)


def test_readings_finer_than_their_noise_are_believed_as_before():
    white = 25.0 + 0.02 * np.random.default_rng(1).standard_normal(2000)
    for readings_c in (white, in_steps(white, 0.01)):
        noise = noise_of(readings_c)
        assert noise.believed == noise.variance


def test_noise_that_never_repeats_has_no_step_however_long_its_first_strides():
    noise = noise_of([20.0, 40.0, 21.0])
    assert noise.least == NOISE_MIN_K2


def test_a_smaller_step_takes_the_place_of_a_larger_one():
    coarse = noise_of([20.0, 20.4, 20.4])
    assert coarse.least == pytest.approx(0.16 / 12.0)
    assert coarse.after(20.6).least == pytest.approx(0.04 / 12.0)


def test_a_plant_that_strides_and_stands_is_not_taken_for_a_coarse_sensor():
    assert noise_of([20.0, 23.0, 23.0]).least == NOISE_MIN_K2


def test_a_reading_that_has_not_left_its_first_step_is_no_evidence():
    law = Adaptive()
    belief = law.bank.start()
    for _ in range(30):
        belief = law.bank.observe(belief, 20.28, 1.0)
        assert belief.heard == 0.0
    assert law.bank.observe(belief, 20.67, 1.0).heard > 0.0


def test_a_reading_that_has_always_been_the_same_shows_no_step():
    assert noise_of([20.0] * 50).least == NOISE_MIN_K2


def white_and(hum_k, period_s):
    """Return what a sensor of .02 K makes of a temperature, with a hum on it."""
    return lambda k, c, random: (
        c + 0.02 * random.standard_normal() + hum_k * math.sin(2.0 * math.pi * k / period_s)
    )


def rounded(_, c, random):
    return float(in_steps(c + 0.01 * random.standard_normal()))


def warmed(sensed, seed, lag_s=20.0, gain=0.045, loss=0.002, seconds=2400):
    """Return by how much a tank passes its set point, how far off it rests, in K, and the bank."""
    law, nothing = Adaptive(), start(n=1)
    belief, power, random = law.start(), 0.0, np.random.default_rng(seed)
    dead, element_s, sensor_s = [0.0] * round(0.2 * lag_s), 0.3 * lag_s, 0.5 * lag_s
    water_c = sensor_c = 20.0 + 0.2 * random.standard_normal()
    heat, away_k = 0.0, []
    for k in range(seconds):
        y_c = sensed(k, sensor_c, random)
        seen = Situation(0.0, 1.0, y_c, SETPOINT_C, power, nothing, np.zeros(1), np.zeros(1), y_c)
        belief, power = law.decide(law.observe(belief, seen), seen)
        dead.append(power)
        heat += (dead.pop(0) - heat) / element_s
        sensor_c += (water_c - sensor_c) / sensor_s
        water_c += gain * heat - loss
        away_k.append(water_c - SETPOINT_C)
    return max(away_k), max(np.abs(away_k[-900:])), belief.bank


@pytest.mark.slow
def test_a_warm_up_on_eight_bits_learns_the_lag_and_passes_by_little_more_than_a_step():
    for seed in range(4):
        over_k, _, bank = warmed(rounded, seed)
        assert over_k < 1.25 * STEP_K
        assert 10.0 < bank.outlook.lag_s < 40.0


@pytest.mark.slow
@pytest.mark.parametrize(("hum_k", "period_s"), [(0.1, 15.0), (0.1, 37.0), (0.2, 37.0)])
def test_a_sensor_that_hums_is_heard_to_and_the_water_rests(hum_k, period_s):
    for seed in range(2):
        over_k, rests_k, bank = warmed(white_and(hum_k, period_s), seed)
        assert bank.noise.colour.variance > hum_k**2 / 4.0
        assert over_k < 0.25
        assert rests_k < 0.1


def test_white_noise_has_no_colour_and_a_hum_of_its_size_has():
    random, white, hum = np.random.default_rng(5), WHITE, WHITE
    for k in range(400):
        white = white.after(0.02 * random.standard_normal(), 4e-4, Hearing())
        hum = hum.after(0.03 * math.sin(k / 6.0), 4e-4, Hearing())
    assert (white.variance, white.news, white.most) == (0.0, 1.0, 1.0)
    assert hum.variance > 4e-4
    assert hum.news < 0.1


def test_what_is_off_to_one_side_is_a_plant_and_no_colour():
    colour = WHITE
    for _ in range(400):
        colour = colour.after(0.05, 4e-4, Hearing())
    assert colour.variance < 1e-4


def test_weights_are_tempered_once_by_the_factor_by_which_noise_was_too_small():
    log = np.array([0.0, -4.0, -12.0])
    assert weighted(log).tempered(0.25).log == pytest.approx([0.0, -1.0, -3.0])
