"""Two sensors taken for one: what they show together, and when they count as disagreeing."""

import math
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermoctl.regulator import Limits
from thermoctl.regulator.alarms import AlarmRegister
from thermoctl.regulator.judge import Judged, Verdict, judge
from thermoctl.regulator.pairing import Agreement, Pair, Pairing
from thermoctl.signals import Measurement, Quality

LIMITS = Limits(60.0, -10.0, 0.0, 60.0)
COOLS = Limits(60.0, -10.0, 0.0, 60.0, power_cools=True)
GOOD, MISSING, OPEN, SHORT, STALE = (
    Quality.GOOD,
    Quality.MISSING,
    Quality.OPEN,
    Quality.SHORT,
    Quality.STALE,
)


class House:
    """A pairing with its alarms; a sample a second unless told otherwise."""

    def __init__(self, limits=LIMITS, disagreement_k=1.0):
        self.alarms, self.events, self.t_s = AlarmRegister(), [], 0.0
        self.pairing = Pairing(limits, disagreement_k, self.alarms, self._emit)
        self.period_s = limits.period_s

    def _emit(self, name, **fields):
        self.events.append((self.t_s, name, fields["text"]))

    def fuse(self, first, second):
        self.t_s += self.period_s
        return self.pairing.fuse(self.measured(first), self.measured(second))

    def measured(self, shown):
        if isinstance(shown, Quality):
            return Measurement(self.t_s, quality=shown)
        if isinstance(shown, tuple):
            return Measurement(self.t_s, *shown)
        return Measurement(self.t_s, shown)

    def run(self, first, second, seconds):
        read = [self.fuse(first, second) for _ in range(seconds)]
        return read[-1] if read else None

    def active(self):
        return {row.code for row in self.alarms.rows() if row.active}


def one(shown):
    return House().measured(shown)


def alike(one, other):
    """Whether two measurements are the same, NaN included, and 0 of either sign."""
    same_c = other.temperature_c == pytest.approx(one.temperature_c, rel=0.0, abs=0.0, nan_ok=True)
    return same_c and (one.t_s, one.quality, one.ends_c) == (other.t_s, other.quality, other.ends_c)


SHOWN = st.one_of(
    st.floats(-20.0, 90.0),
    st.sampled_from([OPEN, SHORT, MISSING, (70.0, STALE), (20.0, STALE)]),
)


@given(st.lists(st.tuples(SHOWN, SHOWN), min_size=1, max_size=40), st.booleans())
def test_the_sensors_may_change_places(shown, cools):
    there, back = (House(COOLS if cools else LIMITS) for _ in range(2))
    swapped = {
        "sensor.first_lost": "sensor.second_lost",
        "sensor.second_lost": "sensor.first_lost",
        "sensor.disagree": "sensor.disagree",
    }
    for first, second in shown:
        assert alike(there.fuse(first, second), back.fuse(second, first))
        assert {swapped[code] for code in there.active()} == back.active()


@given(st.lists(st.tuples(SHOWN, SHOWN), min_size=1, max_size=40))
def test_what_is_controlled_by_lies_between_the_two_and_never_far_below_the_hotter(shown):
    house = House()
    for first, second in shown:
        read = house.fuse(first, second)
        if read.quality is GOOD:
            coldest_c, hottest_c = read.ends_c
            assert coldest_c <= read.temperature_c <= hottest_c
            if isinstance(first, float) and isinstance(second, float):
                most_k = 0.5 * (1.0 + house.pairing.pair.shared_k)
                assert read.temperature_c >= hottest_c - most_k - 1e-9


# first, second, quality of both together, temperature, ends
TABLE = (
    (30.0, 30.4, GOOD, 30.2, (30.0, 30.4)),
    (30.0, MISSING, GOOD, 30.0, (30.0, 30.0)),
    (30.0, OPEN, GOOD, 30.0, (30.0, 30.0)),
    (30.0, SHORT, GOOD, 30.0, (30.0, 30.0)),
    (30.0, (50.0, STALE), GOOD, 30.0, (30.0, 50.0)),
    (30.0, (math.nan, STALE), GOOD, 30.0, (30.0, 30.0)),
    (30.0, math.nan, GOOD, 30.0, (30.0, 30.0)),
    (30.0, math.inf, GOOD, 30.0, (30.0, 30.0)),
    (OPEN, MISSING, OPEN, math.nan, None),
    (OPEN, SHORT, OPEN, math.nan, None),
    (SHORT, MISSING, SHORT, math.nan, None),
    (SHORT, (50.0, STALE), SHORT, math.nan, (50.0, 50.0)),
    (MISSING, MISSING, MISSING, math.nan, None),
    (MISSING, (50.0, STALE), STALE, 50.0, (50.0, 50.0)),
    ((40.0, STALE), (50.0, STALE), STALE, 50.0, (40.0, 50.0)),
    (math.nan, math.nan, MISSING, math.nan, None),
)


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row[0]} and {row[1]}")
def test_whatever_one_of_them_lacks_the_other_goes_on(row):
    first, second, quality, temperature_c, ends_c = row
    for pair in ((first, second), (second, first)):
        read = House().fuse(*pair)
        assert read.quality is quality
        assert read.temperature_c == pytest.approx(temperature_c, nan_ok=True)
        assert read.ends_c == ends_c


def test_the_time_of_both_is_that_of_the_latest_good_sample():
    later, silent = Measurement(10.5, 30.0), Measurement(11.0, quality=MISSING)
    assert House().pairing.fuse(Measurement(10.0, 30.0), later).t_s == 10.5
    assert House().pairing.fuse(Measurement(10.0, 30.0), silent).t_s == 10.0
    assert House().pairing.fuse(silent, silent).t_s == 11.0


HEATS_AND_COOLS = Limits(60.0, -10.0, 0.0, 60.0, power_min=-1.0)


@pytest.mark.parametrize(
    ("limits", "first_c", "second_c", "verdict"),
    [
        (LIMITS, 30.0, 61.0, Verdict.OVER),
        (LIMITS, 30.0, -11.0, Verdict.GOOD),
        (COOLS, 30.0, -11.0, Verdict.UNDER),
        (COOLS, 30.0, 61.0, Verdict.GOOD),
        (HEATS_AND_COOLS, 30.0, 61.0, Verdict.OVER),
        (HEATS_AND_COOLS, 30.0, -11.0, Verdict.UNDER),
    ],
)
def test_one_sensor_trips_where_an_actuator_could_bring_the_plant(
    limits, first_c, second_c, verdict
):
    for pair in ((first_c, second_c), (second_c, first_c)):
        assert judge(Judged(), House(limits).fuse(*pair), limits).verdict is verdict


def test_a_sensor_that_is_open_or_shorted_is_told_at_once_and_one_that_is_silent_after_5_s():
    for quality, seconds, fault in ((OPEN, 1, 1), (SHORT, 1, 2), (MISSING, 5, 16)):
        house = House()
        house.run(30.0, 30.0, 60)
        house.run(30.0, quality, seconds - 1)
        assert house.active() == set()
        house.run(30.0, quality, 1)
        (row,) = house.alarms.rows()
        assert (row.code, row.priority, row.fault) == ("sensor.second_lost", 2, fault)
        assert row.text == (
            f"expected a reading of the second sensor, it is {quality.value}; "
            "the first goes on alone"
        )


def test_a_sensor_that_comes_back_is_no_longer_lost_after_5_s_and_every_loss_is_told_once():
    house = House()
    house.run(OPEN, 30.0, 100)
    house.run(30.0, 30.0, 4)
    assert house.active() == {"sensor.first_lost"}
    house.run(30.0, 30.0, 1)
    assert house.active() == set()
    assert [name for _, name, _ in house.events] == ["sensor.first_lost"]


def drifting(house, rate_k_per_min, noise_k=0.0, seed=1, seconds=1800):
    """Return the time at which a second sensor that drifts is told of, and the readings."""
    noise = noise_k * np.random.default_rng(seed).standard_normal((seconds, 2))
    for t in range(seconds):
        drift_k = rate_k_per_min * t / 60.0
        house.fuse(30.0 + noise[t, 0], 30.0 + drift_k + noise[t, 1])
        if house.active():
            return house.t_s
    raise AssertionError("never told")


@pytest.mark.parametrize("rate_k_per_min", [0.1, -0.1])
def test_a_drift_of_a_tenth_of_a_kelvin_a_minute_is_told_within_13_minutes(rate_k_per_min):
    quiet = House()
    within_s = drifting(quiet, rate_k_per_min)
    noisy_s = [drifting(House(), rate_k_per_min, 0.05, seed) for seed in range(5)]
    print(f"fault 7, {rate_k_per_min:+g} K/min: told after {within_s:.0f} s, noise of 50 mK: "
          f"{min(noisy_s):.0f} to {max(noisy_s):.0f} s")  # fmt: skip
    assert 600.0 < within_s <= 660.0
    assert 600.0 < min(noisy_s) <= max(noisy_s) <= 780.0
    (row,) = quiet.alarms.rows()
    assert (row.code, row.priority, row.fault) == ("sensor.disagree", 2, 7)
    shown_c = 30.0 + rate_k_per_min * (within_s - 1.0) / 60.0
    assert "the first shows 30.00 degC, " in row.text
    assert f"the second {shown_c:.2f} degC; the hotter counts" in row.text


def test_once_they_disagree_the_hotter_counts_and_the_colder_where_power_only_cools():
    for limits, counts_c in ((LIMITS, 33.0), (COOLS, 30.0)):
        house = House(limits)
        house.run(30.0, 30.0, 10)
        assert house.run(30.0, 33.0, 60).temperature_c == counts_c
        assert house.active() == {"sensor.disagree"}


def test_who_disagreed_agrees_again_at_half_the_distance_and_not_before():
    house = House()
    house.run(30.0, 33.0, 60)
    house.run(30.0, 30.7, 600)
    assert house.active() == {"sensor.disagree"}
    house.run(30.0, 30.4, 60)
    assert house.active() == set()
    assert house.run(30.0, 30.4, 1).temperature_c == pytest.approx(30.2)


def test_a_disagreement_outlives_the_loss_of_one_of_them():
    house = House()
    house.run(30.0, 33.0, 60)
    house.run(30.0, OPEN, 600)
    assert "sensor.disagree" in house.active()
    assert house.run(30.0, 33.0, 1).temperature_c == 33.0


def lagging(water_c, lag_s, delay_s=0):
    """Return what a sensor of this lag shows of `water_c`, a value a second."""
    follow, shown_c, at_c = -math.expm1(-1.0 / lag_s), [], water_c[0]
    for n in range(len(water_c)):
        at_c += follow * (water_c[max(n - delay_s, 0)] - at_c)
        shown_c.append(at_c)
    return shown_c


def warm_up(rate_k_per_s):
    ramp = np.minimum(20.0 + rate_k_per_s * np.arange(900), 55.0)
    return np.concatenate((np.full(60, 20.0), ramp, np.full(300, ramp[-1])))


COURSES = {
    "the rig's warm-up": warm_up(0.036),
    "a warm-up of half a litre": warm_up(0.7),
    "a jug of cold water": np.concatenate((np.full(60, 45.0), np.full(300, 38.0))),
    "half of it gone and filled up": np.concatenate((np.full(60, 55.0), np.full(300, 30.0))),
    "hot and cold in turn": 40.0 + 10.0 * np.sin(np.arange(900) / 40.0),
}


@pytest.mark.parametrize("course", COURSES)
def test_sensors_of_5_and_20_s_never_disagree_over_what_the_water_does(course):
    water_c = COURSES[course]
    quick, slow = lagging(water_c, 5.0), lagging(water_c, 20.0, delay_s=3)
    house = House()
    apart_k = 0.0
    for pair in zip(quick, slow, strict=True):
        house.fuse(*pair)
        apart_k = max(apart_k, abs(pair[0] - pair[1]))
        assert house.active() == set()
    print(f"{course}: up to {apart_k:.2f} K apart, no alarm")


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=200),
    st.floats(0.5, 30.0),
)
def test_a_follower_of_any_lag_below_30_s_stays_within_what_is_allowed(steps_k, lag_s):
    water_c = np.repeat(40.0 + np.cumsum(steps_k), 3)
    law, pair, at_c = Agreement(), Pair(), water_c[0]
    for before_c, now_c in pairwise((water_c[0], *water_c)):
        decay = math.exp(-1.0 / lag_s)  # exact for a straight line, as the law is
        slope = now_c - before_c
        at_c = now_c - slope * lag_s * (1.0 - decay) - decay * (before_c - at_c)
        pair = law.after(pair, Measurement(0.0, float(now_c)), Measurement(0.0, float(now_c)), 1.0)
        assert abs(now_c - at_c) <= pair.moved_k + 1e-9


def test_a_sensor_that_jumps_by_itself_hardly_moves_the_reading_and_is_told_within_a_minute():
    for jump_k in (-50.0, -10.0, -2.0, -1.5):
        house = House()
        house.run(30.0, 30.0, 60)
        shown_c = [house.fuse(30.0, 30.0 + jump_k).temperature_c for _ in range(60)]
        assert min(shown_c) >= 29.5
        assert house.active() == {"sensor.disagree"}
        assert shown_c[-1] == 30.0
        print(f"{jump_k:+g} K: told {house.events[0][0] - 60.0:.0f} s after")


def test_in_a_slow_loop_three_samples_decide():
    house = House(Limits(60.0, -10.0, 0.0, 60.0, period_s=60.0))
    house.run(30.0, 30.0, 5)
    house.run(30.0, 35.0, 2)
    assert house.active() == set()
    house.run(30.0, 35.0, 3)
    assert house.active() == {"sensor.disagree"}


def test_no_time_that_stands_still_jumps_or_is_none_stops_the_count():
    for times_s in ([5.0] * 40, [math.nan] * 40, [1e300] * 40, [math.inf] * 40, [-1e300] * 40):
        house = House()
        for t_s in times_s:
            house.pairing.fuse(Measurement(t_s, 30.0), Measurement(t_s, 35.0))
        assert house.active() == {"sensor.disagree"}


@pytest.mark.parametrize(
    ("name", "value"), list(product(("disagreement_k", "patience_s"), (0.0, -1.0, math.nan)))
)
def test_a_law_without_a_limit_is_refused(name, value):
    with pytest.raises(ValueError, match=f"{name} must be positive and finite, got"):
        Agreement(**{name: value})
