"""An outer loop gives an inner one its set point, and takes its power away."""

import math
from pathlib import Path
from types import SimpleNamespace

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.errors import Refused
from thermoctl.runtime.cascade import Cascade, outer_first
from thermoctl.runtime.lead import Lead
from thermoctl.signals import ManualPower, Measurement, Mode, Quality, SetPoint, State
from thermoctl.testing import ManualClock

CONFIG = Path(__file__).parents[3] / "config"


class Bench:
    """The cascade on its simulated tank; a second is a cycle."""

    def __init__(self, **board):
        document = load(CONFIG / "cascade.toml").model_dump()
        document["boards"]["daq"] |= board
        document["loops"] = dict(reversed(document["loops"].items()))  # the order is no matter
        self.clock, self.cycles = ManualClock(), {"bath": [], "block": []}
        self.loop = loop_for(load(document), self.clock, self._keep, beside=False)
        self.board = None

    def _keep(self, cycle):
        self.cycles[cycle.loop].append(cycle)

    def run(self, seconds):
        for _ in range(seconds):
            self.clock.advance(1.0)
            self.loop.cycle(self.clock.now_s())
        self.board = self.loop.boards[0].board
        return self

    def regulator(self, name):
        return next(each.regulator for each in self.loop.wirings if each.name == name)

    @property
    def bath(self):
        return self.cycles["bath"][-1]

    @property
    def block(self):
        return self.cycles["block"][-1]

    def events(self):
        return [e.name for cycles in self.cycles.values() for c in cycles for e in c.step.events]


def test_power_is_a_place_between_two_set_points_and_back():
    lead = Lead("block", 20.0, 80.0)
    assert [lead.setpoint_c(power) for power in (0.0, 0.5, 1.0)] == [20.0, 50.0, 80.0]
    assert [lead.power_at(c) for c in (10.0, 50.0, 90.0)] == [0.0, 0.5, 1.0]
    assert math.isnan(lead.power_at(math.nan))


@pytest.mark.parametrize(("outer", "inner", "taken"), [
    (Quality.GOOD, Quality.GOOD, 0.5), (Quality.GOOD, Quality.OPEN, 0.25),
    (Quality.GOOD, Quality.STALE, 0.25), (Quality.OPEN, Quality.OPEN, math.nan),
])  # fmt: skip
def test_a_block_that_cannot_be_read_is_as_warm_as_the_bath(outer, inner, taken):
    lead = Lead("block", 20.0, 80.0)
    told = lead.taken(Measurement(0.0, 35.0, outer), Measurement(0.0, 50.0, inner))
    assert told == pytest.approx(taken, nan_ok=True)


def test_every_loop_comes_before_the_one_it_leads_and_others_stay_where_they_are():
    def wiring(name, inner=None):
        return SimpleNamespace(name=name, lead=inner and Lead(inner, 0.0, 1.0))

    listed = [wiring("d"), wiring("c"), wiring("b", "c"), wiring("a", "b"), wiring("e")]
    assert [each.name for each in outer_first(listed)] == ["d", "a", "e", "b", "c"]


def test_the_block_gets_its_new_set_point_in_the_same_cycle():
    bench = Bench().run(30)
    for bath, block in zip(bench.cycles["bath"], bench.cycles["block"], strict=True):
        power = bath.step.command.power
        assert block.step.setpoint_c == pytest.approx(20.0 + 60.0 * power)
    assert bench.block.step.setpoint_c > 70.0
    assert "setpoint.changed" not in bench.events()  # every second would be one


def test_the_bath_is_told_where_the_block_really_is():
    bench = Bench().run(60)
    for bath, block in zip(bench.cycles["bath"], bench.cycles["block"], strict=True):
        shown_c = block.step.measurement.temperature_c
        assert bath.accepted_power == min(max((shown_c - 20.0) / 60.0, 0.0), 1.0)
    assert bench.cycles["bath"][0].step.command.power == 1.0
    assert bench.cycles["bath"][0].accepted_power < 0.2


def test_a_block_hotter_than_it_is_asked_to_be_is_no_fault():
    bench = Bench().run(120)
    bench.loop.ask(SetPoint(25.0), "bath")
    bench.run(10)
    assert bench.bath.step.command.power == 0.0
    assert bench.bath.accepted_power > 0.2
    assert bench.bath.step.state is State.RUN


@pytest.mark.parametrize("request_", [Mode.OFF, "open", "fault"])
def test_a_bath_that_may_give_nothing_has_a_block_without_power_in_the_same_cycle(request_):
    bench = Bench().run(20)
    assert bench.block.accepted_power > 0.1
    if request_ == "open":
        bench.board.disturb("open", 60.0)
    elif request_ == "fault":
        bench.regulator("bath").fault("test.fault", None, "test")
    else:
        bench.loop.ask(request_, "bath")
    bench.run(1)
    assert bench.block.step.command.power == bench.block.accepted_power == 0.0
    assert bench.block.step.command.reason == "master.off"
    assert bench.block.step.setpoint_c == 20.0
    assert bench.block.step.state is State.RUN


def test_a_trip_of_the_bath_takes_the_block_s_power_at_the_first_reading():
    bench = Bench().run(20)
    bench.board.disturb("spike", 40.0)
    bench.run(1)
    assert bench.bath.step.state is not State.LATCHED
    assert bench.block.accepted_power == 0.0
    assert bench.block.step.command.reason == "master.off"


def test_power_by_hand_in_the_block_does_not_outlive_the_bath_either():
    bench = Bench().run(5)
    bench.loop.ask(Mode.MANUAL, "block")
    bench.loop.ask(ManualPower(0.3), "block")
    bench.run(3)
    assert bench.block.accepted_power == pytest.approx(0.3, abs=1e-3)
    bench.loop.ask(Mode.OFF, "bath")
    bench.run(1)
    assert bench.block.accepted_power == 0.0


def test_by_hand_the_bath_s_power_is_still_a_set_point_of_the_block():
    bench = Bench().run(5)
    bench.loop.ask(Mode.MANUAL, "bath")
    bench.loop.ask(ManualPower(0.5), "bath")
    bench.run(120)
    assert bench.block.step.setpoint_c == 50.0
    assert bench.block.step.measurement.temperature_c == pytest.approx(50.0, abs=1.5)
    assert bench.bath.accepted_power == pytest.approx(0.5, abs=0.03)


def test_a_set_point_for_a_loop_that_follows_is_refused():
    bench = Bench().run(1)
    with pytest.raises(Refused, match="for the loop that leads this one, got 30"):
        bench.regulator("block").request(SetPoint(30.0))


def test_a_block_that_fails_leaves_the_bath_running_and_nothing_wound_up():
    bench = Bench().run(120)
    bench.regulator("block").fault("test.fault", None, "test")
    bench.run(10)
    assert bench.block.accepted_power == 0.0
    assert bench.bath.step.state is State.RUN
    assert bench.bath.accepted_power < 0.7  # it is told that the block goes cold


def test_a_loop_that_leads_makes_up_for_nothing_that_the_other_is_behind():
    bench = Bench().run(60)
    assert bench.regulator("bath")._steering.mind.belief.inexact.more == 0.0


def test_the_bath_is_told_for_how_long_the_block_goes_on_before_it_was_ever_told_to_fall():
    bench = Bench(element_lag_s=60.0).run(60)
    learning = bench.regulator("bath")._learning
    assert bench.block.step.setpoint_c == 80.0  # up to now it was asked for all there is
    assert learning.kept_s == pytest.approx(60.0, rel=0.15)
    known_s = learning.kept_s
    bench.regulator("block").fault("test.fault", None, "test")
    bench.run(120)
    assert learning.kept_s == pytest.approx(known_s, rel=0.15)  # it fell, and told the same
    assert bench.regulator("block")._learning.kept_s == 0.0  # nobody follows that one


def follower(**what):
    """Return a loop that follows another one, and how long that was told the heat lasts."""
    limits = SimpleNamespace(power_cools=what.pop("cools", False))
    regulator = SimpleNamespace(plan=SimpleNamespace(limits=limits))
    told = []
    outer = SimpleNamespace(applied=lambda power, kept_s: told.append(kept_s))
    lead = Lead("block", 20.0, 80.0)
    bath = SimpleNamespace(name="bath", regulator=outer, outputs=(), lead=lead)
    outputs = (object(),) * what.pop("outputs", 1)
    block = SimpleNamespace(name="block", regulator=regulator, outputs=outputs, lead=None)
    return Cascade((bath, block)), told


@pytest.mark.parametrize(("what", "known"), [
    ({}, True), ({"outputs": 2}, False), ({"outputs": 0}, False), ({"cools": True}, False),
])  # fmt: skip
def test_a_block_holds_heat_where_nothing_but_a_heater_acts_on_it(what, known):
    cascade, told = follower(**what)
    block_c = 25.0
    for second in range(120):
        cascade.tell({
            "bath": Measurement(float(second), 25.0), "block": Measurement(float(second), block_c),
        })  # fmt: skip
        cascade.gave = {"block": 1.0}
        block_c += (85.0 - block_c) / 60.0
    assert told[0] == 0.0
    assert told[-1] == (pytest.approx(60.0, rel=0.05) if known else 0.0)
