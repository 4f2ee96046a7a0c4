"""Limits that suit a plant: what is proposed follows from gain, lag and noise."""

import re
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.estimation import Order
from thermoctl.regulator.limits import command_lasts_s
from thermoctl.studies import figure as house
from thermoctl.studies.excitation import Excitation
from thermoctl.studies.plant_words import Bounded
from thermoctl.studies.record import Columns, Record
from thermoctl.studies.tuning import tune
from thermoctl.studies.tuning_figure import draw_tuning
from thermoctl.studies.tuning_limits import RUNAWAY_K, InForce, Proposal, proposed
from thermoctl.studies.tuning_words import limit_lines, limits_json

NOW = InForce(setpoint_c=37.5, highest_setpoint_c=60.0, trip_above_c=60.0, power_max=1.0)


@pytest.fixture(scope="module")
def measured():
    """A tank that rises by .05 K a second at full power."""
    rng = np.random.default_rng(6)
    u, y = np.repeat(rng.choice((0.0, 0.6), 40), 20), np.full(800, 36.0)
    for t in range(4, len(y)):
        y[t] = y[t - 1] + 0.05 * u[t - 4] - 0.001 * (y[t - 1] - 15.0)
    y += 0.01 * rng.standard_normal(len(y))
    record = Record("made", np.arange(800.0), u, y, Columns("y", "u", "t"))
    return tune(record, [Order(2, 1, 4)], 37.5)


@pytest.fixture
def plant(measured):
    """Return a function that makes a tuning of any gain in K/s, lag in s and holding power."""

    def made(slope=0.04, lag_s=15.0, holding=0.2):
        exact = (Bounded(value, value, value) for value in (60.0 * slope, lag_s, holding))
        gain, lag, power = exact
        words = replace(measured.words, gain_k_per_min=gain, lag_s=lag, holding_power=power)
        return replace(measured, words=words)

    return made


def limit(tuning, key, **now):
    (found,) = (each for each in proposed(tuning, replace(NOW, **now)) if each.key == key)
    return found


def test_a_trip_lies_twice_the_stored_heat_and_a_kelvin_above_the_set_point(plant):
    found = limit(plant(), "trip_above_c")
    assert found.value == pytest.approx(37.5 + 2 * 0.04 * 15.0 + 1.0, abs=0.5)
    assert found.value >= 37.5 + 2 * 0.04 * 15.0 + 1.0
    assert found.change  # 60 is far above


def test_a_trip_leaves_room_for_the_highest_set_point_that_may_be_asked_for(plant):
    found = limit(plant(), "trip_above_c", highest_setpoint_c=55.0)
    assert found.value > 57.0
    assert not found.change


def test_a_trip_that_stored_heat_could_reach_is_too_low(plant):
    found = limit(plant(0.2), "trip_above_c", trip_above_c=40.0, highest_setpoint_c=38.0)
    assert found.change
    assert found.value > 40.0


def test_less_power_stores_less(plant):
    full, half = (limit(plant(), "trip_above_c", power_max=most).value for most in (1.0, 0.5))
    assert half < full


def test_the_upper_bounds_count_where_they_are_known(measured):
    words = measured.words
    wide = replace(words, lag_s=replace(words.lag_s, high=words.lag_s.high + 30.0))
    values = [limit(replace(measured, words=each), "trip_above_c").value for each in (words, wide)]
    assert values[1] > values[0] + 2.0


def test_a_jump_that_healthy_readings_make_is_no_outlier(plant):
    found = limit(plant(0.8), "jump_k", jump_k=1.0)
    assert found.change
    assert found.value >= 2 * 0.8


def test_a_jump_that_is_left_out_stays_so(plant):
    found = limit(plant(0.8), "jump_k")
    assert (found.value, found.change) == (None, False)
    assert "widens by itself" in found.why


@pytest.mark.parametrize(("lag_s", "change"), [(15.0, False), (3.5, False), (2.0, True)])
def test_a_lag_holds_three_periods(plant, lag_s, change):
    found = limit(plant(lag_s=lag_s), "period_s")
    assert found.change is change
    assert 3.0 * found.value <= lag_s


def test_the_most_power_is_what_a_cut_link_may_cost(plant):
    assert limit(plant(), "power_max").value == 1.0
    fast = limit(plant(0.7), "power_max")
    assert fast.change
    late_s = command_lasts_s(1.0) + 15.0
    assert fast.value == pytest.approx(RUNAWAY_K / (0.7 * late_s), abs=0.05)


def test_the_most_power_always_holds_the_set_point_with_as_much_to_spare(plant):
    assert limit(plant(0.7, holding=0.3), "power_max").value >= 0.6
    short = limit(plant(holding=0.4), "power_max", power_max=0.5)
    assert short.change
    assert short.value >= 0.8


def test_a_limit_of_rise_is_proposed_only_where_there_is_one_that_costs_time(plant):
    assert limit(plant(), "rise_per_s").value is None
    assert limit(plant(), "rise_per_s", rise_per_s=0.01).change
    assert limit(plant(), "rise_per_s", rise_per_s=0.01).value >= 2.0 / 15.0
    assert not limit(plant(), "rise_per_s", rise_per_s=0.5).change


def test_a_dead_man_outlives_the_command_and_not_much_more(plant):
    assert limit(plant(), "dead_man_s").value >= command_lasts_s(1.0)
    assert limit(plant(), "dead_man_s", dead_man_s=60.0).change
    assert not limit(plant(), "dead_man_s", dead_man_s=2.5).change


def test_a_plant_that_was_not_heard_has_no_say(measured):
    assert proposed(replace(measured, words=None), NOW) == ()
    assert limit_lines(()) == []


def test_every_limit_is_told_with_its_reasoning(plant):
    limits = proposed(plant(), NOW)
    text = " ".join(" ".join(limit_lines(limits)).split())
    for each in limits:
        assert each.key in text
        assert " ".join(each.why.split()) in text
    assert re.search(r"trip_above_c configured: 60, proposed: 40\.?\d* ", text)
    assert [each["key"] for each in limits_json(limits)] == [each.key for each in limits]


def test_a_limit_says_what_is_configured_and_what_is_proposed():
    def told(now, value, *, change=False):
        return limit_lines([Proposal("jump_k", value, now, change, "why")])[2].split(maxsplit=1)[1]

    assert told(60.0, 58.0) == "configured: 60, which fits; proposed: 58 would do"
    assert told(60.0, 58.0, change=True) == "configured: 60, proposed: 58"
    assert told(60.0, None, change=True) == "configured: 60, proposed: left out"
    assert told(None, None) == "configured: left out, which fits"
    assert told(1.0, 1.0) == "configured: 1, which fits"


def test_the_page_holds_the_limits_below_its_panels(plant, monkeypatch):
    drawn = []

    def keep(figure, path):
        drawn.append((figure.get_figheight(), [each.get_text() for each in figure.texts]))
        return path

    monkeypatch.setattr(house, "save", keep)
    signal = Excitation(0.0, 0.6, 35.5, 37.5, 1600.0, 1.0, 0.06, 1)
    tuning = plant()
    for limits in ((), proposed(tuning, NOW)):
        draw_tuning(tuning, signal, ["unused.png"], limits)
    (short_in, nothing), (tall_in, (told,)) = drawn
    assert nothing == []
    assert tall_in > short_in + 1.0
    assert "dead_man_s" in told


def test_wakes_that_are_a_little_late_are_no_other_period(measured):
    def recorded(period_s):
        late = replace(measured.record, t_s=period_s * np.arange(800.0), nominal_s=1.0)
        return replace(measured, record=late)

    late = recorded(1.00001)
    assert late.record.period_s == 1.0
    assert limit(late, "period_s").value == 1.0
    dead_man = limit(late, "dead_man_s", dead_man_s=2.5)
    assert dead_man.value == dead_man.now == command_lasts_s(1.0) == 2.5
    assert "a command is valid for 2.5 s" in dead_man.why
    assert recorded(1.3).record.period_s == pytest.approx(1.3)
