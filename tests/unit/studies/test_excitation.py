"""A test signal: two powers, held for times between bounds, within a band."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.studies.excitation import Course, Excitation

PLAN = Excitation(0.1, 0.8, 35.0, 37.0, 1200.0, 1.0, early_k=0.05)


def powers(plan, temperatures):
    course, given_powers = Course(), []
    for t, temperature_c in enumerate(temperatures):
        course, power = plan.after(course, float(t), temperature_c)
        given_powers.append(power)
    return given_powers


def test_it_heats_until_the_middle_of_the_band_is_reached():
    course, power = PLAN.after(Course(), 0.0, 20.0)
    assert course.approaching
    assert power == 0.8
    course, power = PLAN.after(course, 1.0, 35.9)
    assert power == 0.8
    course, power = PLAN.after(course, 2.0, 36.0)
    assert not course.approaching
    assert power == 0.1  # what is stored in the element comes first


def test_in_the_middle_of_the_band_both_powers_take_turns_within_their_times():
    plan = Excitation(0.1, 0.8, 35.0, 37.0, 20_000.0, 1.0)
    given_powers = powers(plan, [36.0] * 20_000)
    changes = np.flatnonzero(np.diff(given_powers))
    shortest, longest = plan.holds_s
    assert all(shortest - 1.0 <= hold <= longest + 1.0 for hold in np.diff(changes))
    assert np.ptp(np.log(np.diff(changes))) > 0.8 * math.log(longest / shortest)
    assert set(given_powers) == {0.1, 0.8}
    assert np.mean(np.array(given_powers) == 0.8) == pytest.approx(0.5, abs=0.15)


def test_above_the_band_the_power_is_low_whatever_the_signal_says():
    assert set(powers(PLAN, [36.0] + [37.1] * 1200)[1:]) == {0.1}


def test_below_the_band_the_power_is_high_whatever_the_signal_says():
    assert set(powers(PLAN, [36.0] + [34.9] * 1200)[1:]) == {0.8}


def test_what_is_under_way_ends_the_approach_before_the_middle():
    course, power = PLAN.after(Course(), 0.0, 35.0, 1.9)
    assert (course.approaching, power) == (True, 0.8)
    course, power = PLAN.after(course, 1.0, 35.1, 1.9)
    assert (course.approaching, power) == (False, 0.1)


def test_what_is_under_way_counts_as_if_it_had_arrived():
    course, power = PLAN.after(Course(0.0, 0.8), 1.0, 35.2, 1.8)
    assert power == 0.1
    course, power = PLAN.after(course, 2.0, 35.9, 0.5)  # colder than the middle, and yet to rise
    assert (course.forced, power) == (0.1, 0.1)
    course, _ = PLAN.after(course, 3.0, 35.9, 0.1)
    assert course.forced is None


def test_what_is_said_to_cool_is_not_relied_on():
    assert PLAN.after(Course(0.0), 1.0, 36.97, -1.0) == PLAN.after(Course(0.0), 1.0, 36.97)


def test_after_an_edge_the_signal_waits_for_the_middle():
    at_last = next(t for t in range(1200) if powers(PLAN, [36.0] * 1200)[t] == 0.8)
    down = [36.0] * (at_last - 1) + [37.0, 36.9, 36.5, 36.1]
    assert powers(PLAN, down)[-4:] == [0.1] * 4
    assert powers(PLAN, [*down, 36.0])[-1] == 0.8


def test_the_power_falls_a_period_before_the_top_is_reached():
    at_last = next(t for t in range(1200) if powers(PLAN, [36.0] * 1200)[t] == 0.8)
    assert powers(PLAN, [36.0] * at_last + [36.94])[-1] == 0.8
    assert powers(PLAN, [36.0] * at_last + [36.95])[-1] == 0.1


def test_a_tank_that_is_too_hot_is_left_to_cool():
    assert powers(PLAN, [50.0, 45.0, 38.0]) == [0.1] * 3


@given(st.lists(st.one_of(st.just(math.nan), st.floats(20.0, 50.0)), min_size=1, max_size=60))
@settings(deadline=None)
def test_no_reading_at_all_gives_high_power_without_knowing_that_it_is_below_the_top(readings):
    for temperature_c, power in zip(readings, powers(PLAN, readings), strict=True):
        assert power in (0.1, 0.8)
        if not temperature_c < PLAN.top_c - PLAN.early_k:
            assert power == 0.1


def test_equal_seeds_give_equal_signals_and_others_do_not():
    other = Excitation(0.1, 0.8, 35.0, 37.0, 1200.0, seed=2)
    assert PLAN.switches_s == Excitation(0.1, 0.8, 35.0, 37.0, 1200.0).switches_s
    assert PLAN.switches_s != other.switches_s


@pytest.mark.parametrize("period_s", [0.05, 1.0, 10.0, 60.0])
def test_no_power_is_held_for_less_than_two_periods(period_s):
    plan = Excitation(0.0, 1.0, 35.0, 37.0, 1200.0, period_s)
    assert min(b - a for a, b in pairwise((0.0, *plan.switches_s))) >= 2.0 * period_s


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"low": 0.8}, "0 <= low < high <= 1, got 0.8 and 0.8"),
        ({"low": -0.1}, "got -0.1"),
        ({"high": 1.1}, "got 0.1 and 1.1"),
        ({"high": math.nan}, "expected powers"),
        ({"bottom_c": 37.0}, "a band of temperatures, got 37 to 37"),
        ({"top_c": math.nan}, "a band of temperatures"),
        ({"duration_s": 0.5}, "longer than a period of 1 s, got 0.5"),
        ({"early_k": 1.0}, "wider than 2 K"),
    ],
)
def test_an_impossible_signal_is_refused(changed, message):
    fields = {"low": 0.1, "high": 0.8, "bottom_c": 35.0, "top_c": 37.0, "duration_s": 1200.0}
    with pytest.raises(ValueError, match=message):
        Excitation(**{**fields, **changed})
