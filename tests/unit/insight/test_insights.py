"""A watched loop, from its first sample on: on the simulated rig."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.sim import bench_settings
from thermoctl.insight import Gate, Insights
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import Measurement, Mode, Quality, SetPoint, State

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

AT = 5400


class Rig:
    """The bench's rig with a watch beside it."""

    def __init__(self, seed=1, kind="adaptive"):
        settings = bench_settings(seed=seed)
        (name, table), *_ = settings.loops.items()
        controller = type(table.controller)(kind=kind)
        table = table.model_copy(update={"controller": controller, "shadow": None})
        settings = settings.model_copy(update={"loops": {name: table}})
        self.clock, self.steps, self.told = SimulatedClock(), [], []
        self.watch = Insights(table.period_s, 1500.0)
        self.loop = loop_for(settings, self.clock, self._take, beside=False)

    def _take(self, cycle):
        self.steps.append(cycle.step)
        self.told += self.watch.after(cycle.step, cycle.accepted_power)

    def run(self, until_s):
        self.loop.run(until_s=until_s)

    def disturb(self, name, amount=None):
        self.loop.boards[0].board.disturb(name, amount)

    def row(self, name):
        return {row.name: row for row in self.watch.now.rows}[name]


@pytest.mark.parametrize("bad", [{"period_s": 0.0}, {"heater_w": -1.0}, {"power_max": math.nan}])
def test_a_parameter_that_is_not_positive_is_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        Insights(**bad)


@pytest.mark.parametrize("kind", ["adaptive", "pid"])
def test_whoever_steers_the_plant_is_told_in_words(kind):
    rig = Rig(kind=kind)
    assert rig.watch.now.gate is Gate.UNKNOWN
    rig.run(900.0)
    told = rig.watch.now
    assert rig.row("volume").value == pytest.approx(8.6, rel=0.25)
    assert rig.row("loss_w").value == pytest.approx(290.0, rel=0.3)
    assert told.performance.index is None
    assert json.loads(json.dumps(told.as_json(), allow_nan=False))["verdict"] == told.verdict


def test_a_sample_without_a_reading_leaves_what_was_told():
    rig = Rig()
    rig.run(100.0)
    before, step = rig.watch.now, rig.steps[-1]
    missing = Measurement(101.0, math.nan, Quality.MISSING)
    assert rig.watch.after(replace(step, t_s=101.0, measurement=missing), math.nan) == ()
    assert rig.watch.now is before


@pytest.mark.parametrize(
    ("mode", "state", "words"),
    [
        (Mode.OFF, State.RUN, "not in mode auto"),
        (Mode.AUTO, State.LATCHED, "nothing is judged in state latched"),
    ],
)
def test_why_nothing_is_judged_is_the_mode_or_the_state(mode, state, words):
    rig = Rig()
    rig.run(100.0)
    rig.watch.after(replace(rig.steps[-1], t_s=101.0, mode=mode, state=state), 0.0)
    assert rig.watch.now.performance.verdict == words


def test_a_set_point_that_moves_before_anything_is_known_is_no_trouble():
    rig = Rig()
    rig.run(100.0)
    rig.loop.ask(SetPoint(30.0))
    rig.run(200.0)
    assert rig.watch.now.t_s == rig.steps[-1].t_s
    assert rig.told == []


@pytest.mark.slow
def test_cold_water_is_told_once_with_its_amount_and_its_time():
    rig = Rig(seed=2)
    rig.run(AT)
    assert rig.told == []
    assert rig.row("volume").value == pytest.approx(8.6, rel=0.1)
    assert rig.watch.now.performance.ratio == pytest.approx(1.15, abs=0.25)
    rig.disturb("cold-water", 0.6)
    rig.run(AT + 1200)
    (change,), (event,) = rig.watch.now.changes, rig.told
    assert change.kind == "step.loss"
    assert change.t_s == pytest.approx(AT, abs=30.0)
    assert change.size == pytest.approx(-0.6 / 8.6 * 27.5, rel=0.15)
    assert change.heat_j == pytest.approx(-0.6 * 4181.0 * 27.5, rel=0.2)
    assert event.name == "plant.changed"
    assert event.fields["text"] == change.text


@pytest.mark.slow
def test_half_the_water_gone_is_named_when_the_loop_is_moved_next():
    rig = Rig(seed=3)
    rig.run(AT)
    rig.disturb("half-gone", 0.5)
    rig.loop.ask(SetPoint(40.0))
    rig.run(AT + 1200)
    (drift,) = rig.watch.now.drifts
    assert drift.name == "water.low"
    assert drift.now / drift.before == pytest.approx(2.0, rel=0.15)
    assert rig.watch.now.verdict == drift.text
    assert "plant.drift" in {event.name for event in rig.told}
