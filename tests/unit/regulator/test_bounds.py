"""Limits hold in one place, after every controller; what is no number becomes power 0."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.estimation import Identifier
from thermoctl.regulator import Regulator
from thermoctl.signals import Beliefs, Estimate, Measurement, Quality, State


@dataclass(frozen=True)
class Always:
    """A controller that always asks for the same, or fails."""

    power: float | Exception
    name: ClassVar[str] = "always"

    def start(self):
        return None

    def observe(self, belief, situation):
        return belief

    def ride_s(self, belief):
        return 0.0

    def remarks(self, belief):
        return {}

    def decide(self, belief, situation):
        if isinstance(self.power, Exception):
            raise self.power
        return belief, self.power

    def beliefs(self, belief, situation):
        return Beliefs()


def regulator(controller=None, law=None, **keys):
    """Return a regulator in auto with another controller or law of estimation."""
    table = load(
        {"loops": {"tank": {"setpoint_c": 37.5, "trip_above_c": 60.0, "mode": "auto"} | keys}}
    ).loops["tank"]
    plan = plan_for(table)
    if controller is not None:
        plan = replace(plan, controller=controller)
    if law is not None:
        plan = replace(plan, identifier=Identifier(plan.identifier.structure, law, (1.0,), 1.0))
    return Regulator(plan)


def see(subject, t_s, temperature_c=30.0):
    return subject.step(Measurement(float(t_s), temperature_c, Quality.GOOD))


@pytest.mark.parametrize("asked", [math.nan, math.inf, -math.inf])
def test_a_power_that_is_no_number_becomes_0_in_the_same_cycle(asked):
    step = see(regulator(Always(asked)), 0)
    assert step.command.power == 0.0
    assert step.command.reason == "output.nan"
    assert "output.nan" in [event.name for event in step.events]


def test_three_of_them_in_a_row_are_a_fault():
    subject = regulator(Always(math.nan))
    assert [see(subject, t).state for t in range(4)][-1] is State.SAFE


@pytest.mark.parametrize(("asked", "given_"), [(7.0, 1.0), (-3.0, 0.0), (0.25, 0.25)])
def test_power_is_clipped_to_what_there_is(asked, given_):
    assert see(regulator(Always(asked)), 0).command.power == given_


def test_the_power_cap_holds():
    assert see(regulator(Always(1.0), power_max=0.4), 0).command.power == 0.4


def test_power_rises_no_faster_than_allowed_and_falls_at_once():
    subject = regulator(Always(1.0), rise_per_s=0.1)
    rises = [see(subject, t).command.power for t in range(4)]
    assert rises == pytest.approx([0.1, 0.2, 0.3, 0.4])
    subject.fault("output.refused", 22, "test")
    assert see(subject, 4).command.power == 0.0


def test_an_exception_in_a_controller_costs_the_power_of_the_same_cycle_and_is_told():
    subject = regulator(Always(RuntimeError("broken plug-in")))
    step = see(subject, 0)
    assert step.command.power == 0.0
    assert step.state is State.SAFE
    event = next(event for event in step.events if event.name == "controller.failed")
    assert "broken plug-in" in event.fields["trace"]


@dataclass(frozen=True)
class Poisoned:
    """A law of estimation that returns NaN, or raises, from its `after`-th update on."""

    after: int
    raises: bool = False

    def update(self, belief, phi, y):
        count = int(belief.P[0, 0])
        if count < self.after:
            return Estimate(belief.theta, belief.P + 1.0, 0.0, 1.0)
        if self.raises:
            raise ZeroDivisionError("diverged")
        return Estimate(belief.theta * math.nan, belief.P)


@pytest.mark.parametrize("raises", [False, True])
def test_an_estimator_that_diverges_costs_the_power_and_not_the_belief(raises):
    subject = regulator(law=Poisoned(5, raises))
    steps = [see(subject, t) for t in range(10)]
    assert steps[0].command.power > 0.0
    broken = next(step for step in steps if step.state is State.SAFE)
    assert broken.command.power == 0.0
    assert math.isfinite(steps[-1].estimate.theta[0])


def test_every_command_expires():
    subject = regulator(Always(0.5))
    for t in range(5):
        command = see(subject, t).command
        assert t < command.valid_until_s <= t + 3.0


def test_an_output_that_takes_more_than_it_was_told_is_a_fault_in_two_cycles():
    subject = regulator(Always(0.2))
    for t in range(3):
        step = see(subject, t)
        subject.applied(0.9)
    assert step.command.power == 0.0
    assert step.state is State.SAFE


def test_an_output_that_takes_less_is_believed_and_no_fault():
    subject = regulator(Always(0.8))
    for t in range(50):
        step = see(subject, t)
        subject.applied(0.5)
    assert step.state is State.RUN


@given(
    st.lists(
        st.tuples(
            st.floats() | st.none() | st.text(max_size=3) | st.integers(),
            st.floats() | st.none(),
            st.sampled_from(list(Quality)) | st.none() | st.text(max_size=3),
            st.floats() | st.none() | st.text(max_size=3),
        ),
        max_size=40,
    )
)
@settings(max_examples=200, deadline=None, derandomize=True)
def test_step_never_raises_and_never_leaves_0_to_1(samples):
    subject = regulator()
    for temperature_c, t_s, quality, applied in samples:
        step = subject.step(Measurement(t_s, temperature_c, quality))
        assert 0.0 <= step.command.power <= 1.0
        subject.applied(applied)


def test_a_fault_from_outside_is_over_after_half_a_minute_of_good_readings():
    subject = regulator(Always(0.5))
    see(subject, 0)
    subject.fault("output.refused", 22, "expected 0.5, got NAK")
    steps = [see(subject, t) for t in range(1, 40)]
    on = [step.command.power > 0.0 for step in steps].index(True)
    assert on == 29  # at t = 30
    assert [alarm.active for alarm in steps[on - 1].alarms] == [True]
    assert [alarm.active for alarm in steps[on].alarms] == [False]


def test_an_output_that_takes_too_much_only_once_is_no_fault():
    subject = regulator(Always(0.2))
    for t in range(20):
        step = see(subject, t)
        subject.applied(0.9 if t % 2 else 0.2)
    assert step.state is State.RUN


def test_what_the_output_took_is_what_the_model_learns_from():
    told, untold = regulator(Always(0.8)), regulator(Always(0.8))
    for t in range(30):
        steps = see(told, t, 30.0 + 0.01 * t), see(untold, t, 30.0 + 0.01 * t)
        told.applied(0.1)
    assert steps[0].estimate.theta.item() > steps[1].estimate.theta.item()
