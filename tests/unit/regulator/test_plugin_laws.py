"""Laws come from entry points: whatever one returns or raises costs power, never the loop."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.estimation import Identifier
from thermoctl.regulator import Plan, Regulator
from thermoctl.signals import Beliefs, Estimate, ManualPower, Measurement, Mode, Quality, State

HOLDING = Beliefs(holding_power=0.2)
TABLE = {"setpoint_c": 37.5, "trip_above_c": 60.0, "mode": "auto"}


@dataclass(frozen=True)
class Odd:
    """A controller and an estimator in one that answers what it is told to."""

    decides: Any = (None, 0.5)
    believes: Any = HOLDING
    rides: Any = 30.0
    learns: Any = None
    observes: Any = None
    remarked: Any = ()
    name: ClassVar[str] = "odd"

    def start(self):
        return None

    def observe(self, belief, situation):
        return _answer(self.observes, belief, situation)

    def decide(self, belief, situation):
        return self.decides

    def beliefs(self, belief, situation):
        return self.believes

    def ride_s(self, belief):
        return _answer(self.rides, belief)

    def remarks(self, belief):
        return {} if self.remarked == () else _answer(self.remarked, belief)

    def update(self, belief, phi, y):
        return self.learns


def _answer(told, *arguments):
    """Return what was told, or what it makes of the arguments; raise it if it is an error."""
    if isinstance(told, Exception):
        raise told
    return told(*arguments) if callable(told) else told


def plan() -> Plan:
    return plan_for(load({"loops": {"tank": TABLE}}).loops["tank"])


def see(subject, t_s, quality=Quality.GOOD):
    return subject.step(Measurement(float(t_s), 37.4, quality))


@pytest.mark.parametrize(
    "odd",
    [
        Odd(decides=None),
        Odd(decides=0.5),
        Odd(decides=(None, "full")),
        Odd(decides=(None, None)),
        Odd(decides=(None, 1j)),
        Odd(decides=(None, True)),
        Odd(believes=None),
        Odd(believes=0.3),
        Odd(observes=RuntimeError("eyes shut")),
        Odd(remarked=None),
        Odd(remarked=RuntimeError("no words")),
    ],
    ids=repr,
)
def test_an_odd_answer_of_a_controller_is_power_0_or_its_own_power_and_no_exception(odd):
    subject = Regulator(replace(plan(), controller=odd))
    steps = [see(subject, t) for t in range(5)]
    assert {step.command.power for step in steps} == {0.0}
    assert steps[-1].state is State.SAFE


NO_POLE = Estimate(np.array(1.0), np.zeros((1, 1)))


@pytest.mark.parametrize("answer", [None, 3.0, "theta", NO_POLE])
def test_an_odd_answer_of_an_estimator_is_safe_and_no_exception(answer):
    whole = plan()
    identifier = Identifier(whole.identifier.structure, Odd(learns=answer), (1.0,), 1.0)
    subject = Regulator(replace(whole, identifier=identifier))
    step = [see(subject, t) for t in range(3)][-1]
    assert (step.state, step.command.power) == (State.SAFE, 0.0)
    assert step.estimate.theta.item() == 1.0


@pytest.mark.parametrize(
    ("holding", "at_most"), [(float("nan"), 0.5), (7.0, 1.0), (-1.0, 0.0), (0.2, 0.2)]
)
def test_a_ride_stays_within_a_holding_power_that_is_one(holding, at_most):
    subject = Regulator(
        replace(
            plan(), controller=Odd(decides=(None, 0.5), believes=Beliefs(holding_power=holding))
        )
    )
    see(subject, 0)
    powers = [see(subject, t, Quality.MISSING).command.power for t in range(1, 60)]
    assert max(powers) <= at_most
    assert powers[-1] == 0.0


@pytest.mark.parametrize("rides", [float("nan"), 1e9, -1.0, ValueError("none")])
def test_a_ride_ends_within_a_minute_whatever_a_controller_allows_itself(rides):
    subject = Regulator(replace(plan(), controller=Odd(rides=rides)))
    see(subject, 0)
    powers = [see(subject, t, Quality.MISSING).command.power for t in range(1, 70)]
    assert powers[59:] == [0.0] * 10


def test_what_is_no_number_every_other_time_never_gets_past_the_bound():
    subject = Regulator(replace(plan(), controller=Odd(decides=(None, float("inf")))))
    assert see(subject, 0).command.reason == "output.nan"


def test_a_plan_cannot_begin_with_a_program():
    with pytest.raises(ValueError, match="mode"):
        replace(plan(), mode=Mode.PROGRAM)


@pytest.mark.parametrize("quality", [[], {}, object(), 3, "open"])
def test_a_quality_of_any_kind_is_no_exception(quality):
    subject = Regulator(plan())
    see(subject, 0)
    assert 0.0 <= subject.step(Measurement(1.0, 37.4, quality)).command.power <= 1.0


@pytest.mark.parametrize("mode", ["manual", "auto"])
def test_a_controller_that_cannot_even_look_costs_the_power_of_whoever_steers(mode):
    whole = replace(plan(), mode=Mode(mode), controller=Odd(observes=RuntimeError("eyes shut")))
    subject = Regulator(whole)
    subject.request(ManualPower(0.4))
    step = see(subject, 0)
    assert (step.command.power, step.state) == (0.0, State.SAFE)


def test_a_failure_that_lasts_is_told_once_and_not_every_second():
    subject = Regulator(replace(plan(), controller=Odd(observes=RuntimeError("eyes shut"))))
    events = [event for t in range(20) for event in see(subject, t).events]
    failed = [event for event in events if event.name == "controller.failed"]
    assert len(failed) == 1
    assert "eyes shut" in failed[0].fields["text"]
    assert "RuntimeError" in failed[0].fields["trace"]
