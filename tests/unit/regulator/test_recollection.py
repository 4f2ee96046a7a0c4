"""A start takes up what laws of an earlier run have learnt, and is none the worse for nonsense."""

from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.parts import plan_for
from thermoctl.control.adaptive import Adaptive
from thermoctl.control.pid import Pid
from thermoctl.ports import Remembered
from thermoctl.regulator import Regulator
from thermoctl.signals import Measurement

TABLE = LoopTable(setpoint_c=40.0, trip_above_c=60.0)


@dataclass(frozen=True)
class Learner(Pid):
    """A law whose memory is under control."""

    kept: Any = field(default_factory=lambda: {"x": 1.0})

    def remember(self, belief):
        if isinstance(self.kept, Exception):
            raise self.kept
        return self.kept

    def start_from(self, remembered, age_s):
        if "bad" in remembered:
            raise ValueError("expected nothing bad, got it")
        if "odd" in remembered:
            raise KeyError("odd")
        return replace(self.start())

    def origin(self, belief):
        return "stored"


def regulator(law=None, remembered=None, shadow=None):
    plan = replace(plan_for(TABLE), controller=law or Learner(), shadow=shadow)
    kept = {name: Remembered(model, 60.4) for name, model in (remembered or {}).items()}
    return Regulator(plan, remembered=kept)


def first_step(subject):
    return subject.step(Measurement(0.0, 20.0))


def events(step):
    return [(event.name, dict(event.fields)) for event in step.events]


def test_a_first_start_says_nothing_of_models():
    assert [name for name, _ in events(first_step(regulator()))] == []


def test_a_model_that_is_taken_up_is_told_of_with_its_age():
    step = first_step(regulator(remembered={"pid": {"x": 1.0}}))
    assert events(step) == [("model.recalled", {"controller": "pid", "age_s": 60})]
    assert step.origin == "stored"


@pytest.mark.parametrize("model", [{"bad": 1}, {"odd": 1}], ids=["refused", "it raises"])
def test_a_model_that_is_refused_is_ignored_with_the_reason(model):
    ((name, fields),) = events(first_step(regulator(remembered={"pid": model})))
    assert name == "model.ignored"
    assert fields["controller"] == "pid"
    assert "bad" in fields["why"] or "odd" in fields["why"]


def test_what_was_expected_is_said_once():
    ((_, fields),) = events(first_step(regulator(remembered={"pid": {"bad": 1}})))
    assert fields["why"] == "expected nothing bad, got it"
    ((_, fields),) = events(first_step(regulator(remembered={"pid": {"odd": 1}})))
    assert fields["why"] == "expected a result, got KeyError: 'odd'"


def test_a_model_of_a_law_that_is_not_there_is_left_alone():
    assert events(first_step(regulator(remembered={"adaptive": {"bad": 1}}))) == []


def test_the_law_in_shadow_takes_its_own_up_and_is_asked_for_it():
    subject = regulator(Adaptive(), {"pid": {"x": 1.0}, "adaptive": {}}, shadow=Learner())
    step = first_step(subject)
    assert [(name, fields["controller"]) for name, fields in events(step)] == [
        ("model.ignored", "adaptive"),
        ("model.recalled", "pid"),
    ]
    assert step.remember() == {"pid": {"x": 1.0}}
    assert step.origin == "new"


def test_a_step_tells_what_was_known_then_however_late_it_is_asked():
    subject = regulator()
    step = first_step(subject)
    subject.step(Measurement(1.0, 20.1))
    assert step.remember() == {"pid": {"x": 1.0}}


def test_a_law_that_fails_to_remember_is_left_out():
    step = first_step(regulator(Learner(kept=RuntimeError("no memory"))))
    assert step.remember() == {}


def test_nonsense_costs_no_power_and_gives_none():
    """A model that was refused leaves what a first start would do, to the last bit."""
    first, second = regulator(Adaptive()), regulator(Adaptive(), {"adaptive": {"gain": 1e9}})
    for second_s in range(30):
        measured = Measurement(float(second_s), 20.0 + 0.01 * second_s)
        assert first.step(measured).command == second.step(measured).command


HEATER = {"gain_k_per_s": 0.04, "gain_sd_k_per_s": 0.001, "lag_s": 45.0, "cools_per_s": 0.0}


def test_what_the_heater_check_knows_goes_on_and_is_kept():
    step = first_step(regulator(remembered={"heater-check": HEATER}))
    assert events(step) == []
    assert step.remember()["heater-check"] == HEATER


def test_nonsense_of_the_heater_check_is_ignored_with_the_reason():
    step = first_step(regulator(remembered={"heater-check": HEATER | {"lag_s": -1.0}}))
    ((name, fields),) = events(step)
    assert (name, fields["controller"]) == ("model.ignored", "heater-check")
    assert "lag_s" in fields["why"]
    assert "heater-check" not in step.remember()
