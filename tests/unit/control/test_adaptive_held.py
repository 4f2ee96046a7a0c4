"""A start that knows the plant, and finds it as it was held until just now."""

import math

import numpy as np
import pytest

from thermoctl.control.adaptive import Adaptive, filters
from thermoctl.control.adaptive.constants import Hearing
from thermoctl.control.adaptive.filters import BETA, D, Prior, T, X, Z
from thermoctl.control.adaptive.held import observed
from thermoctl.estimation import start
from thermoctl.ports import Situation

NOTHING = start(n=1)
PAST = np.zeros(1)
LAW = Adaptive()
ROOM_C, SETPOINT_C = 20.0, 50.0


class Box:
    """Quick hot air: 0.6 K/s at full power, 0.4 of which hold it, behind a slow sensor."""

    def __init__(self, seed):
        self.air_c = self.sensor_c = ROOM_C
        self.dead, self.heat = [0.0] * 3, 0.0
        self.random = np.random.default_rng(seed)

    def after(self, power):
        self.dead.append(power)
        self.heat += (self.dead.pop(0) - self.heat) / 10.0
        self.sensor_c += (self.air_c - self.sensor_c) / 15.0
        self.air_c += 0.6 * self.heat - 0.008 * (self.air_c - ROOM_C)
        return self.sensor_c + 0.02 * self.random.standard_normal()


def situation(measured_c, applied):
    return Situation(0.0, 1.0, measured_c, SETPOINT_C, applied, NOTHING, PAST, PAST, measured_c)


def run(box, seconds, belief, power=0.0):
    """Return belief and power after `seconds` of the law, and how warm the air was."""
    air_c = []
    for _ in range(seconds):
        seen = situation(box.after(power), power)
        belief, power = LAW.decide(LAW.observe(belief, seen), seen)
        air_c.append(box.air_c)
    return belief, power, np.array(air_c)


def held(seed):
    """Return a box at its set point, the power of the last second, and what was learnt of it."""
    box = Box(seed)
    belief, power, _ = run(box, 1500, LAW.start())
    return box, power, LAW.remember(belief)


def left_alone(box, power, off_s):
    """Let the daemon be gone: two seconds of the last power, and then none."""
    for second in range(off_s):
        box.after(power if second < 2 else 0.0)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("off_s", [1, 5, 60])
def test_hot_air_that_was_held_is_held_on_after_a_restart(off_s, seed):
    box, power, model = held(seed)
    left_alone(box, power, off_s)
    below_k = SETPOINT_C - box.air_c
    _, _, air_c = run(box, 600, LAW.start_from(model, float(off_s)))
    assert air_c.max() - SETPOINT_C < 1.5
    assert SETPOINT_C - air_c.min() < below_k + 3.0


@pytest.fixture(scope="module")
def model():
    return held(9)[2]


def test_a_start_that_remembers_nothing_knows_of_no_power_that_held():
    assert LAW.start().memory.held is None


def test_the_path_is_full_of_what_the_model_says_has_held(model):
    belief = LAW.start_from(model, 0.0)
    power = model["loss_k_per_s"] / model["gain_k_per_s"]
    assert 0.3 < power < 0.5
    assert belief.bank.path.heat == pytest.approx(power)
    assert belief.memory.held.belief.path.heat == pytest.approx(0.0)
    assert belief.memory.held.belief.twin.belief.path.heat == pytest.approx(1.0)


def test_full_power_that_has_long_come_leaves_only_one_past(model):
    belief = LAW.under(LAW.start_from(model, 0.0), 1.0)
    assert belief.memory.held is None
    assert belief.bank.path.heat == pytest.approx(1.0)


def test_where_a_plant_is_held_its_sensor_is_not_behind():
    hypotheses, prior = LAW.bank.hypotheses, Prior(0.6, 0.1, 0.24, 0.05, losing=1.0)
    behind_c = {}
    for power in (0.0, 0.4, 1.0):
        heat = np.full(len(hypotheses), power)
        block = filters.start(hypotheses, 50.0, prior, heat)
        behind_c[power] = block[T, X] - block[Z, X]
        assert block[:, :X] == pytest.approx(block[:, :X].swapaxes(0, 1))
        assert block[T, D] == pytest.approx(-(0.05**2) * hypotheses.sensor)
        assert block[T, BETA] == pytest.approx(0.1**2 * power * hypotheses.sensor)
    assert behind_c[0.0] == pytest.approx(-0.24 * hypotheses.sensor)
    assert behind_c[0.4] == pytest.approx(0.0, abs=1e-9)
    assert behind_c[1.0] == pytest.approx(0.36 * hypotheses.sensor)


def test_the_likelier_past_leads_until_half_a_minute_is_over(model):
    box, power, _ = held(2)
    left_alone(box, power, 60)
    belief, led = LAW.start_from(model, 60.0), set()
    for second in range(31):
        beside = belief.memory.held
        assert beside is not None
        assert beside.aside == (beside.odds < 0.0)
        belief = LAW.observe(belief, situation(box.after(0.0), 0.0))
        after = belief.memory.held
        led.add(after.aside if after else None)
        if after is not None:
            assert abs(after.odds - beside.odds) <= Hearing().onset_most + 1e-12
            assert after.belief.sample == belief.bank.sample == second
    assert led == {False, True, None}
    assert belief.bank.twin is None


def test_what_is_foretold_lies_between_the_pasts(model):
    box, power, _ = held(3)
    bank, belief = LAW.bank, LAW.start_from(model, 0.0)
    leads, beside = belief.bank, belief.memory.held
    for _ in range(12):
        y_c = box.after(power)
        each = [
            bank.log_likelihood(one, bank.predict(one, power), y_c)
            for one in (leads, beside.belief)
        ]
        leads, beside, told = observed(bank, leads, beside, y_c, power)
        assert min(each) - 1e-9 <= told <= max(each) + 1e-9
    assert math.isfinite(told)


def test_a_gap_of_unknown_power_ends_that_question_too(model):
    belief = LAW.observe(LAW.start_from(model, 0.0), situation(50.0, 0.4))
    assert belief.memory.held is not None
    gone = Situation(0.0, 600.0, 40.0, SETPOINT_C, 0.0, NOTHING, PAST, PAST, 40.0)
    assert LAW.observe(belief, gone).memory.held is None
