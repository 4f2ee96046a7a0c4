"""The bank with a heater and a cooler behind one signed power, and laws that only cool."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.control.adaptive import Adaptive
from thermoctl.control.cooling import heat_of, power_for_heat
from thermoctl.control.mirror import mirrored
from thermoctl.control.on_off import OnOff
from thermoctl.control.pid import Pid
from thermoctl.estimation import start
from thermoctl.ports import Situation

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

BETA, LAG_S = 0.04, 20.0


def situation(measured_c, setpoint_c, applied, t_s=0.0):
    past = np.array([measured_c])
    return Situation(
        t_s, 1.0, measured_c, setpoint_c, applied, start(1), past, np.array([applied]), measured_c
    )


class Plant:
    """An integrator behind a lag, with a loss and a cooler of `ratio` times the heater."""

    def __init__(self, law, ratio, water_c, loss=0.0):
        self.law, self.ratio, self.loss = law, ratio, loss
        self.belief, self.water_c, self.heat, self.power = law.start(), water_c, 0.0, 0.0
        self.rng = np.random.default_rng(5)
        self.powers, self.waters_c = [], []

    def hold(self, setpoint_c, seconds):
        for _ in range(seconds):
            heat = self.power * (self.ratio if self.power < 0.0 else 1.0)
            self.heat += (heat - self.heat) / LAG_S
            self.water_c += BETA * self.heat - self.loss
            reading_c = self.water_c + 0.01 * self.rng.standard_normal()
            seen = situation(reading_c, setpoint_c, self.power)
            self.belief = self.law.observe(self.belief, seen)
            self.belief, self.power = self.law.decide(self.belief, seen)
            self.powers.append(self.power)
            self.waters_c.append(self.water_c)
        return seen


@pytest.mark.parametrize("ratio", [0.1, 0.3, 1.0, 2.0])
def test_a_gain_of_the_heater_is_learnt_from_the_cooler_too_and_steps_do_not_overshoot(ratio):
    plant = Plant(Adaptive(action="heat-cool", cooling_ratio=ratio), ratio, 35.0, loss=-0.001)
    plant.hold(25.0, 3600)
    down_c = min(plant.waters_c)
    seen = plant.hold(28.0, 600)
    up_c = max(plant.waters_c[-600:])
    believed = plant.law.plant(plant.belief)
    print(f"ratio {ratio:g}: {25.0 - down_c:.3f} K below, {up_c - 28.0:.3f} K above")
    assert 25.0 - down_c < 0.1
    assert up_c - 28.0 < 0.1
    assert believed.gain_k_per_s == pytest.approx(BETA, rel=0.2)
    assert believed.holding_power == pytest.approx(-0.001 / (BETA * ratio), abs=0.1)
    beliefs = plant.law.beliefs(plant.belief, seen)
    assert beliefs.holding_power == pytest.approx(believed.holding_power)


def test_power_lies_in_the_signed_range_and_uses_all_of_it():
    plant = Plant(Adaptive(action="heat-cool", cooling_ratio=0.2), 0.2, 30.0)
    plant.hold(20.0, 300)
    plant.hold(40.0, 300)
    assert min(plant.powers) == -1.0
    assert max(plant.powers) == 1.0


def test_with_the_heater_alone_in_use_it_is_the_law_that_only_heats():
    """Until anything asks for cooling, both keep the same beliefs to the last bit."""
    both = Plant(Adaptive(action="heat-cool", cooling_ratio=0.2), 0.2, 20.0)
    heats = Plant(Adaptive(), 0.2, 20.0)
    both.hold(40.0, 200)
    heats.hold(40.0, 200)
    assert both.powers == heats.powers


@settings(max_examples=100, deadline=None, derandomize=True)
@given(power=st.floats(-1.0, 1.0), ratio=st.floats(0.02, 10.0))
def test_heat_and_power_are_each_other_s_inverse(power, ratio):
    law = Adaptive(action="heat-cool", cooling_ratio=ratio)
    assert power_for_heat(heat_of(power, ratio), ratio) == pytest.approx(power)
    assert heat_of(-1.0, ratio) == -ratio == law.bank.u_min


@pytest.mark.parametrize("law", [Adaptive, Pid])
@pytest.mark.parametrize("ratio", [0.0, 0.01, 11.0, math.nan, -0.2])
def test_a_ratio_out_of_range_is_refused_by_name(law, ratio):
    with pytest.raises(ValueError, match="cooling_ratio"):
        law(action="heat-cool", cooling_ratio=ratio)


@pytest.mark.parametrize("law", [Adaptive, OnOff, Pid])
def test_another_action_is_refused_by_name(law):
    with pytest.raises(ValueError, match="action must be"):
        law(action="freeze")


# -- laws that only cool ---------------------------------------------------------------------------


def test_a_thermostat_that_cools_is_on_above_and_off_below():
    law = OnOff(hysteresis_k=1.0, action="cool")
    on, power = law.decide(False, situation(25.0, 20.0, 0.0))
    assert (on, power) == (True, 1.0)
    assert law.decide(True, situation(20.2, 20.0, 1.0)) == (True, 1.0)
    assert law.decide(True, situation(19.0, 20.0, 1.0)) == (False, 0.0)


def test_a_pid_that_cools_is_one_that_heats_seen_upside_down():
    heats, cools = Pid(tuning="simc"), Pid(tuning="simc", action="cool")
    ours, theirs = cools.start(), heats.start()
    rng, water_c = np.random.default_rng(7), 30.0
    power = 0.0
    for t in range(300):
        water_c -= 0.02 * power - 0.002
        seen = situation(water_c + 0.01 * rng.standard_normal(), 20.0, power, float(t))
        ours, theirs = cools.observe(ours, seen), heats.observe(theirs, mirrored(seen))
        ours, power = cools.decide(ours, seen)
        theirs, other = heats.decide(theirs, mirrored(seen))
        assert power == other
        power = min(max(power, 0.0), 1.0)
    assert power > 0.0
    gain, mirror = cools.beliefs(ours, seen).gain, heats.beliefs(theirs, seen).gain
    assert gain == (None if mirror is None else -mirror)


def test_a_mirrored_situation_is_its_own_mirror_and_leaves_power_alone():
    ramped = {"measured_c": 21.5, "setpoint_rate_k_per_s": 0.01, "target_c": 25.0}
    seen = replace(situation(21.0, 20.0, 0.3), **ramped)
    turned, again = mirrored(seen), mirrored(mirrored(seen))
    for name in ("temperature_c", "setpoint_c", *ramped):
        assert getattr(turned, name) == -getattr(seen, name) == -getattr(again, name)
    assert mirrored(seen).applied == 0.3
