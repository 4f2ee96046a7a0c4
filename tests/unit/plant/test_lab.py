"""The board with two heaters: its energy balance, its states of rest, its sensor."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.model.sensor import TMP36
from thermoctl.plant import lab
from thermoctl.plant.lab import LabHeat, LabParameters, TemperatureLab, lab_specimen

NOMINAL = LabParameters()
QUIET = replace(NOMINAL, room_spread_k=0.0)


def board(parameters=QUIET, seed=0):
    return TemperatureLab(parameters, np.random.default_rng(seed))


def test_what_the_heaters_give_is_stored_or_lost_to_the_room():
    one = board(NOMINAL)
    one.second_heater(0.4)
    for second in range(900):
        one.advance(1.0, 0.9 if second % 200 < 90 else 0.1)
    heat = one.heat
    risen_k = heat.first_c + heat.second_c - 2.0 * NOMINAL.room_c
    assert heat.given_j > 400.0
    assert heat.given_j - heat.lost_j == pytest.approx(2.0 * risen_k, abs=1e-9)  # 4 g of 500 J/kg K


def test_without_radiation_the_states_of_rest_are_those_of_two_linear_equations():
    plain = replace(QUIET, emissivity=0.0)
    one = board(plain)
    one.second_heater(0.5)
    one.advance(4000.0, 0.6)
    # 10 W/(m2 K) over 10 cm2 to the room, over 2 cm2 between the two.
    balance = np.array([[0.012, -0.002], [-0.002, 0.012]])
    first_k, second_k = np.linalg.solve(balance, [0.6, 0.375])
    assert one.heat[:2] == pytest.approx((23.0 + first_k, 23.0 + second_k), abs=1e-6)


def test_a_lone_heater_rests_where_the_published_balance_closes():
    one = board(replace(QUIET, between_m2=0.0))
    one.advance(4000.0, 0.5)
    T, Ta = one.temperature_c + 273.15, 296.15
    lost_w = 1e-3 * (10.0 * (T - Ta) + 0.9 * 5.670374e-8 * (T**4 - Ta**4))
    assert lost_w == pytest.approx(0.5, rel=1e-6)


def test_radiation_leaves_a_hot_board_less_gain_than_a_cool_one():
    cool, hot = board(), board()
    cool.advance(4000.0, 0.1)
    hot.advance(4000.0, 1.0)
    assert hot.temperature_c - 23.0 < 9.3 * (cool.temperature_c - 23.0)


def test_a_cold_board_rises_by_half_a_kelvin_a_second_and_by_63_per_cent_in_two_minutes():
    one = board()
    one.advance(0.5, 1.0)
    assert one.temperature_c - 23.0 == pytest.approx(0.25, rel=0.01)
    rest = board()
    rest.advance(4000.0, 0.25)
    risen_k = rest.temperature_c - 23.0
    one = board()
    one.advance(115.0, 0.25)
    assert one.temperature_c - 23.0 == pytest.approx(0.632 * risen_k, rel=0.03)


def test_the_second_heater_warms_the_first_a_little():
    one = board()
    one.second_heater(0.5)
    one.advance(4000.0, 0.0)
    assert 2.0 < one.heat.first_c - 23.0 < 0.25 * (one.heat.second_c - 23.0)


def test_the_sensor_follows_a_step_of_its_heater_as_one_lag():
    sensor_c = 23.0
    for _ in range(12):
        sensor_c = lab.followed(sensor_c, 50.0, 50.0, 0.75 / 9.0)
    assert sensor_c == pytest.approx(50.0 - 27.0 * math.exp(-1.0))


def test_the_sensor_of_a_steady_rise_is_late_by_its_lag():
    sensor_c, lag_s, slope = 20.0, 9.0, 0.3
    for second in range(200):
        before_c = 20.0 + slope * second
        sensor_c = lab.followed(sensor_c, before_c, before_c + slope, 1.0 / lag_s)
    assert sensor_c == pytest.approx(20.0 + slope * (200.0 - lag_s), abs=1e-8)


def test_the_sensor_is_a_tmp36_on_the_first_heater():
    one = board()
    one.advance(60.0, 1.0)
    assert TMP36.temperature_c(one.volts()) == pytest.approx(one.sensor_c)
    assert one.temperature_c - one.sensor_c > 2.0


def test_finer_steps_change_nothing_to_speak_of():
    coarse, fine = board(), board()
    coarse.advance(120.0, 1.0)
    for _ in range(1200):
        fine.advance(0.1, 1.0)
    assert coarse.temperature_c == pytest.approx(fine.temperature_c, abs=1e-3)
    assert coarse.sensor_c == pytest.approx(fine.sensor_c, abs=1e-3)


def test_equal_seeds_are_equal_boards_and_others_have_another_room():
    ways = []
    for seed in (1, 1, 2):
        one = board(NOMINAL, seed)
        one.advance(600.0, 0.0)
        ways.append(one.temperature_c)
    assert ways[0] == ways[1] != ways[2]


def test_a_drive_that_is_none_is_off():
    one = board()
    one.advance(10.0, math.nan)
    assert one.heat == pytest.approx(LabHeat(23.0, 23.0))


def test_specimens_keep_within_two_spreads_and_only_vary_what_varies():
    rng = np.random.default_rng(3)
    many = [lab_specimen(NOMINAL, rng) for _ in range(300)]
    lags = [each.sensor_lag_s for each in many]
    assert min(lags) == pytest.approx(9.0 * math.exp(-0.8))
    assert max(lags) == pytest.approx(9.0 * math.exp(0.8))
    for name in ("film_w_per_m2_k", "first_w", "second_w", "room_c"):
        ratios = [getattr(each, name) / getattr(NOMINAL, name) for each in many]
        assert math.exp(-0.2) - 1e-12 <= min(ratios) < 0.9 < 1.1 < max(ratios) < 1.2215
    assert {each.mass_kg for each in many} == {NOMINAL.mass_kg}


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: LabParameters(emissivity=1.2), r"emissivity must lie in \[0, 1\], got 1.2"),
        (lambda: LabParameters(sensor_lag_s=math.nan), "sensor_lag_s must lie in"),
        (lambda: board().second_heater(1.5), r"second heater must lie in \[0, 1\], got 1.5"),
        (lambda: board().advance(-1.0, 0.0), "interval_s must be at least 0 and finite, got -1"),
        (lambda: lab_specimen(NOMINAL, np.random.default_rng(0), 0.9), "spread must lie in"),
    ],
)
def test_what_cannot_be_is_refused_by_name(made, words):
    with pytest.raises(ValueError, match=words):
        made()
