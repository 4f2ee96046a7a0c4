"""A controller watches every sample, whoever steers, and its remarks are told when they change."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import pytest

from thermoctl.app.parts import plan_for
from thermoctl.app.settings import load
from thermoctl.ports import Situation
from thermoctl.regulator import Regulator
from thermoctl.signals import Beliefs, ManualPower, Measurement, Mode, Quality, State


@dataclass(frozen=True)
class Watcher:
    """Remembers every situation it was shown, and remarks on warm water."""

    name: ClassVar[str] = "watcher"

    def start(self) -> tuple[Situation, ...]:
        return ()

    def observe(self, belief, situation):
        return (*belief, situation)

    def decide(self, belief, situation):
        assert belief[-1] is situation  # it was shown what it is asked about
        return belief, 0.001 * len(belief)

    def beliefs(self, belief, situation):
        return Beliefs()

    def ride_s(self, belief):
        return 0.0

    def remarks(self, belief):
        last_c = belief[-1].measured_c
        return {"water.warm": f"expected 38 degC, got {last_c:g}"} if last_c > 38.0 else {}


def watched(mode="auto"):
    table = {"setpoint_c": 37.5, "trip_above_c": 60.0, "mode": mode}
    plan = plan_for(load({"loops": {"tank": table}}).loops["tank"])
    return Regulator(replace(plan, controller=Watcher()))


def see(subject, t_s, temperature_c=37.5, quality=Quality.GOOD):
    return subject.step(Measurement(float(t_s), temperature_c, quality))


@pytest.mark.parametrize("mode", ["off", "manual", "auto"])
def test_every_sample_is_shown_in_every_mode_and_state(mode):
    subject = watched(mode)
    for t in range(5):
        see(subject, t)
    for t in range(5, 15):
        state = see(subject, t, math.nan, Quality.OPEN).state
    assert state is State.SAFE
    for t in range(15, 60):
        see(subject, t)
    subject.request(Mode.AUTO)
    assert see(subject, 60).command.power == pytest.approx(0.061)


@pytest.mark.parametrize("quality", [Quality.MISSING, Quality.SHORT, Quality.STALE])
def test_without_a_reading_it_is_shown_that_there_was_none(quality):
    subject = watched()
    see(subject, 0)
    see(subject, 1, 37.7, quality)
    see(subject, 2, 37.6)
    see(subject, 3, 52.0)  # an outlier is no reading either
    see(subject, 4, 37.8)
    shown = [situation.measured_c for situation in subject._steering.mind.belief]
    assert shown == pytest.approx([37.5, math.nan, 37.6, math.nan, 37.8], nan_ok=True)


def test_it_is_shown_the_power_that_was_applied_whoever_gave_it():
    subject = watched("manual")
    subject.request(ManualPower(0.3))
    see(subject, 0)
    subject.applied(0.28)
    see(subject, 1)
    assert subject._steering.mind.belief[-1].applied == 0.28


def test_a_remark_is_told_when_it_appears_and_when_it_is_gone_and_not_in_between():
    subject = watched("off")
    told = []
    for t, temperature_c in enumerate((37.5, 38.2, 38.3, 38.4, 37.9, 37.8, 38.5)):
        step = see(subject, t, temperature_c)
        told += [(t, dict(e.fields)) for e in step.events if e.name == "water.warm"]
    assert told == [
        (1, {"active": True, "text": "expected 38 degC, got 38.2"}),
        (4, {"active": False}),
        (6, {"active": True, "text": "expected 38 degC, got 38.5"}),
    ]
