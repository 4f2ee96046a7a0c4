"""What a move of the power proves in a slow plant, and for how long that is heard."""

import math

import numpy as np
import pytest

from thermoctl.control.adaptive import Adaptive
from thermoctl.control.adaptive.bank import Bank
from thermoctl.control.adaptive.coasting import outlook
from thermoctl.estimation import start
from thermoctl.ports import Situation

EMPTY = np.empty(0)
LAW = Adaptive()


def situation(y, applied, r):
    """Return a situation of which an adaptive law uses four numbers."""
    return Situation(0.0, 1.0, y, r, applied, start(1), EMPTY, EMPTY, y)


class ColdGlass:
    """Water between a slow heater, a slow sensor and glass that begins 10 K below it."""

    gain, heater_s, sensor_s = 0.043, 22.0, 29.0
    well_s = 4.0

    def __init__(self, seed):
        self.water_c = self.sensor_c = self.well_c = 25.0
        self.glass_c, self.heat, self.rng = 15.0, 0.0, np.random.default_rng(seed)

    def reading(self, power):
        """Return what is read a second later."""
        self.heat += (1.0 - math.exp(-1.0 / self.heater_s)) * (power - self.heat)
        into_glass = 5.6e-4 * (self.water_c - self.glass_c)
        self.water_c += self.gain * self.heat - into_glass - 5e-5 * (self.water_c - 20.0)
        self.glass_c += 19.0 * into_glass - 0.0053 * self.glass_c  # ice behind it
        self.well_c += (1.0 - math.exp(-1.0 / self.well_s)) * (self.water_c - self.well_c)
        self.sensor_c += (1.0 - math.exp(-1.0 / self.sensor_s)) * (self.well_c - self.sensor_c)
        return self.sensor_c + 0.008 * self.rng.standard_normal()


def held(seed, setpoints):
    """Return the belief and the water, half an hour at each of the set points."""
    plant, belief, power, waters = ColdGlass(seed), LAW.start(), 0.0, []
    y = 25.0
    for r in setpoints:
        for _ in range(1800):
            now = situation(y, power, r)
            belief, power = LAW.decide(LAW.observe(belief, now), now)
            y = plant.reading(power)
            waters.append(plant.water_c)
    return belief, np.array(waters).reshape(len(setpoints), -1)


def settled_s(waters, r):
    """Return the time after which the water is within a tenth of a kelvin for good."""
    off = np.flatnonzero(np.abs(waters - r) > 0.1)
    return 0 if len(off) == 0 else int(off[-1]) + 1


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.slow
def test_a_slow_plant_that_began_beside_cold_glass_steps_at_the_pace_of_its_lag(seed):
    _, (_, after) = held(seed, (37.5, 40.0))
    assert after.max() < 40.1
    assert settled_s(after, 40.0) < 280


@pytest.mark.parametrize(("lag_s", "heard_s"), [(10.0, 150), (150.0, 900)])
def test_a_move_of_the_power_is_heard_until_its_heat_has_arrived(lag_s, heard_s):
    bank = Bank()
    belief = bank.observe(bank.start(), 25.0, 0.0)
    nearest = np.abs(bank.hypotheses.lag_s - lag_s) == np.abs(bank.hypotheses.lag_s - lag_s).min()
    weights = belief.weights._replace(share=nearest / nearest.sum())
    known = outlook(belief.block, belief.path, weights.share, bank.hypotheses, bank.constants)
    heard, power = 0, 1.0
    while belief.excitation.share > 0.0 or heard == 0:
        belief = bank.observe(belief, 25.0, power)._replace(weights=weights, outlook=known)
        heard += 1
    assert heard == pytest.approx(heard_s, rel=0.02)


def test_a_long_lag_that_is_no_likelier_than_a_short_one_makes_no_difference():
    bank = Bank()
    belief = bank.observe(bank.start(), 25.0, 0.0)
    after = bank.predict(belief, 1.0).excitation
    assert after.mean_power == pytest.approx(1.0 / 50.0)
