"""Drifts: named when they stand out, ended when they are over."""

from __future__ import annotations

import numpy as np
import pytest

from thermoctl.insight.drifts import Baseline, Compared, Hysteresis
from thermoctl.insight.faults import ELEMENT, LOSS, NORMAL_AFTER, WATER, WIRING, Faults
from thermoctl.quantities import Uncertain


def turned(powers, noises=None):
    """Return faults after turns at rest."""
    faults = Faults()
    noises = [0.02] * len(powers) if noises is None else noises
    for k, (power, noise) in enumerate(zip(powers, noises, strict=True)):
        faults.turn(300.0 * k, power, noise)
    return faults


def around(value, count, seed=1, share=0.02):
    return (value * (1.0 + share * np.random.default_rng(seed).normal(size=count))).tolist()


def test_a_third_more_power_to_hold_is_named_and_ends_with_its_cause():
    lid_off = turned(around(0.19, 12) + around(0.26, 4))
    assert set(lid_off.active) == {LOSS}
    assert "lid off" in lid_off.active[LOSS].text
    assert lid_off.active[LOSS].before == pytest.approx(0.19, rel=0.03)
    assert lid_off.active[LOSS].now == pytest.approx(0.26, rel=0.03)
    assert turned(around(0.19, 12) + around(0.26, 6) + around(0.19, 5)).active == {}


def test_a_tenth_more_or_a_single_turn_is_not_named():
    assert turned(around(0.19, 12) + around(0.21, 12)).active == {}
    assert turned([*around(0.19, 12), 0.26, *around(0.19, 3)]).active == {}


def test_a_share_of_next_to_nothing_is_not_named():
    assert turned(around(0.03, 12) + around(0.04, 6)).active == {}


def test_what_changes_over_hours_is_followed():
    powers = np.array(around(1.0, 120)) * np.linspace(0.12, 0.24, 120)
    assert turned(powers.tolist()).active == {}


def test_more_power_for_four_hours_is_the_usual():
    assert turned(around(0.19, 12) + around(0.26, NORMAL_AFTER + 6)).active == {}


def test_noise_that_doubled_is_named():
    faults = turned([0.19] * 20, around(0.02, 14) + around(0.05, 6))
    assert set(faults.active) == {WIRING}
    assert faults.active[WIRING].before == pytest.approx(0.02, rel=0.03)
    assert faults.active[WIRING].now == pytest.approx(0.05, rel=0.03)


def gains(*values, diluted=0.0):
    faults = Faults()
    faults.add_cold(diluted)
    told = [
        faults.take_gain(float(k), Uncertain(each, 0.01 * each)) for k, each in enumerate(values)
    ]
    return faults, told


def test_a_gain_that_doubled_is_water_that_is_gone_until_it_is_back():
    faults, told = gains(0.044, 0.045, 0.088)
    assert set(faults.active) == {WATER}
    assert "about 50 % of it left" in faults.active[WATER].text
    assert told[-1].share == pytest.approx(1.0)
    faults, told = gains(0.044, 0.088, 0.044)
    assert faults.active == {}
    assert told[-1] is not None


def test_a_gain_that_fell_by_a_third_is_an_element_that_is_weak():
    faults, _ = gains(0.044, 0.030)
    assert set(faults.active) == {ELEMENT}


def test_cold_water_that_came_in_explains_a_gain_that_fell():
    assert gains(0.044, 0.030, diluted=0.45)[0].active == {}


def test_a_gain_within_what_two_moves_differ_by_is_no_news():
    faults, told = gains(0.043, 0.046, 0.041)
    assert faults.active == {}
    assert told == [None, None, None]


def test_a_weak_element_explains_the_power_to_hold():
    faults = turned(around(0.19, 12) + around(0.26, 4))
    for value in (0.044, 0.031):
        faults.take_gain(5000.0, Uncertain(value, 0.01 * value))
    assert set(faults.active) == {ELEMENT}


def test_a_large_drift_within_its_own_error_is_none():
    assert not Compared(Uncertain(1.0, 0.3), Uncertain(1.5, 0.3)).beyond(0.2)
    assert Compared(Uncertain(1.0, 0.05), Uncertain(1.5, 0.05)).beyond(0.2)
    assert Compared(Uncertain(1.0, 0.05), Uncertain(0.5, 0.05)).beyond(-0.2)


def test_a_condition_between_beginning_and_ending_stays_what_it_is():
    drifted, half = Hysteresis(0.2, 2), Compared(Uncertain(1.0, 0.01), Uncertain(1.15, 0.01))
    full = Compared(Uncertain(1.0, 0.01), Uncertain(1.3, 0.01))
    assert [drifted.after(each) for each in (half, half, full, full)] == [False, False, False, True]
    assert [drifted.after(half) for _ in range(5)] == [False] * 5
    assert drifted.stands


def test_a_baseline_that_is_not_to_follow_stays():
    baseline = Baseline(4, 24, 2)
    for each in around(1.0, 10):
        baseline.after(each)
    for _ in range(50):
        compared = baseline.after(2.0, follow=False)
    assert compared.before.mean == pytest.approx(1.0, rel=0.03)
    assert compared.now.mean == 2.0
