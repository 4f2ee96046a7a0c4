"""A request and its answer: settled after the cycle that took it, or withdrawn for good."""

import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.model.actuator import Linear
from thermoctl.model.sensor import LM335, Sensor
from thermoctl.runtime.connection import Connection
from thermoctl.runtime.loop import Loop, Wiring
from thermoctl.signals import Mode, SetPoint
from thermoctl.testing import ManualClock, ScriptedBoard

COLD = 600.0


@pytest.fixture
def bench():
    """Return a loop on a scripted board, and the list of what it published."""
    clock, cycles = ManualClock(), []
    board = ScriptedBoard(clock, (COLD,), (None,))
    table = {"setpoint_c": 37.5, "trip_above_c": 60.0, "mode": "auto", "controller": "on-off"}
    connection = Connection("daq", lambda: board, clock, lambda *a, **k: None, beside=False)
    wiring = Wiring(
        "tank",
        regulator_for(load({"loops": {"tank": table}})),
        connection,
        "temperature",
        Sensor(LM335, 5.0),
        connection,
        "heater",
        Linear(),
    )
    return Loop([wiring], clock, 1.0, cycles.append), cycles


def test_a_granted_request_is_settled_once_the_cycle_that_shows_it_is_published(bench):
    loop, _ = bench
    asked = loop.ask(SetPoint(40.0), "tank")
    seen = []
    loop._publish = lambda cycle: seen.append((asked.settled, cycle.step.setpoint_c))
    loop.cycle(0.0)
    assert seen == [(False, 40.0)]
    assert (asked.settled, asked.refusal) == (True, None)


@pytest.mark.parametrize(
    ("request_", "loop_name", "told"),
    [
        (SetPoint(99.0), "tank", "set point"),
        (Mode.PROGRAM, None, "program"),
        (Mode.OFF, "x", "'x'"),
    ],
)
def test_a_refusal_comes_back_with_its_reason(bench, request_, loop_name, told):
    loop, _ = bench
    asked = loop.ask(request_, loop_name)
    loop.cycle(0.0)
    assert asked.settled
    assert told in asked.refusal


def test_a_withdrawn_request_is_never_granted_and_a_taken_one_cannot_be_withdrawn(bench):
    loop, cycles = bench
    late, taken = loop.ask(Mode.OFF, "tank"), loop.ask(SetPoint(40.0), "tank")
    assert late.withdraw()
    loop.cycle(0.0)
    assert not taken.withdraw()
    assert (late.settled, taken.settled) == (False, True)
    assert (cycles[-1].step.mode, cycles[-1].step.setpoint_c) == (Mode.AUTO, 40.0)


def test_a_request_that_breaks_its_cycle_is_answered_all_the_same(bench, monkeypatch):
    loop, _ = bench
    monkeypatch.setattr(loop.wirings[0].regulator, "request", lambda request: 1 / 0)
    asked = loop.ask(Mode.OFF)
    loop.cycle(0.0)
    assert asked.settled
    assert "failed" in asked.refusal
