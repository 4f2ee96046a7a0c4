"""Which rises without power prove that a heater is stuck on."""

import math

import pytest

from thermoctl.regulator.heater.known import KnownHeater
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen
from thermoctl.regulator.heater.rising import LATELY_S, rising

STEP_S, SD_K, GAIN, LOSS = 4.0, 0.01, 0.1, 0.01


def heater(*lags_s):
    """Return a heater of which one lag was learnt after another, each less surely."""
    known = KnownHeater()
    arrived = Seen(0.0, 30.0, (1000.0,) * len(LAGS_S))
    for count, lag_s in enumerate(lags_s, 1):
        known.learn(Gain(GAIN, count * GAIN / 50.0, LAGS_S.index(lag_s)), arrived, 10.0, SD_K)
    return known


def rows(readings_c):
    """Return readings at their times."""
    heat_s = (0.0,) * len(LAGS_S)
    return [Seen(STEP_S * place, each, heat_s) for place, each in enumerate(readings_c)]


def rate(readings_c, off_s, known):
    seen = rows(readings_c)
    return rising(seen, known, seen[-1], off_s, SD_K, LOSS)


def test_a_rise_without_power_is_told_by_its_sure_slope():
    found = rate([30.0 + 0.05 * STEP_S * count for count in range(20)], 60.0, heater(9.0))
    assert 0.045 < found < 0.05
    assert rate([30.0] * 20, 60.0, heater(9.0)) <= 0.0


def test_too_few_readings_or_an_unknown_heater_show_nothing():
    assert math.isnan(rate([30.0, 30.4], 4.0, heater(9.0)))
    assert math.isnan(rate([30.0 + count for count in range(9)], 30.0, KnownHeater()))


def test_a_reading_that_comes_back_after_a_load_proves_nothing_below_where_it_fell_from():
    fallen = [37.0] * 10 + [36.0, 35.0, 34.0]
    below = fallen + [34.0 + 0.4 * count for count in range(1, 7)]
    assert rate(below, 24.0, heater(9.0)) == 0.0
    beyond = fallen + [34.0 + 0.4 * count for count in range(1, 10)]
    assert rate(beyond, 36.0, heater(9.0)) > 0.08


def test_nor_does_it_minutes_later_excuse_a_rise():
    lately = round(LATELY_S / STEP_S)
    readings_c = [37.0] * 5 + [34.0] * lately + [34.0 + 0.4 * count for count in range(1, 6)]
    assert rate(readings_c, 20.0, heater(9.0)) > 0.08


def test_a_fall_by_the_loss_alone_is_no_load():
    fallen = [37.0 - LOSS * STEP_S * count for count in range(40)]
    risen = fallen + [fallen[-1] + 0.2 * count for count in range(1, 6)]
    assert risen[-1] < 37.0
    assert rate(risen, 20.0, heater(9.0)) > 0.04


@pytest.mark.parametrize(("off_s", "proves"), [(40.0, False), (48.0, True), (80.0, True)])
def test_a_steady_rise_proves_it_once_the_lag_told_most_surely_is_over(off_s, proves):
    steady = [30.0 + 0.05 * STEP_S * count for count in range(40)]
    known = heater(45.0, 20.0)
    assert (known.gain.lag_s, known.surest_lag_s) == (20.0, 45.0)
    assert (rate(steady, off_s, known) > 0.0) is proves


@pytest.mark.parametrize(("off_s", "proves"), [(48.0, False), (100.0, False), (120.0, True)])
def test_one_that_slows_down_may_be_of_heat_under_way(off_s, proves):
    slowing = [30.0 - 20.0 * math.exp(-STEP_S * count / 60.0) for count in range(40)]
    assert (rate(slowing, off_s, heater(45.0, 20.0)) > 0.0) is proves


def test_a_lag_shrinks_by_one_place_only_unless_it_is_told_more_surely():
    assert heater(45.0, 9.0).gain.lag_s == 20.0
    known = heater(45.0, 20.0)
    sure = Gain(GAIN, GAIN / 100.0, LAGS_S.index(4.0))
    known.learn(sure, Seen(0.0, 30.0, (1000.0,) * len(LAGS_S)), 10.0, SD_K)
    assert known.gain is sure


def test_a_heater_that_full_power_outdoes_by_far_is_outdone():
    known, (before, now) = heater(9.0), rows([30.0, 30.0 + 2.4 * GAIN * STEP_S])
    assert not any(known.outdone(1.0, before, now, SD_K) for _ in range(50))
    now = now._replace(reading_c=30.0 + 4.0 * GAIN * STEP_S)
    assert not known.outdone(0.5, before, now, SD_K)
    assert known.outdone(1.0, before, now, SD_K)
