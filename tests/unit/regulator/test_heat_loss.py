"""The balance of heat: what it learns of a plant that obeys it exactly, and what it does not."""

import math

import numpy as np
import pytest

from thermoctl.quantities import Uncertain
from thermoctl.regulator.balance import heat_loss
from thermoctl.regulator.balance.heat_loss import Stretch

SPAN_S = 10.0
REST_C, SLOPE, GAIN = 15.0, 2e-4, 0.02
NOISE_K = 0.005
AT_ONCE = Uncertain(0.0, 0.0)


class Water:
    """First order: k (T - rest) is lost, gain times power won; exact over any time."""

    def __init__(self, water_c=25.0, gain=GAIN, rest_c=REST_C, seed=1):
        self.water_c, self.gain, self.rest_c = water_c, gain, rest_c
        self.rng = np.random.default_rng(seed)

    def after(self, power, span_s=SPAN_S):
        """Return the stretch in which `power` was given, with a reading at its end."""
        end_c = self.rest_c + self.gain * power / SLOPE
        self.water_c = end_c + (self.water_c - end_c) * math.exp(-SLOPE * span_s)
        reading_c = self.water_c + NOISE_K * self.rng.standard_normal()
        return Stretch(span_s, power * span_s, reading_c)


def learnt(water, powers):
    """Return what is believed after a stretch of each of `powers`."""
    belief = heat_loss.start(water.water_c)
    for power in powers:
        belief = heat_loss.after(belief, water.after(power))
    return belief


def within(known, true, sds=3.0):
    return abs(known.mean - true) <= sds * known.sd


def test_gain_loss_and_slope_are_those_of_the_plant():
    belief = learnt(Water(), [1.0] * 60 + [0.2] * 60 + [0.6] * 60)
    assert belief.gain == pytest.approx(GAIN, rel=0.02)
    assert belief.slope == pytest.approx(SLOPE, rel=0.3)
    holding = heat_loss.holding(belief, 45.0)
    assert within(holding, SLOPE * 30.0 / GAIN)
    assert holding.sd < 0.05


def test_a_warm_up_alone_says_where_it_ends_but_not_what_loss_and_gain_are():
    belief = learnt(Water(rest_c=24.0), [1.0] * 400)
    assert within(heat_loss.reach(belief, 1.0), 24.0 + GAIN / SLOPE)
    assert heat_loss.reach(belief, 1.0).sd < 15.0
    assert math.sqrt(belief.P[heat_loss.BETA][heat_loss.BETA]) > 0.1 * GAIN


def test_the_arrival_is_that_of_the_plant_within_its_error():
    water = Water(rest_c=24.0)
    belief = learnt(water, [1.0] * 60)
    told = heat_loss.arrival(belief, water.water_c, 60.0, 1.0, AT_ONCE)
    end_c = 24.0 + GAIN / SLOPE
    true_s = math.log((end_c - water.water_c) / (end_c - 60.0)) / SLOPE
    assert within(told, true_s)
    assert told.sd < 0.15 * true_s


def test_the_error_of_an_arrival_is_the_spread_of_arrivals():
    belief = learnt(Water(), [1.0] * 60 + [0.2] * 120)
    told = heat_loss.arrival(belief, 40.0, 60.0, 1.0, AT_ONCE)
    rng = np.random.default_rng(3)
    draws = rng.multivariate_normal(belief.x, belief.P, 4000)
    slope, soaks = draws[:, heat_loss.K], draws[:, heat_loss.G]
    rate = draws[:, heat_loss.BETA] - draws[:, heat_loss.D]
    begin = rate - slope * (40.0 - belief.centre_c) - soaks * belief.ahead_k
    ahead_k = heat_loss._ahead(belief.ahead_k, 20.0, float(np.median(begin)))
    end = begin - slope * 20.0 - soaks * (ahead_k - belief.ahead_k)
    times_s = 20.0 * np.log(begin / end) / (begin - end)
    wander_s = heat_loss.WANDER * belief.gain / float(np.median(begin)) * math.sqrt(told.mean)
    assert told.sd == pytest.approx(math.hypot(float(np.std(times_s)), wander_s), rel=0.3)


def test_what_is_too_far_never_arrives():
    belief = learnt(Water(rest_c=24.0), [1.0] * 400)
    assert math.isnan(heat_loss.arrival(belief, 60.0, 200.0, 1.0, AT_ONCE).mean)


def test_a_cooler_is_a_heater_upside_down():
    heated = learnt(Water(rest_c=25.0), [1.0] * 100 + [0.3] * 100)
    cooled = learnt(Water(rest_c=25.0, gain=-GAIN, seed=2), [1.0] * 100 + [0.3] * 100)
    assert cooled.gain == pytest.approx(-heated.gain, rel=0.05)
    assert heat_loss.reach(cooled, 0.2).mean < 20.0
    assert heat_loss.holding(cooled, 20.0).mean == pytest.approx(0.05, abs=0.02)
    assert heat_loss.arrival(cooled, 15.0, 10.0, 1.0, AT_ONCE).mean > 0.0


def test_a_litre_of_cold_water_is_no_other_plant():
    water = Water()
    powers = [1.0] * 60 + [0.2] * 60
    before = learnt(water, powers)
    water.water_c -= 4.0
    belief = heat_loss.after(before, water.after(0.2))
    for _ in range(10):
        belief = heat_loss.after(belief, water.after(0.2))
    assert belief.gain == pytest.approx(before.gain, rel=0.02)
    assert belief.slope == pytest.approx(before.slope, rel=0.1)
    assert belief.x[heat_loss.T] == pytest.approx(water.water_c, abs=0.05)
    assert within(heat_loss.holding(belief, 40.0), SLOPE * 25.0 / GAIN)


def test_half_the_water_is_learnt_anew():
    water = Water()
    belief = learnt(water, [1.0, 0.2] * 60)
    water.gain = 2.0 * GAIN
    for power in [1.0, 1.0, 0.2, 0.2] * 30:
        belief = heat_loss.after(belief, water.after(power))
    assert belief.gain == pytest.approx(2.0 * GAIN, rel=0.1)


def test_without_power_nothing_is_said_of_it():
    belief = learnt(Water(), [0.0] * 100)
    assert not belief.gain_known
    assert math.isnan(heat_loss.reach(belief, 1.0).mean)
    assert math.isnan(heat_loss.holding(belief, 30.0).mean)
    assert math.isnan(heat_loss.arrival(belief, 25.0, 30.0, 1.0, AT_ONCE).mean)


def test_stretches_without_a_reading_widen_what_is_known_of_the_water():
    belief = learnt(Water(), [1.0, 0.2] * 30)
    blind = belief
    for _ in range(10):
        blind = heat_loss.after(blind, Stretch(SPAN_S, 5.0, math.nan))
    assert blind.P[heat_loss.T][heat_loss.T] > belief.P[heat_loss.T][heat_loss.T]
    assert blind.stretches == belief.stretches
    assert blind.x[heat_loss.T] > belief.x[heat_loss.T]


def test_a_belief_is_carried_on_twice_with_one_result():
    water = Water()
    belief, stretch = learnt(water, [1.0] * 20), water.after(0.5)
    one, other = heat_loss.after(belief, stretch), heat_loss.after(belief, stretch)
    assert (one.x, one.P) == (other.x, other.P)


def test_a_covariance_is_symmetric_to_the_last_bit_with_and_without_a_reading():
    water = Water()
    belief = learnt(water, [1.0, 0.2] * 20)
    for stretch in (water.after(0.5), Stretch(SPAN_S, 5.0, math.nan)):
        belief = heat_loss.after(belief, stretch)
        assert tuple(zip(*belief.P, strict=True)) == belief.P


def test_a_plant_that_ran_away_when_it_was_last_seen_does_not_do_so_for_ever():
    water = Water()
    belief = learnt(water, [1.0, 0.2] * 30)
    for second in range(60):
        water.water_c += 0.002 * 1.06**second
        belief = heat_loss.after(belief, Stretch(SPAN_S, 0.0, water.water_c))
    assert belief.x[heat_loss.K] < 0.0
    for _ in range(3000):
        belief = heat_loss.after(belief, Stretch(SPAN_S, 0.0, math.nan))
    assert belief.finite
    assert abs(belief.x[heat_loss.T]) < 2000.0
    assert math.isfinite(heat_loss.spare(belief, 40.0, 1.0).sd)


def test_stretches_of_an_hour_are_as_stable_as_those_of_seconds():
    belief = learnt(Water(), [1.0, 0.2] * 30)
    for _ in range(200):
        belief = heat_loss.after(belief, Stretch(40_000.0, 0.0, math.nan))
        assert -300.0 < belief.x[heat_loss.T] < 60.0
