"""A plant beyond its set point that gets no power comes back, or something else heats it."""

import math

import numpy as np
import pytest

from thermoctl.regulator.balance.left_alone import LEFT_K, WAITS_S, Beyond, LeftAlone

STRETCH_S, GAIN, LOSS = 10.0, 0.04, 0.008


def followed(rate, seconds, alone=None, from_c=40.0, believed=LOSS):
    """Return what was made of a reading that moves by `rate` in K/s, and the most that missed."""
    alone = alone or LeftAlone()
    alone.seen(22.0)
    most, reading_c = 0.0, from_c
    for _ in range(round(seconds / STRETCH_S)):
        reading_c += rate * STRETCH_S
        most = max(most, alone.missing(Beyond(reading_c, GAIN, believed), STRETCH_S, 0.01))
    return alone, most


def test_a_plant_that_loses_a_fifth_of_what_was_believed_is_left_alone():
    _, most = followed(-0.2 * LOSS, 6000)
    assert most == 0.0


@pytest.mark.parametrize("rate", [0.0, 0.002, -0.05 * LOSS])
def test_a_plant_that_does_not_come_back_is_a_doubt(rate):
    _, most = followed(rate, WAITS_S + 2.5 * LEFT_K / (0.1 * LOSS))
    assert most >= 1.0


def test_it_is_told_where_nothing_was_known_of_a_loss():
    _, most = followed(0.0, 7200, believed=-0.001)
    assert most >= 1.0


def test_heat_that_is_under_way_is_no_doubt():
    _, most = followed(0.03, WAITS_S)
    assert most == 0.0


def test_hot_water_is_no_doubt():
    alone, _ = followed(-LOSS, 600)
    _, most = followed(-LOSS, 600, alone, from_c=50.0)
    assert most < 1.0


def test_a_plant_that_comes_near_the_air_around_it_may_be_slow():
    alone, _ = followed(-LOSS, 1750)
    _, most = followed(-0.05 * LOSS, 3000, alone, from_c=26.0)
    assert most == 0.0


def test_what_was_missing_is_soon_over_when_the_plant_comes_back():
    alone, most = followed(0.0, 7200)
    assert most > 1.0
    _, most = followed(-LOSS, 300, alone)
    assert alone.missing(Beyond(37.0, GAIN, LOSS), STRETCH_S, 0.01) == 0.0


def test_each_time_without_power_begins_anew():
    alone, _ = followed(0.0, 7200)
    alone.clear()
    _, most = followed(0.0, WAITS_S, alone)
    assert most == 0.0


def stays(reading_c, hours, setpoint_c=15.0):
    """Return what is said of `reading_c` at each time in s, with noise, at last and at most."""
    alone, rng = LeftAlone(), np.random.default_rng(1)
    said = []
    for t_s in range(0, 3600 * hours, 10):
        here_c = reading_c(t_s) + 0.01 * rng.standard_normal()
        alone.missing(Beyond(here_c, 0.0, 0.0), 10.0, 0.01)
        said.append(alone.stays(here_c, here_c - setpoint_c, 10.0))
    return said[-1], max(said)


def test_a_plant_that_stands_in_the_air_above_its_set_point_stays_there():
    last, _ = stays(lambda t_s: 22.0 + 8.0 * math.exp(-t_s / 1800.0), 6)
    assert last > 1.0


@pytest.mark.parametrize("air_c", [10.0, 24.5])
def test_a_large_tank_that_cools_within_days_does_not_stay(air_c):
    _, most = stays(lambda t_s: air_c + (30.0 - air_c) * math.exp(-t_s / 200_000.0), 48, 25.0)
    assert most < 0.3


def test_a_plant_that_begins_to_come_back_no_longer_stays():
    last, most = stays(lambda t_s: 22.0 - max(t_s - 9000.0, 0.0) / 3600.0, 5)
    assert most > 1.0
    assert last < 0.3
