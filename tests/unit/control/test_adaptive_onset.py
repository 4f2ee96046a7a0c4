"""A start that may be in the middle of a warm-up: with heat under way, or at rest."""

import math

import numpy as np
import pytest

from thermoctl.control.adaptive import Adaptive, filters, path
from thermoctl.control.adaptive.bank_belief import Twin
from thermoctl.control.adaptive.constants import Hearing
from thermoctl.control.adaptive.filters import BETA, Prior, T, X, Z
from thermoctl.control.adaptive.twins import ONSET_SAMPLES
from thermoctl.estimation import start
from thermoctl.ports import Situation

NOTHING = start(n=1)
PAST = np.zeros(1)
LAW = Adaptive()
DEAF = Adaptive(hearing=Hearing(onset_odds=100.0))
"""Who never believes that there was heat before."""
SETPOINT_C = 40.0


class Tank:
    """Water behind dead time, element and sensor, with a little noise."""

    def __init__(self, lag_s, seed, gain=0.04, loss=0.002):
        self.gain, self.loss = gain, loss
        self.dead = [0.0] * round(0.2 * lag_s)
        self.element_s, self.sensor_s = 0.3 * lag_s, 0.5 * lag_s
        self.water_c = self.sensor_c = 25.0
        self.heat = 0.0
        self.random = np.random.default_rng(seed)

    def after(self, power):
        self.dead.append(power)
        self.heat += (self.dead.pop(0) - self.heat) / self.element_s
        self.sensor_c += (self.water_c - self.sensor_c) / self.sensor_s
        self.water_c += self.gain * self.heat - self.loss
        return self.sensor_c + 0.015 * self.random.standard_normal()


def situation(measured_c, applied, interval_s=1.0):
    return Situation(
        0.0, interval_s, measured_c, SETPOINT_C, applied, NOTHING, PAST, PAST, measured_c
    )


def run(law, tank, seconds, belief=None, power=0.0):
    """Return belief and power after `seconds` of `law` on `tank`, and how warm the water got."""
    belief, most_c = law.start() if belief is None else belief, -math.inf
    for _ in range(seconds):
        seen = situation(tank.after(power), power)
        belief, power = law.decide(law.observe(belief, seen), seen)
        most_c = max(most_c, tank.water_c)
    return belief, power, most_c


def restarted(law, lag_s, seed, after_s, model=None):
    """Return by how much the water passes the set point after a restart in a warm-up, in K."""
    tank = Tank(lag_s, seed)
    _, power, _ = run(LAW, tank, after_s)
    belief = law.start() if model is None else law.start_from(model, 0.0)
    return run(law, tank, 500, belief, power)[2] - SETPOINT_C


@pytest.mark.slow
@pytest.mark.parametrize("lag_s", [10, 20, 30, 45])
@pytest.mark.parametrize("after_s", [100, 200, 250])
def test_a_restart_in_a_warm_up_passes_the_set_point_as_little_as_a_start_from_cold(lag_s, after_s):
    passed_k = [restarted(LAW, lag_s, seed, after_s) for seed in range(4)]
    assert max(passed_k) < 0.1
    assert np.mean(passed_k) < 0.06


@pytest.mark.slow
def test_so_do_23_of_24_restarts_with_what_the_first_start_learnt():
    known, _, _ = run(LAW, Tank(20, 9), 900)
    model = LAW.remember(known)
    passed_k = [
        restarted(LAW, 20, seed, after_s, model) for seed in range(8) for after_s in (100, 200, 250)
    ]
    assert np.sum(np.array(passed_k) > 0.1) <= 1  # .43 K: odds between .85 and .9 when time was up
    assert np.mean(passed_k) < 0.06


@pytest.mark.parametrize(("lag_s", "passed_k"), [(20, 0.4), (45, 1.2)])
def test_who_believes_in_no_heat_of_before_passes_it_by_far_more(lag_s, passed_k):
    assert restarted(DEAF, lag_s, 0, 200) > passed_k


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("lag_s", [10, 40])
def test_a_plant_that_is_met_at_rest_is_taken_for_one_in_the_end(lag_s, seed):
    tank, power, belief = Tank(lag_s, seed), 0.0, LAW.bank.start()
    while belief.twin is not None:
        heat_leads = not belief.twin.heated
        belief, power = LAW.bank.observe(belief, tank.after(power), power), 1.0
    assert not heat_leads


def test_heat_leads_once_it_is_twice_as_likely_and_the_other_one_is_kept():
    tank = Tank(20, 1)
    run(LAW, tank, 150)
    belief = LAW.bank.start()
    for _ in range(25):
        belief = LAW.bank.observe(belief, tank.after(1.0), 1.0)
        assert belief.twin.heated == (belief.twin.odds <= Hearing().onset_odds)
    assert not belief.twin.heated
    assert belief.twin.belief.sample == belief.sample
    assert belief.twin.belief.twin is None


@pytest.mark.parametrize(("period_s", "samples"), [(0.5, 60), (1.0, 30), (10.0, ONSET_SAMPLES)])
def test_which_of_the_two_is_settled_after_half_a_minute_and_ten_samples(period_s, samples):
    bank = Adaptive(period_s=period_s).bank
    belief, seen = bank.start(), 0
    while belief.twin is not None:
        belief, seen = bank.observe(belief, 25.0, 0.0), seen + 1
    assert seen == samples + 1  # the first reading is sample 0


def test_no_reading_adds_more_to_the_odds_than_its_share():
    belief = LAW.bank.start()
    for y_c in (25.0, 25.0, 60.0, -40.0, 25.3, math.nan, 26.0):
        before = belief.twin.odds
        belief = LAW.bank.observe(belief, y_c, 1.0)
        assert abs(belief.twin.odds - before) <= Hearing().onset_most + 1e-12


def test_what_is_foretold_lies_between_the_two():
    bank, tank = LAW.bank, Tank(20, 1)
    run(LAW, tank, 150)
    belief = bank.start()
    for _ in range(12):
        y_c, ahead = tank.after(1.0), bank.predict(belief, 1.0)
        twin = belief.twin
        each = [
            bank.log_likelihood(one._replace(twin=None), step, y_c)
            for one, step in ((belief, ahead), (twin.belief, ahead.twin))
        ]
        assert min(each) <= bank.log_likelihood(belief, ahead, y_c) <= max(each)
        belief = bank.correct(belief, ahead, y_c)


def test_a_gap_of_unknown_power_ends_the_question():
    belief = LAW.bank.observe(LAW.bank.start(), 25.0, 0.0)
    assert isinstance(belief.twin, Twin)
    assert LAW.bank.lost(belief).twin is None


def test_a_plant_that_has_had_a_power_for_long_stays_as_it_is_under_it():
    met = path.at_rest(LAW.bank.hypotheses, 0.7)
    for before, after in zip(met, path.pushed(met, LAW.bank.hypotheses, 0.7), strict=True):
        assert after == pytest.approx(before)


def test_a_sensor_in_water_that_warms_is_behind_by_its_lag():
    hypotheses, heat = LAW.bank.hypotheses, np.full(len(LAW.bank.hypotheses), 0.8)
    block = filters.start(hypotheses, 30.0, Prior(0.04, 0.01), heat)
    behind = 0.8 * hypotheses.sensor
    assert block[T, X] - block[Z, X] == pytest.approx(0.04 * behind)
    assert block[T, BETA] == pytest.approx(0.01**2 * behind)
    assert np.array_equal(block[:, :X], block[:, :X].swapaxes(0, 1))
    known = filters.start(hypotheses, 30.0, Prior(0.04, 0.0), heat)
    assert block[T, T] - known[T, T] == pytest.approx((0.01 * behind) ** 2)
