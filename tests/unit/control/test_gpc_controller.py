"""GPC behind the port: a loop, gaps, time, words, and what it is not fooled by."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.control.gpc import SelfTuningGpc
from thermoctl.estimation import start
from thermoctl.ports import Controller, Foretelling, Situation

AQUARIUM = Path(__file__).parents[3] / "config" / "aquarium.toml"
NOTHING, EMPTY = start(1), np.empty(0)


def situation(y, applied, r=37.5, interval_s=1.0):
    """Return a situation of which GPC uses four numbers."""
    return Situation(0.0, interval_s, y, r, applied, NOTHING, EMPTY, EMPTY, y)


class Vessel:
    """First-order heater and sensor on water that loses heat, a second a step."""

    def __init__(self, gain=0.036, loss=0.009, water_c=25.0, noise_k=0.005, seed=1, lags_s=(14, 6)):
        self.gain, self.loss, self.water_c, self.noise_k = gain, loss, water_c, noise_k
        self.follows = [1.0 - math.exp(-1.0 / lag_s) for lag_s in lags_s]
        self.sensor_c, self.heat = water_c, 0.0
        self.rng = np.random.default_rng(seed)

    def reading(self, power):
        """Return what is read a second later."""
        self.heat += self.follows[0] * (power - self.heat)
        self.water_c += self.gain * self.heat - self.loss
        self.sensor_c += self.follows[1] * (self.water_c - self.sensor_c)
        return self.sensor_c + self.noise_k * self.rng.standard_normal()


def run(law, vessel, samples, belief=None, power=0.0, r=37.5, steering=None):
    """Return belief, powers and water of a loop; `steering` gives the power in place of the law."""
    belief, powers, waters = law.start() if belief is None else belief, [], []
    y = vessel.sensor_c
    for t in range(samples):
        now = situation(y, power, r)
        belief = law.observe(belief, now)
        belief, power = law.decide(belief, now)
        power = power if steering is None else steering(t)
        powers.append(power)
        y = vessel.reading(power)
        waters.append(vessel.water_c)
    return belief, np.array(powers), np.array(waters)


@pytest.fixture(scope="module")
def settled():
    """A belief at rest at the set point, and its last power."""
    belief, powers, _ = run(SelfTuningGpc(), Vessel(), 900)
    return belief, float(powers[-1])


def resting(power, **changed):
    """Return a vessel that stands where `settled` left one."""
    vessel = Vessel(water_c=37.5, **changed)
    vessel.heat = power
    return vessel


def test_it_is_a_controller_that_foretells():
    law: Controller = SelfTuningGpc()
    assert law.name == "self-tuning-gpc"
    assert isinstance(law, Foretelling)


def test_a_vessel_it_has_never_seen_comes_to_rest_at_the_set_point():
    law = SelfTuningGpc()
    belief, powers, waters = run(law, Vessel(), 1200)
    assert waters.max() < 37.6
    assert np.abs(waters[700:] - 37.5).max() < 0.05
    assert powers.min() >= 0.0
    assert powers.max() == 1.0
    told = law.beliefs(belief, situation(37.5, 0.25))
    assert told.gain == pytest.approx(0.036, rel=0.2)
    assert told.holding_power == pytest.approx(0.25, abs=0.03)
    assert told.lag_s == pytest.approx(20.0, rel=0.5)
    assert law.remarks(belief) == {}


@pytest.mark.parametrize("seed", [2, 3])
def test_two_lags_of_forty_seconds_are_learnt_within_one_warm_up(seed):
    belief, _, waters = run(SelfTuningGpc(), Vessel(seed=seed, lags_s=(40, 40)), 1100)
    assert waters.max() < 37.65
    assert np.abs(waters[750:] - 37.5).max() < 0.1
    a1, a2 = belief.learnt.theta[:2]
    assert a1 * a1 >= 4.0 * a2 - 1e-9
    assert a2 >= -1e-9


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_sensor_slow_beside_the_horizon_is_not_hurried_by_water_that_is_too_hot(seed):
    _, _, waters = run(SelfTuningGpc(), Vessel(seed=seed, lags_s=(20, 60)), 700)
    assert waters.max() < 37.7


@pytest.mark.parametrize("factor", [0.05, 20.0])
def test_the_first_guess_of_the_gain_hardly_matters(factor):
    _, _, waters = run(SelfTuningGpc(gain_k_per_s=0.036 * factor), Vessel(), 1000)
    assert waters.max() < 37.7
    assert np.abs(waters[800:] - 37.5).max() < 0.1


def test_a_cooler_is_a_heater_seen_upside_down():
    hot, given, waters = run(SelfTuningGpc(), Vessel(noise_k=0.0), 500)
    cooling = SelfTuningGpc(action="cool")
    upside_down = Vessel(gain=-0.036, loss=-0.009, noise_k=0.0)
    cold, mirrored, depths = run(cooling, upside_down, 500, r=12.5)
    assert mirrored == pytest.approx(given, abs=1e-6)
    assert depths - 25.0 == pytest.approx(25.0 - waters, abs=1e-6)
    assert cooling.beliefs(cold, situation(12.5, 0.2, 12.5)).gain < 0.0
    assert SelfTuningGpc().beliefs(hot, situation(37.5, 0.2)).gain > 0.0


def test_more_weight_moves_the_power_less(settled):
    belief, power = settled
    travel = []
    for weight in (1.0, 10.0, 100.0):
        law = SelfTuningGpc(move_weight=weight)
        _, powers, _ = run(law, resting(power), 300, belief, power)
        travel.append(np.abs(np.diff(powers)).sum())
    assert travel[0] > 1.5 * travel[1] > 2.0 * travel[2]


@pytest.mark.parametrize("most", [0.4, 0.7])
def test_it_plans_with_no_more_power_than_the_loop_has(most):
    law = SelfTuningGpc(power_max=most)
    _, powers, waters = run(law, Vessel(water_c=34.5), 1000)
    assert powers.max() == most
    assert waters.max() < 37.6
    assert np.abs(waters[-300:] - 37.5).max() < 0.05


# -- guards ---------------------------------------------------------------------------------------


def test_saturation_does_not_wind_up():
    law, unreachable = SelfTuningGpc(), 60.0
    vessel = Vessel(loss=0.03)
    belief, powers, _ = run(law, vessel, 1500, r=unreachable)
    assert powers[-1] == 1.0
    _, powers, waters = run(law, vessel, 600, belief, 1.0, r=vessel.water_c - 0.5)
    assert powers[0] < 0.5
    assert waters[-1] == pytest.approx(waters[200:].mean(), abs=0.3)


def test_power_that_suddenly_cools_ends_in_little_power_and_a_remark(settled):
    belief, power = settled
    law = SelfTuningGpc()
    belief, powers, _ = run(law, resting(power, gain=-0.036), 1500, belief, power)
    assert "expected full power to warm" in law.remarks(belief)["controller.gain_doubtful"]
    assert powers[400:].max() < 0.3
    assert law.ride_s(belief) == 0.0


@pytest.mark.slow
def test_a_heater_that_is_mended_is_noticed_and_trusted_again(settled):
    belief, power = settled
    law, vessel = SelfTuningGpc(), resting(power, gain=0.0)
    belief, _, _ = run(law, vessel, 1000, belief, power)
    assert law.remarks(belief)
    vessel.gain = 0.036
    belief, powers, waters = run(law, vessel, 3000, belief, 0.2)
    assert law.remarks(belief) == {}
    assert powers.max() == 1.0
    assert waters.max() < 37.8
    assert np.abs(waters[-300:] - 37.5).max() < 0.05


@pytest.mark.slow
def test_a_dead_heater_from_the_start_is_tried_again_now_and_then():
    law, vessel = SelfTuningGpc(), Vessel(gain=0.0, loss=0.002)
    _, powers, _ = run(law, vessel, 4500)
    full = np.flatnonzero(powers > 0.9)
    assert 0.04 < len(full[full > 300]) / 4200.0 < 0.12


def test_readings_that_are_missing_are_bridged_by_the_model(settled):
    belief, power = settled
    law, vessel = SelfTuningGpc(), resting(power)
    now = math.nan
    for _ in range(60):
        belief = law.observe(belief, situation(now, power))
        belief, power = law.decide(belief, situation(now, power))
        assert 0.0 <= power <= 1.0
        vessel.reading(power)
    assert vessel.water_c == pytest.approx(37.5, abs=0.15)
    assert belief.record.blind == 60
    assert not belief.record.whole
    belief, _, waters = run(law, vessel, 300, belief, power)
    assert np.abs(waters - 37.5).max() < 0.2
    assert belief.record.whole


def test_what_is_made_up_in_a_gap_is_not_learnt(settled):
    belief, power = settled
    law, before = SelfTuningGpc(), settled[0].learnt
    for y in (math.nan, *[37.5] * 39):
        belief = law.observe(belief, situation(y, 1.0 - power))
    assert np.array_equal(belief.learnt.theta, before.theta)
    assert np.array_equal(belief.learnt.P, before.P)


def test_nothing_is_asked_for_before_a_reading_or_without_a_set_point(settled):
    law = SelfTuningGpc()
    belief = law.observe(law.start(), situation(math.nan, 0.0))
    assert math.isnan(law.decide(belief, situation(math.nan, 0.0))[1])
    assert math.isnan(law.decide(settled[0], situation(37.5, 0.2, math.nan))[1])
    assert law.ride_s(belief) == 0.0
    assert law.beliefs(belief, situation(math.nan, 0.0)).gain is None


def test_after_a_long_gap_the_record_begins_anew_and_the_model_stays(settled):
    belief, power = settled
    law = SelfTuningGpc()
    gone = law.observe(belief, situation(30.0, 0.0, interval_s=400.0))
    assert gone.record.samples == 1
    assert gone.record.readings_c == pytest.approx(np.full(len(gone.record.readings_c), 30.0))
    assert gone.learnt is belief.learnt
    for _ in range(310):
        belief = law.observe(belief, situation(math.nan, power))
    belief = law.observe(belief, situation(31.0, power))
    assert belief.record.samples == 1
    assert belief.record.readings_c[-1] == 31.0


# -- taking over ----------------------------------------------------------------------------------


def test_it_learns_while_another_steers_and_takes_over_without_a_bump():
    def thermostat(t):
        return 1.0 if t < 340 else 0.25

    law, vessel = SelfTuningGpc(), Vessel()
    belief, _, waters = run(law, vessel, 900, steering=thermostat)
    r = float(waters[-1])
    _, powers, waters = run(law, vessel, 300, belief, 0.25, r=r)
    assert powers[0] == pytest.approx(0.25, abs=0.05)
    assert np.abs(waters - r).max() < 0.06


def test_who_is_asked_or_not_makes_no_difference_to_what_is_believed(settled):
    belief, power = settled
    law, now = SelfTuningGpc(), situation(37.45, power)
    asked, _ = law.decide(law.observe(belief, now), now)
    again = law.observe(belief, now)
    assert np.array_equal(asked.learnt.theta, again.learnt.theta)
    assert np.array_equal(asked.record.readings_c, again.record.readings_c)
    assert asked.trusted == again.trusted


# -- time -----------------------------------------------------------------------------------------


def test_a_late_sample_is_as_good_as_the_missing_ones_before_it(settled):
    belief, law = settled[0], SelfTuningGpc()
    late = law.observe(belief, situation(37.4, 0.7, interval_s=3.0))
    one_by_one = belief
    for y in (math.nan, math.nan, 37.4):
        one_by_one = law.observe(one_by_one, situation(y, 0.7))
    assert np.array_equal(late.record.readings_c, one_by_one.record.readings_c)
    assert np.array_equal(late.learnt.theta, one_by_one.learnt.theta)


def test_samples_that_come_faster_than_the_period_give_their_mean_power(settled):
    belief, law = settled[0], SelfTuningGpc()
    quick = law.observe(belief, situation(37.5, 0.9, interval_s=0.4))
    assert quick.record is belief.record
    quick = law.observe(quick, situation(37.5, 0.3, interval_s=0.8))
    assert quick.record.samples == belief.record.samples + 1
    assert quick.record.powers[0] == pytest.approx((0.4 * 0.9 + 0.8 * 0.3) / 1.2)


@pytest.mark.parametrize("period_s", [0.5, 5.0, 20.0])
def test_a_block_is_as_many_periods_as_come_next_to_its_length(period_s):
    law = SelfTuningGpc(period_s=period_s)
    assert law.learner.size == {0.5: 20, 5.0: 2, 20.0: 1}[period_s]
    assert law.length == {0.5: 15, 5.0: 15, 20.0: 8}[period_s]


# -- words ----------------------------------------------------------------------------------------


def surprise_k(law, belief, now):
    """Return by how much the reading of `now` surprised `law`."""
    return law.surprise_k(law.observe(belief, now), now)


def test_what_is_expected_counts_the_power_that_was_applied_meanwhile(settled):
    belief, law = settled[0], SelfTuningGpc()
    cold, hot = (surprise_k(law, belief, situation(37.5, power)) for power in (0.0, 1.0))
    b1 = belief.learnt.theta[2]
    assert cold - hot == pytest.approx(b1 / 10.0 * 11.0 / 20.0)  # its tenth, at the end of a block


def test_it_says_by_how_much_a_reading_surprised_it(settled):
    belief, power = settled
    law, vessel, surprises = SelfTuningGpc(), resting(power), []
    vessel.sensor_c = vessel.water_c
    for _ in range(200):
        now = situation(vessel.reading(power), power)
        belief = law.observe(belief, now)
        surprises.append(law.surprise_k(belief, now))
    assert np.std(surprises[60:]) == pytest.approx(0.005, rel=0.25)
    assert math.isnan(surprise_k(law, law.start(), situation(37.5, power)))
    above = surprise_k(law, belief, situation(40.0, power))
    assert above == pytest.approx(2.5, abs=0.1)


@pytest.mark.parametrize("interval_s", [0.4, 2.0, 100.0])
def test_it_foretells_one_period_and_no_other_time(settled, interval_s):
    belief, power = settled
    now = situation(37.5, power, interval_s=interval_s)
    assert math.isnan(surprise_k(SelfTuningGpc(), belief, now))


@pytest.mark.parametrize(
    ("bad", "named"),
    [
        ({"n": 4}, "n must be an integer from 1 to 3, got 4"),
        ({"m": 0}, "m must be an integer from 1 to 12, got 0"),
        ({"delay": 0}, "delay must be an integer from 1 to 60, got 0"),
        ({"model_period_s": math.nan}, r"model_period_s must lie in \[0.05, 3600\], got nan"),
        ({"model_period_s": 60.0, "period_s": 0.05}, "model_period_s must be at most 50, got 60.0"),
        ({"horizon_s": 30.0}, r"horizon_s must lie in \[40, 2000\], .*, got 30.0"),
        ({"horizon_s": 2500.0}, r"horizon_s must lie in \[40, 2000\], .*, got 2500.0"),
        ({"moves": 0}, "moves must be an integer from 1 to 6, got 0"),
        ({"moves": True}, "moves must be an integer from 1 to 6, got True"),
        ({"move_weight": -1.0}, r"move_weight must lie in \[0, 1e\+06\], got -1.0"),
        ({"gain_k_per_s": 0.0}, r"gain_k_per_s must lie in \[1e-06, 10\], got 0.0"),
        ({"power_max": 1.5}, r"power_max must lie in \(0, 1\], got 1.5"),
        ({"period_s": 0.0}, r"period_s must lie in \[0.05, 3600\], got 0.0"),
        ({"action": "both"}, "action must be 'heat' or 'cool', got 'both'"),
    ],
)
def test_options_are_refused_by_name(bad, named):
    with pytest.raises(ValueError, match=f"^{named}$"):
        SelfTuningGpc(**bad)


def test_a_loop_tells_it_period_gain_and_most_power_and_an_option_is_heard_first():
    document = load(AQUARIUM).model_dump()
    table = document["loops"]["tank"]
    table.update(controller="self-tuning-gpc", shadow=None, power_max=0.6, period_s=2.0)
    law = plan_for(load(document).loops["tank"]).controller
    assert (law.period_s, law.gain_k_per_s, law.power_max) == (2.0, 0.0449, 0.6)
    table["controller"] = {"kind": "self-tuning-gpc", "gain_k_per_s": 0.1}
    assert plan_for(load(document).loops["tank"]).controller.gain_k_per_s == 0.1


def test_nothing_of_it_can_be_changed(settled):
    with pytest.raises(AttributeError):
        settled[0].trusted = 1.0
    with pytest.raises(ValueError, match="read-only"):
        settled[0].record.readings_c[0] = 0.0
    assert replace(SelfTuningGpc(), moves=2).moves == 2
