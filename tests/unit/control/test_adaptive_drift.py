"""A loss that changes is no change of lag."""

import math

import numpy as np
import pytest

from thermoctl.control.adaptive.bank import Bank
from thermoctl.control.adaptive.coasting import power_for
from thermoctl.control.adaptive.evidence import Drifting

REST = 60.0


CALM = Drifting(calm=1000)


def watched(innovations, still=True, begin=CALM):
    """Return what becomes of `begin` after so many innovations, and when a drift was found."""
    drifting, found = begin, None
    for k, nu in enumerate(innovations):
        drifting = drifting.after(still, nu, REST)
        found = k if found is None and drifting.found else found
    return drifting, found


def test_white_innovations_of_a_day_are_no_drift():
    assert watched(np.random.default_rng(1).normal(size=86_400))[1] is None


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_bias_of_a_standard_deviation_is_found_within_a_minute(sign):
    for seed in range(20):
        biased = sign + np.random.default_rng(seed).normal(size=60)
        assert watched(biased)[1] is not None


def test_nothing_is_summed_while_power_moves_or_has_just_moved():
    moved, _ = watched([5.0], still=False)
    assert moved == Drifting()
    assert watched([5.0] * 59, begin=moved)[0] == Drifting(calm=59)
    assert watched([5.0] * 61, begin=moved)[0].above > 0.0


def test_power_that_moves_while_a_drift_is_suspected_does_not_end_the_suspicion():
    suspicious, _ = watched([2.0, 2.0, 2.0])
    assert suspicious.suspected
    assert watched([2.0], still=False, begin=suspicious)[0].above > suspicious.above


def test_after_a_disturbance_sums_run_until_power_has_been_steady():
    disturbed = Drifting(disturbed=True)
    assert watched([2.0], still=False, begin=disturbed)[0].above == 1.5
    rested, _ = watched([0.0] * 60, begin=disturbed)
    assert not rested.disturbed


class Vessel:
    """Water behind a heater of 14 s and a sensor of 6 s, in a room of 15 degC."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        self.water_c = self.sensor_c = 30.0
        self.heat, self.gain, self.loss_per_s = 0.0, 0.036, 4e-4

    def after(self, power):
        self.heat += (1 - math.exp(-1 / 14)) * (power - self.heat)
        self.water_c += self.gain * self.heat - self.loss_per_s * (self.water_c - 15.0)
        self.water_c += 0.001 * self.rng.standard_normal()
        self.sensor_c += (1 - math.exp(-1 / 6)) * (self.water_c - self.sensor_c)
        return self.sensor_c + 0.01 * self.rng.standard_normal()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_water_is_back_within_two_minutes_of_a_loss_twice_or_half_as_large(seed):
    bank, vessel = Bank(), Vessel(seed)
    belief, power, off_k, lags = bank.start(), 0.0, [], []
    for second in range(3000):
        if second == 1000:
            vessel.loss_per_s *= 2.0
        if second == 2000:
            vessel.loss_per_s *= 0.5
        belief = bank.observe(belief, vessel.after(power), power)
        power = power_for(belief.outlook, 37.5, 0.35, 1.0, bank.bounds, power)
        off_k.append(vessel.water_c - 37.5)
        lags.append(belief.outlook.lag_s)
    off_k = np.abs(off_k)
    print(off_k[1000:2000].max(), off_k[2000:].max(), lags[999], max(lags[1000:]))
    for changed in (1000, 2000):
        assert off_k[changed : changed + 1000].max() < 0.3
        assert off_k[changed + 120 : changed + 1000].max() < 0.1
    assert max(lags[1000:]) < 1.5 * lags[999]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_step_after_half_of_the_water_is_gone_does_not_count_on_the_other_half(seed):
    bank, vessel = Bank(), Vessel(seed)
    belief, power, waters = bank.start(), 0.0, []
    for second in range(3600):
        if second == 1200:  # half as much is warmed, and the walls that are wet are .6 of those
            vessel.gain, vessel.loss_per_s = 2.0 * vessel.gain, 1.2 * vessel.loss_per_s
        belief = bank.observe(belief, vessel.after(power), power)
        r = 37.5 if second < 2400 else 40.0
        power = power_for(belief.outlook, r, 0.35, 1.0, bank.bounds, power)
        waters.append(vessel.water_c)
    assert max(waters[2400:]) < 40.1
    assert np.abs(np.array(waters[2800:]) - 40.0).max() < 0.1
    assert belief.outlook.gain == pytest.approx(vessel.gain, rel=0.15)
