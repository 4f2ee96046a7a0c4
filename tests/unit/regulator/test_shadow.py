"""A controller in shadow is asked and never obeyed, and takes over without a bump."""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.errors import ConfigError, Refused
from thermoctl.ports import Situation
from thermoctl.regulator import Regulator
from thermoctl.regulator.mind import Mind
from thermoctl.signals import (
    Beliefs,
    ChooseController,
    ChooseShadow,
    Estimate,
    ManualPower,
    Measurement,
    Mode,
    State,
)

TABLE = {
    "setpoint_c": 37.5,
    "trip_above_c": 60.0,
    "mode": "auto",
    "heater_check": {"enabled": False},
}
SITUATION = Situation(
    0.0, 1.0, 37.5, 37.5, 0.2, Estimate(np.ones(1), np.eye(1)), np.array([37.5]), np.array([0.2])
)
PAPER = {"kind": "self-tuning-mv", "reference_time_s": 60.0}


@dataclass(frozen=True)
class Rival:
    """Asks for `power`, expects readings `surprise` away, and counts what it was shown."""

    power: Any = 0.5
    surprise: Any = 0.2
    sees: Any = None
    remarked: tuple[str, ...] = ()
    name: ClassVar[str] = "rival"

    def start(self):
        return ()

    def observe(self, belief, situation):
        if isinstance(self.sees, Exception):
            raise self.sees
        return (*belief, situation)

    def decide(self, belief, situation):
        if isinstance(self.power, Exception):
            raise self.power
        return belief, self.power

    def surprise_k(self, belief, situation):
        if isinstance(self.surprise, Exception):
            raise self.surprise
        return self.surprise

    def beliefs(self, belief, situation):
        return Beliefs()

    def ride_s(self, belief):
        return 0.0

    def remarks(self, belief):
        return dict.fromkeys(self.remarked, "seen")


class Charge(Rival):
    name: ClassVar[str] = "charge"


def duel(charge=None, rival=None, **keys):
    """Return a regulator with one controller in charge and one in its shadow."""
    plan = plan_for(load({"loops": {"tank": TABLE | keys}}).loops["tank"])
    return Regulator(replace(plan, controller=charge or Charge(power=0.3), shadow=rival or Rival()))


def see(subject, t_s, temperature_c=37.4):
    return subject.step(Measurement(float(t_s), temperature_c))


def beliefs_of(subject):
    """Return what both controllers were shown."""
    return subject._steering.mind.belief, subject._shadow.mind.belief


def test_the_shadow_is_asked_at_every_sample_and_never_obeyed():
    subject = duel()
    steps = [see(subject, t) for t in range(5)]
    assert {(step.controller, step.command.power) for step in steps} == {("charge", 0.3)}
    assert {(step.shadow, step.shadow_power) for step in steps} == {("rival", 0.5)}


@pytest.mark.parametrize("mode", ["off", "manual", "auto"])
def test_both_see_the_same_situations_with_the_power_that_was_applied(mode):
    subject = duel(mode=mode)
    for t in range(5):
        see(subject, t)
        subject.applied(0.25)
    charge, rival = beliefs_of(subject)
    assert len(rival) == 5
    assert all(one is other for one, other in zip(charge, rival, strict=True))
    assert [situation.applied for situation in rival] == [0.0, 0.25, 0.25, 0.25, 0.25]


def test_a_loop_without_a_shadow_tells_of_none():
    plan = plan_for(
        load({"loops": {"tank": {"setpoint_c": 37.5, "trip_above_c": 60.0}}}).loops["tank"]
    )
    step = see(Regulator(plan), 0)
    assert (step.shadow, step.shadow_power, step.shadow_score) == (None, None, None)


def test_what_the_shadow_would_give_stays_within_the_limit_of_power():
    subject = duel(rival=Rival(power=7.0), power_max=0.8)
    assert see(subject, 0).shadow_power == 0.8


@pytest.mark.parametrize("nonsense", [math.nan, math.inf, None, "full", True, 1j])
def test_an_answer_that_is_no_power_is_none(nonsense):
    subject = duel(rival=Rival(power=nonsense))
    step = [see(subject, t) for t in range(5)][-1]
    assert (step.shadow, step.shadow_power) == ("rival", None)
    assert (step.state, step.command.power) == (State.RUN, 0.3)


@pytest.mark.parametrize("how", ["power", "sees", "surprise"])
def test_a_shadow_that_fails_is_dropped_with_an_event_and_costs_no_power(how):
    subject = duel(rival=Rival(**{how: RuntimeError("out of ideas")}))
    steps = [see(subject, t) for t in range(5)]
    assert {(step.state, step.command.power, step.alarms) for step in steps} == {
        (State.RUN, 0.3, ())
    }
    assert {step.shadow for step in steps} == {None}
    failed = [event for step in steps for event in step.events]
    assert [event.name for event in failed] == ["shadow.failed"]
    assert failed[0].fields["controller"] == "rival"
    assert "out of ideas" in failed[0].fields["text"]
    with pytest.raises(Refused, match="expected 'charge', for none is in its shadow"):
        subject.request(ChooseController("rival"))


def test_that_nobody_can_score_the_one_in_charge_costs_no_power():
    subject = duel(charge=Charge(power=0.3, surprise=RuntimeError("no idea")))
    steps = [see(subject, t) for t in range(90)]
    assert {(step.state, step.command.power) for step in steps} == {(State.RUN, 0.3)}
    assert steps[-1].shadow_score.surprise_k is None
    assert steps[-1].shadow_score.shadow_surprise_k == pytest.approx(0.2)


def test_a_law_that_did_not_see_a_sample_is_not_asked_how_it_was_surprised():
    mind = Mind(Rival(surprise=0.4))
    mind.observe(SITUATION)
    assert mind.surprise_k(SITUATION) == 0.4
    assert math.isnan(mind.surprise_k(replace(SITUATION, t_s=1.0)))


def test_the_two_change_places_on_request_and_back():
    subject = duel()
    see(subject, 0)
    subject.request(ChooseController("rival"))
    step = see(subject, 1)
    assert (step.controller, step.command.power) == ("rival", 0.5)
    assert (step.shadow, step.shadow_power) == ("charge", 0.3)
    [event] = step.events
    assert (event.name, dict(event.fields)) == (
        "controller.changed",
        {"before": "charge", "after": "rival"},
    )
    subject.request(ChooseController("charge"))
    assert see(subject, 2).controller == "charge"
    assert [len(belief) for belief in beliefs_of(subject)] == [3, 3]


def test_choosing_the_one_in_charge_changes_nothing():
    subject = duel()
    subject.request(ChooseController("charge"))
    assert see(subject, 0).events == ()


@pytest.mark.parametrize("name", ["pid", "", None, 3, math.nan, ["rival"]])
def test_a_controller_that_is_not_there_is_refused_naming_those_that_are(name):
    subject = duel()
    with pytest.raises(Refused, match="expected 'charge' or, in its shadow, 'rival', got"):
        subject.request(ChooseController(name))
    assert see(subject, 0).controller == "charge"


def test_a_controller_that_fails_may_be_sent_into_the_shadow_where_it_is_dropped():
    subject = duel(charge=Charge(power=RuntimeError("stuck")))
    for t in range(3):
        step = see(subject, t)
    assert step.state is State.SAFE
    subject.request(ChooseController("rival"))
    steps = [see(subject, t) for t in range(3, 60)]
    assert [step.shadow for step in steps[:2]] == [None, None]
    assert (steps[-1].state, steps[-1].command.power) == (State.RUN, 0.5)


def test_only_the_one_in_charge_remarks():
    subject = duel(charge=Charge(remarked=("one",)), rival=Rival(remarked=("other",)))
    assert [event.name for event in see(subject, 0).events] == ["one"]
    subject.request(ChooseController("rival"))
    told = [(event.name, event.fields.get("active")) for event in see(subject, 1).events]
    assert told == [("controller.changed", None), ("one", False), ("other", True)]


# -- the score -----------------------------------------------------------------------------------


def test_the_score_is_what_the_definition_says_over_whole_minutes():
    subject = duel(charge=Charge(power=0.3, surprise=-0.1), rival=Rival(power=0.5, surprise=0.4))
    scores = [see(subject, t).shadow_score for t in range(150)]
    assert scores[58] is None
    score = scores[-1]
    assert score.span_s == 120.0
    assert score.apart == pytest.approx(0.2)
    assert (score.travel_per_min, score.shadow_travel_per_min) == (0.0, 0.0)
    assert (score.surprise_k, score.shadow_surprise_k) == pytest.approx((0.1, 0.4))


def test_travel_is_what_each_moved_in_full_ranges_a_minute():
    class Restless(Rival):
        def decide(self, belief, situation):
            return belief, float(len(belief) % 2)

    subject = duel(rival=Restless())
    score = [see(subject, t).shadow_score for t in range(61)][-1]
    assert score.shadow_travel_per_min == pytest.approx(59.0)
    assert score.travel_per_min == 0.0


def test_the_score_forgets_what_is_longer_ago_than_ten_minutes():
    @dataclass(frozen=True)
    class Late(Rival):
        def decide(self, belief, situation):
            return belief, 0.9 if situation.t_s < 300.0 else 0.3

    subject = duel(rival=Late())
    scores = [see(subject, t).shadow_score for t in range(1000)]
    assert scores[299].apart == pytest.approx(0.6)
    assert scores[-1].span_s == 600.0
    assert scores[-1].apart == 0.0


def test_what_a_power_moved_in_a_break_is_no_travel():
    @dataclass(frozen=True)
    class Late(Rival):
        def decide(self, belief, situation):
            return belief, 0.9 if situation.t_s < 100.0 else 0.3

    subject, scores = duel(rival=Late()), []
    for t in range(240):
        if t in (90, 110):
            subject.request(Mode.MANUAL if t == 90 else Mode.AUTO)
        scores.append(see(subject, t).shadow_score)
    assert scores[-1].span_s == 180.0
    assert scores[-1].shadow_travel_per_min == 0.0


def test_what_the_one_in_charge_did_not_decide_does_not_count():
    subject = duel(mode="manual")
    subject.request(ManualPower(0.9))
    scores = [see(subject, t).shadow_score for t in range(90)]
    assert set(scores) == {None}
    subject.request(Mode.AUTO)
    score = [see(subject, t).shadow_score for t in range(90, 150)][-1]
    assert score.apart == pytest.approx(0.2)
    assert score.travel_per_min == 0.0  # the step from manual to auto was the operator's


def test_a_change_of_places_begins_the_score_anew():
    subject = duel()
    for t in range(70):
        see(subject, t)
    subject.request(ChooseController("rival"))
    assert see(subject, 70).shadow_score is None


# -- the two that ship ---------------------------------------------------------------------------


def test_the_paper_s_law_and_the_default_take_over_from_each_other_without_a_bump(drive_with):
    drive = drive_with(water_c=30.0, controller="adaptive", shadow=PAPER)
    drive.run(900)
    score = drive.steps[-1].shadow_score
    assert score.surprise_k < 0.01
    assert score.shadow_surprise_k < 0.05
    for name in ("self-tuning-mv", "adaptive") * 2:
        drive.regulator.request(ChooseController(name))
        first = drive.step()
        assert first.controller == name
        assert abs(first.command.power - first.shadow_power) < 0.05
        drive.run(400)
        assert max(abs(step.measurement.temperature_c - 37.5) for step in drive.steps[-400:]) < 0.05


@pytest.mark.slow
def test_after_an_hour_of_full_power_by_hand_neither_has_wound_up(drive_with):
    drive = drive_with(water_c=20.0, mode="manual", controller=PAPER, shadow="adaptive")
    drive.regulator.request(ManualPower(1.0))
    while drive.water_c < 37.0:
        drive.step()
    drive.regulator.request(Mode.AUTO)
    drive.regulator.request(ChooseController("adaptive"))
    start = len(drive.steps)
    drive.run(600)
    assert drive.steps[start].command.power < 0.5
    assert max(step.measurement.temperature_c for step in drive.steps[start:]) < 38.3
    assert drive.steps[-1].measurement.temperature_c == pytest.approx(37.5, abs=0.05)


def test_the_pole_of_the_simple_model_is_told_beside_every_controller(drive_with):
    for controller in ("adaptive", "on-off", PAPER):
        drive = drive_with(controller=controller)
        told = drive.run(60).beliefs
        assert told.a == pytest.approx(1.0, abs=0.01)
        assert 0.0 < told.a_sd < 0.01


@pytest.mark.parametrize(
    ("interval_s", "told"), [(1.0, True), (1.4, True), (0.4, False), (3.0, False)]
)
def test_the_default_foretells_one_period_and_no_other_time(drive_with, interval_s, told):
    drive = drive_with(controller="adaptive")
    drive.run(120)
    law, belief = drive.regulator._steering.mind.controller, drive.regulator._steering.mind.belief
    situation = replace(SITUATION, interval_s=interval_s, measured_c=drive.water_c)
    assert math.isfinite(law.surprise_k(law.observe(belief, situation), situation)) is told


def test_the_model_of_a_sample_that_was_not_used_foretells_nothing():
    law = plan_for(
        load({"loops": {"tank": TABLE | {"controller": PAPER}}}).loops["tank"]
    ).controller
    belief = Estimate(np.ones(1), np.eye(1), innovation=0.3)
    used = replace(SITUATION, estimate=belief)
    assert law.surprise_k(law.start(), used) == 0.3
    unused = replace(SITUATION, estimate=replace(belief, rejected=True))
    assert math.isnan(law.surprise_k(law.start(), unused))


def test_the_model_beside_the_default_is_as_patient_as_the_law_that_may_take_over():
    plans = [
        plan_for(load({"loops": {"tank": TABLE | keys}}).loops["tank"])
        for keys in ({"controller": PAPER}, {"controller": "adaptive", "shadow": PAPER})
    ]
    first, second = (plan.identifier.law.covariance_max for plan in plans)
    assert first == second


def test_gain_and_holding_power_are_those_of_the_one_in_charge(drive_with):
    drive = drive_with(water_c=30.0, controller="adaptive", shadow=PAPER)
    told = drive.run(900).beliefs
    assert told.gain == pytest.approx(0.0449, rel=0.15)
    assert told.gain_sd > 0.0
    drive.regulator.request(ChooseController("self-tuning-mv"))
    told = drive.step().beliefs
    assert (told.gain, told.gain_sd) == (0.0449, None)


@pytest.mark.parametrize("shadow", ["adaptive", {"kind": "adaptive", "calmness": 1.2}])
def test_a_shadow_of_the_same_kind_is_refused_for_nobody_could_choose(shadow):
    table = {"setpoint_c": 37.5, "trip_above_c": 60.0, "controller": "adaptive", "shadow": shadow}
    with pytest.raises(ConfigError, match=r"loops\.tank\.shadow: expected another kind"):
        load({"loops": {"tank": table}})


@pytest.mark.parametrize(
    ("shadow", "key"),
    [
        ("no-such", r"shadow\.kind: no controller is called 'no-such'"),
        ({"kind": "on-off", "width_k": 1.0}, r"shadow\.width_k: unknown key"),
        ({"kind": "on-off", "hysteresis_k": -1.0}, r"shadow\.hysteresis_k: expected at least 0"),
        (3, "shadow"),
    ],
)
def test_a_bad_shadow_is_refused_by_the_name_of_its_key(shadow, key):
    table = {
        "setpoint_c": 37.5, "trip_above_c": 60.0, "controller": "adaptive", "shadow": shadow,
    }  # fmt: skip
    with pytest.raises(ConfigError, match=key):
        load({"loops": {"tank": table}})


def test_any_law_can_be_put_in_the_shadow_learns_there_and_takes_over():
    regulator = Regulator(plan_for(load({"loops": {"tank": TABLE}}).loops["tank"]))
    law = Rival(power=0.3)
    regulator.request(ChooseShadow(law))
    steps = [regulator.step(Measurement(float(t), 37.0)) for t in range(3)]
    assert [(step.shadow, step.shadow_power) for step in steps] == [("rival", 0.3)] * 3
    assert [event.name for event in steps[0].events] == ["shadow.changed"]
    regulator.request(ChooseController("rival"))
    assert regulator.step(Measurement(3.0, 37.0)).command.power == 0.3
    regulator.request(ChooseShadow(None))
    assert regulator.step(Measurement(4.0, 37.0)).shadow is None
    with pytest.raises(Refused, match="none is in its shadow"):
        regulator.request(ChooseController("adaptive"))


def test_a_shadow_that_is_no_law_or_is_in_charge_already_is_refused():
    regulator = Regulator(plan_for(load({"loops": {"tank": TABLE}}).loops["tank"]))
    with pytest.raises(Refused, match="expected a controller for the shadow, got 'pid'"):
        regulator.request(ChooseShadow("pid"))
    with pytest.raises(Refused, match="expected another kind than 'adaptive'"):
        regulator.request(ChooseShadow(regulator.plan.controller))
    assert regulator.step(Measurement(0.0, 37.0)).events == ()
