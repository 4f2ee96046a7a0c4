"""All the heat of a heater nobody knows, against how far the reading has moved."""

import itertools
import math

import numpy as np
import pytest

from thermoctl.regulator.heater.account import FAR_K, SHOWN, WEAKEST, Account
from thermoctl.regulator.heater.question import Answer
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen

SD_K = 0.005
WEAKEST_K_PER_S = 0.009


def followed(power, reading_c, seconds=400.0):
    """Return the rows of `reading_c`, a function of time, and the account of them."""
    account, rows = Account(WEAKEST_K_PER_S), []
    poles = np.zeros((2, len(LAGS_S)))
    heat_s = np.zeros(len(LAGS_S))
    steps = -np.expm1(-4.0 / (0.5 * np.array(LAGS_S)))
    for t_s in np.arange(4.0, seconds, 4.0):
        poles[0] += steps * (power - poles[0])
        poles[1] += steps * (poles[0] - poles[1])
        heat_s = heat_s + 4.0 * poles[1]
        now = Seen(float(t_s), reading_c(float(t_s), heat_s), tuple(map(float, heat_s)))
        account.add(power, rows[-1] if rows else None, now)
        rows.append(now)
    return account, rows


def air(t_s, _):
    """Return a reading in air that goes to and fro by 0.2 K."""
    return 22.0 + 0.2 * math.sin(0.03 * t_s)


@pytest.mark.parametrize("place", range(len(LAGS_S)))
def test_a_gain_that_the_heat_so_far_does_not_bear_out_is_denied(place):
    account, rows = followed(1.0, air)
    shown = Gain(0.03, 0.005, place)
    assert account.denies(shown, rows, SD_K)
    assert account.audited(Answer.HEATS, shown, rows, SD_K) is Answer.OPEN


@pytest.mark.parametrize("share", [1.5 * SHOWN, 1.0])
def test_a_gain_of_which_a_share_has_come_is_not(share):
    account, rows = followed(1.0, lambda _, heat_s: 22.0 + float(share * 0.008 * heat_s[2]))
    shown = Gain(0.008, 0.001, 2)
    assert account.open
    assert not account.denies(shown, rows, SD_K)
    assert account.audited(Answer.HEATS, shown, rows, SD_K) is Answer.HEATS


def test_only_a_good_answer_is_audited():
    account, rows = followed(1.0, air)
    for answer in (Answer.NOTHING, Answer.COOLS, Answer.OPEN):
        assert account.audited(answer, Gain(0.03, 0.005, 2), rows, SD_K) is answer


def test_an_answer_before_any_heat_has_come_is_none():
    account, rows = followed(1.0, air, 20.0)
    shown = Gain(0.001, 0.0001, len(LAGS_S) - 1)
    assert account.audited(Answer.HEATS, shown, rows, SD_K) is Answer.OPEN


@pytest.mark.parametrize(("share", "denied"), [(0.7 * WEAKEST, True), (1.2 * WEAKEST, False)])
def test_no_heater_is_left_where_the_weakest_would_have_moved_more(share, denied):
    def reading_c(_, heat_s):
        return 22.0 + float(share * WEAKEST_K_PER_S * heat_s[-1])

    assert followed(1.0, reading_c, 900.0)[0].denies_any(SD_K) == denied


def test_less_than_nearly_full_power_is_what_holds_a_plant_and_counts_for_nothing():
    account, rows = followed(0.85, air, 3600.0)
    assert not account.denies_any(SD_K)
    assert not account.denies(Gain(0.03, 0.005, 2), rows, SD_K)


def test_a_reading_that_has_moved_as_no_air_does_needs_no_account():
    account, rows = followed(1.0, lambda t_s, _: 22.0 - FAR_K * (t_s > 40.0), 3600.0)
    assert not account.open
    assert not account.denies_any(SD_K)
    assert not account.denies(Gain(0.03, 0.005, 2), rows, SD_K)


def test_noise_is_not_taken_for_what_is_missing():
    account, rows = followed(1.0, air)
    for sd_k in (0.02, 0.5):
        assert account.denies(Gain(0.03, 0.005, 2), rows, sd_k) is (sd_k < 0.1)


def test_a_plant_that_answers_to_every_cut_and_gets_no_warmer_is_left_alone():
    """Its level follows the power within a minute and gets nowhere else."""
    account, rows = Account(WEAKEST_K_PER_S), []
    heat_s, level_k, rng = 0.0, 0.0, np.random.default_rng(1)
    for t_s in np.arange(4.0, 1600.0, 4.0):
        power = float(t_s % 400.0 < 300.0)
        heat_s += 4.0 * power
        level_k += 4.0 / 60.0 * (power - level_k)
        reading_c = 22.0 + level_k + SD_K * float(rng.standard_normal())
        now = Seen(float(t_s), reading_c, (heat_s,) * len(LAGS_S))
        account.add(power, rows[-1] if rows else None, now)
        rows.append(now)
    assert account.open
    assert not account.denies(Gain(1.0 / 60.0, 0.002, 0), rows, SD_K)
    assert not account.open


def test_a_gain_that_was_overstated_is_lowered_to_what_came_of_the_heat():
    """Without litres and watts; with them what came is less than any heater does."""
    rng = np.random.default_rng(2)

    def reading_c(_, heat_s):
        return 25.0 + float(6e-4 * heat_s[2]) + SD_K * float(rng.standard_normal())

    _, rows = followed(1.0, reading_c)
    shown = Gain(0.008, 0.001, 2)
    for weakest, left in ((6e-5, True), (WEAKEST_K_PER_S, False)):
        account = Account(weakest)
        for before, now in itertools.pairwise(rows):
            account.add(1.0, before, now)
        revised = account.revised(shown, rows, SD_K)
        assert (revised is not None) == left
        if revised is not None:
            assert revised.mean == pytest.approx(6e-4, rel=0.3)
            assert account.revised(revised, rows, SD_K) is revised
