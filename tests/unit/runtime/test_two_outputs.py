"""One signed power on two outputs, of one board or of two."""

import math

import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.errors import FaultError, LinkError
from thermoctl.model.actuator import Linear, SquareLaw
from thermoctl.model.sensor import LM335, Sensor
from thermoctl.runtime.connection import Connection
from thermoctl.runtime.loop import Loop
from thermoctl.runtime.wiring import Output, Wiring, signed
from thermoctl.signals import ManualPower, State
from thermoctl.testing import ManualClock, ScriptedBoard

COLD = 600.0  # counts of 1024 at 5 V: 19.8 degC
CONFIG = {
    "boards": {"daq": {"kind": "simulated"}},
    "loops": {
        "tank": {
            "setpoint_c": 20.0,
            "trip_above_c": 60.0,
            "mode": "manual",
            "cooler": {"board": "daq"},
            "controller": {"kind": "adaptive", "action": "heat-cool"},
        }
    },
}


class Bench:
    """A loop in manual, its heater on the first of `boards` and its cooler on the last."""

    def __init__(self, *boards):
        self.boards, self.clock, self.cycles = boards, boards[0]._clock, []
        reports = []
        connections = [self._connection(board, reports) for board in boards]
        wiring = Wiring(
            "tank",
            regulator_for(load(CONFIG)),
            *(connections[0], "temperature", Sensor(LM335, 5.0)),
            *(connections[0], "heater", SquareLaw()),
            Output(connections[-1], "cooler", Linear()),
        )
        self.loop = Loop([wiring], self.clock, 1.0, self.cycles.append)
        reports.append(self.loop.report)

    def _connection(self, board, reports):
        def report(*args, **fields):
            reports[0](*args, **fields)

        return Connection("daq", lambda: board, self.clock, report, beside=False)

    def give(self, *powers):
        """Walk a cycle for each of these powers by hand; return the last one."""
        for power in powers:
            self.loop.ask(ManualPower(power))
            self.clock.advance(1.0)
            self.loop.cycle(self.clock.now_s())
        return self.cycles[-1]

    def outputs(self):
        """Return what was written, both outputs joined, in the order of writing."""
        writes = [
            (each.t_s, number, each.outputs)
            for number, board in enumerate(self.boards)
            for each in board.written[1:]
        ]
        state = {"heater": 0.0, "cooler": 0.0}
        history = []
        for _, _, outputs in sorted(writes, key=lambda each: each[:2]):
            state |= outputs
            history.append(dict(state))
        return history


def board(clock, **options):
    return ScriptedBoard(clock, [COLD], **options)


def test_each_output_gets_the_share_of_its_sign_by_its_own_law_in_one_exchange():
    clock = ManualClock()
    bench = Bench(board(clock))
    bench.give(0.25, 0.0, -0.25)
    assert [each.outputs for each in bench.boards[0].written[1:]] == [
        {"heater": 0.5, "cooler": 0.0},
        {"heater": 0.0, "cooler": 0.0},
        {"heater": 0.0, "cooler": 0.25},
    ]


def test_what_both_took_is_told_as_one_signed_power():
    bench = Bench(board(ManualClock()))
    assert bench.give(0.25).accepted_power == pytest.approx(0.25)
    assert bench.give(0.0, -0.75).accepted_power == -0.75
    assert bench.cycles[-1].step.command.power == -0.75


@pytest.mark.parametrize("boards", [1, 2])
def test_never_are_both_on_not_even_between_two_writes(boards):
    clock = ManualClock()
    bench = Bench(*(board(clock) for _ in range(boards)))
    bench.give(0.5, -0.5, -0.5, 0.7, 0.7, -1.0, 1.0, 1.0)
    history = bench.outputs()
    assert any(each["heater"] for each in history)
    assert any(each["cooler"] for each in history)
    assert not any(each["heater"] and each["cooler"] for each in history)


def test_a_heater_that_will_not_be_switched_off_keeps_the_cooler_off():
    clock = ManualClock()
    stuck = board(clock, writes=[None, FaultError("stuck")])
    bench = Bench(stuck, board(clock))
    last = bench.give(0.5, -0.5, -0.5, -0.5, -0.5)
    assert last.step.state is State.SAFE
    assert math.isnan(last.accepted_power)
    assert not any(each.outputs["cooler"] for each in bench.boards[1].written[1:])


def test_a_cooler_s_board_that_is_lost_costs_the_heat_too():
    clock = ManualClock()
    bench = Bench(board(clock), board(clock, writes=[None, None, LinkError("gone")]))
    bench.give(0.5, 0.5, 0.5, 0.5)
    assert bench.cycles[-1].step.state is State.SAFE
    assert bench.boards[0].written[-1].outputs == {"heater": 0.0}


def test_both_reported_on_is_no_small_power_but_a_fault_in_two_cycles():
    bench = Bench(board(ManualClock(), writes=[0.5]))  # whatever is asked, both report .5
    assert math.isnan(bench.give(0.25).accepted_power)
    assert bench.cycles[-1].step.state is State.RUN
    bench.give(0.25, 0.25)
    assert bench.cycles[-1].step.state is State.SAFE
    assert "output.readback" in [e.name for c in bench.cycles for e in c.step.events]


def test_the_end_of_the_loop_writes_0_to_both():
    clock = ManualClock()
    bench = Bench(board(clock), board(clock))
    bench.give(0.0, -0.5)
    assert bench.loop.shut_down() is True
    assert bench.outputs()[-1] == {"heater": 0.0, "cooler": 0.0}


def test_an_exception_from_nowhere_writes_0_to_both():
    clock = ManualClock()
    reads = [COLD, COLD, ZeroDivisionError("bug in a driver")]
    bench = Bench(ScriptedBoard(clock, reads))
    bench.give(-0.5, -0.5, -0.5)
    assert bench.outputs()[-1] == {"heater": 0.0, "cooler": 0.0}


@pytest.mark.parametrize(("shares", "power"), [
    ([0.3], 0.3), ([0.3, 0.0], 0.3), ([0.0, 0.4], -0.4), ([0.0, 0.0], 0.0),
])  # fmt: skip
def test_shares_make_a_power(shares, power):
    assert signed(shares) == power


@pytest.mark.parametrize("shares", [[math.nan], [0.3, 0.1], [math.nan, 0.0], [0.0, math.nan]])
def test_shares_that_make_none_are_nan(shares):
    assert math.isnan(signed(shares))
