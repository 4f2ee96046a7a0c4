"""Heater and cooler behind one signed power: safe is 0, and never are both on."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.errors import Refused
from thermoctl.regulator import Limits, Regulator
from thermoctl.regulator.changeover import Changeover
from thermoctl.signals import Beliefs, ManualPower, Measurement, Mode, Quality, State

LOOP = {"setpoint_c": 20.0, "trip_above_c": 60.0, "trip_below_c": 5.0, "mode": "auto"}
BOTH = {"power_min": -1.0}
COOLS = {"power_cools": True}


@dataclass
class Wish:
    """A controller that asks for whatever it was told to."""

    power: float = 0.0
    holding: float | None = None
    name: ClassVar[str] = "wish"

    def start(self):
        return None

    def observe(self, belief, situation):
        return belief

    def decide(self, belief, situation):
        return belief, self.power

    def beliefs(self, belief, situation):
        return Beliefs(holding_power=self.holding)

    def ride_s(self, belief):
        return 60.0

    def remarks(self, belief):
        return {}


class Bench:
    """A regulator of a loop with these limits, second by second."""

    def __init__(self, power=0.0, holding=None, **limits):
        plan = plan_for(load({"loops": {"tank": LOOP}}).loops["tank"])
        self.wish = Wish(power, holding)
        limits = replace(plan.limits, **limits)
        self.subject = Regulator(replace(plan, limits=limits, controller=self.wish))
        self.t_s = 0.0

    def see(self, asked=None, temperature_c=20.0, quality=Quality.GOOD):
        self.t_s += 1.0
        if asked is not None:
            self.wish.power = asked
        return self.subject.step(Measurement(self.t_s, temperature_c, quality))

    def power(self, asked=None, **seen):
        return self.see(asked, **seen).command.power


# -- bounds ----------------------------------------------------------------------------------------


def test_a_cooler_takes_negative_powers_down_to_its_limit():
    assert Bench(**BOTH).power(-0.3) == -0.3
    assert Bench(**BOTH).power(-7.0) == -1.0
    assert Bench(power_min=-0.4).power(-7.0) == -0.4


def test_without_a_cooler_a_negative_power_is_0():
    step = Bench().see(-0.3)
    assert step.command.power == 0.0
    assert step.command.reason == "limit.low"


@pytest.mark.parametrize("asked", [math.nan, math.inf, -math.inf, "full"])
def test_what_is_no_power_is_0_and_not_full_cooling(asked):
    step = Bench(**BOTH).see(asked)
    assert step.command.power == 0.0
    assert step.command.reason == "output.nan"


def test_rising_is_slowed_on_both_sides_and_falling_on_none():
    bench = Bench(**BOTH, rise_per_s=0.1)
    assert [bench.power(-1.0) for _ in range(3)] == pytest.approx([-0.1, -0.2, -0.3])
    assert bench.power(-0.05) == -0.05
    assert bench.power(1.0) == 0.0
    assert [bench.power(1.0) for _ in range(2)] == pytest.approx([0.1, 0.2])


# -- one after the other ---------------------------------------------------------------------------


def test_between_heater_and_cooler_there_is_a_command_of_0():
    bench = Bench(**BOTH)
    assert [bench.power(each) for each in (0.5, -0.5, -0.5, 0.5, 0.5)] == [0.5, 0, -0.5, 0, 0.5]
    assert bench.see(-0.5).command.reason == "limit.changeover"


def test_the_dead_time_between_them_is_kept_and_the_same_one_may_come_back_at_once():
    bench = Bench(**BOTH, changeover_s=5.0)
    assert bench.power(0.5) == 0.5
    assert [bench.power(-0.5) for _ in range(6)] == [0, 0, 0, 0, 0, -0.5]
    assert [bench.power(each) for each in (0.0, -0.5, 0.0, 0.5)] == [0, -0.5, 0, 0]


def test_the_other_one_waits_for_an_output_that_stays_on():
    bench = Bench(**BOTH, applied_tolerance=1.0)
    bench.power(0.5)
    for _ in range(3):
        assert bench.power(-0.5) == 0.0
        bench.subject.applied(0.5)  # told 0, and still on
    assert bench.power(-0.5) == 0.0
    bench.subject.applied(0.0)
    assert bench.power(-0.5) == -0.5


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    asked=st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=40),
    changeover_s=st.sampled_from([0.0, 1.0, 3.0, 10.0]),
)
def test_powers_of_both_signs_are_never_neighbours(asked, changeover_s):
    bench = Bench(**BOTH, changeover_s=changeover_s)
    powers = [bench.power(each) for each in asked]
    on = [(number, power) for number, power in enumerate(powers) if power]
    for (first, one), (second, other) in pairwise(on):
        assert (one > 0.0) is (other > 0.0) or second - first > max(1.0, changeover_s)


def test_a_changeover_without_dead_time_still_waits_for_one_interval_of_nothing():
    heated = Changeover().after(0.3, 1.0)
    assert heated.waits(-0.1, 0.0)
    assert not heated.waits(0.1, 100.0)
    assert not heated.after(0.0, 1.0).waits(-0.1, 0.0)
    assert heated.after(0.0, 1.0).waits(-0.1, 2.0)


# -- what is safe ----------------------------------------------------------------------------------


@pytest.mark.parametrize("asked", [1.0, -1.0])
def test_safe_off_and_latched_are_0_whichever_was_on(asked):
    bench = Bench(asked, **BOTH)
    assert bench.power() == asked
    bench.subject.fault("output.refused", 22, "test")
    assert bench.power() == 0.0
    bench = Bench(asked, **BOTH)
    bench.subject.request(Mode.OFF)
    assert bench.power() == 0.0
    for _ in range(2):
        step = bench.see(temperature_c=70.0)
    assert step.state is State.LATCHED
    bench.subject.request(Mode.AUTO)
    assert bench.power() == 0.0


@pytest.mark.parametrize("limits", [BOTH, COOLS], ids=["heat and cool", "cool"])
def test_too_cold_is_believed_at_once_where_something_cools(limits):
    bench = Bench(0.5, **limits)
    bench.power()
    step = bench.see(temperature_c=-10.0)  # no such step could be believed of a heater alone
    assert step.command.power == 0.0
    assert bench.see(temperature_c=-10.0).state is State.LATCHED


def test_where_nothing_heats_too_hot_has_to_be_plausible_first():
    bench = Bench(0.5, **COOLS)
    bench.power()
    assert bench.power(temperature_c=90.0) == 0.5
    for _ in range(4):
        step = bench.see(temperature_c=90.0)
    assert step.state is State.LATCHED


@pytest.mark.parametrize(("holding", "asked", "given_"), [
    (-0.3, -0.9, -0.3), (-0.3, -0.1, -0.1), (-0.3, 0.5, 0.0), (0.3, -0.5, 0.0), (0.3, 0.9, 0.3),
])  # fmt: skip
def test_riding_gives_at_most_the_holding_power_of_its_sign(holding, asked, given_):
    bench = Bench(asked, holding, **BOTH)
    bench.see(0.0)
    for quality in (Quality.GOOD, Quality.GOOD, Quality.MISSING):
        step = bench.see(asked, quality=quality)
    assert step.state is State.RIDE
    assert step.command.power in (given_, 0.0)  # 0 while it changes over
    assert bench.see(quality=Quality.MISSING).command.power == given_


# -- what was taken --------------------------------------------------------------------------------


@pytest.mark.parametrize(("asked", "taken"), [(0.2, 0.9), (-0.2, -0.9), (0.2, -0.3), (-0.2, 0.3)])
def test_more_of_either_than_it_was_told_is_a_fault_in_two_cycles(asked, taken):
    bench = Bench(asked, **BOTH)
    for _ in range(2):
        assert bench.see().state is State.RUN
        bench.subject.applied(taken)
    assert bench.see().state is State.SAFE


@pytest.mark.parametrize(("asked", "taken"), [(0.8, 0.1), (-0.8, -0.1), (-0.8, 0.0)])
def test_less_is_none(asked, taken):
    bench = Bench(asked, **BOTH)
    for _ in range(10):
        bench.see()
        bench.subject.applied(taken)
    assert bench.see().state is State.RUN


# -- what is learnt --------------------------------------------------------------------------------


def test_the_model_beside_a_lone_cooler_learns_that_power_takes_heat_out():
    bench = Bench(1.0, **COOLS)
    gain_k = 0.0449  # that of the model when nothing else is configured
    for second in range(50):
        step = bench.see(temperature_c=55.0 - gain_k * second)
    assert step.beliefs.a == pytest.approx(1.0, abs=1e-5)


# -- by hand ---------------------------------------------------------------------------------------


def test_manual_power_takes_the_range_of_the_loop_and_is_refused_by_name():
    both, heater = Bench(**BOTH).subject, Bench().subject
    both.request(ManualPower(-0.5))
    with pytest.raises(Refused, match="from -1 to 1, got -1"):
        both.request(ManualPower(-1.5))
    with pytest.raises(Refused, match="from 0 to 1, got -0"):
        heater.request(ManualPower(-0.5))


def test_holding_the_last_power_never_gives_more_than_the_operator_wants_now():
    bench = Bench(**BOTH)
    bench.subject.request(Mode.MANUAL)
    for wanted, given_ in ((-0.5, -0.5), (-0.2, -0.2), (-0.9, -0.2), (0.4, 0.0)):
        bench.subject.request(ManualPower(wanted))
        quality = Quality.GOOD if wanted == -0.5 else Quality.MISSING
        assert bench.power(quality=quality) == given_


# -- limits ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("key", "value"), [
    ("power_min", 0.1), ("power_min", -1.1), ("power_min", math.nan), ("changeover_s", -1.0),
    ("changeover_s", math.inf),
])  # fmt: skip
def test_limits_that_make_no_sense_are_refused_by_name(key, value):
    with pytest.raises(ValueError, match=key):
        Limits(60.0, 0.0, 0.0, 60.0, **{key: value})


@pytest.mark.parametrize("power", [math.nan, math.inf, -math.inf, None, "full", True])
def test_what_is_no_power_is_possible_as_0_alone(power):
    assert Limits(60.0, 0.0, 0.0, 60.0, **BOTH).possible(power) == 0.0


def test_a_lone_cooler_has_no_cooler_beside_it():
    with pytest.raises(ValueError, match="power_min must be 0"):
        Limits(60.0, 0.0, 0.0, 60.0, power_cools=True, power_min=-1.0)
