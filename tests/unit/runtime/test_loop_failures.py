"""What fails in one place costs that place its heat, and nobody else; and it is said."""

import math

import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.errors import LinkError, TransientError
from thermoctl.model.actuator import Linear
from thermoctl.model.sensor import LM335, Sensor
from thermoctl.runtime.connection import Connection
from thermoctl.runtime.loop import Loop, Wiring
from thermoctl.signals import Mode, Quality, RawSample, State
from thermoctl.testing import ManualClock, ScriptedBoard

TABLE = {"setpoint_c": 37.5, "trip_above_c": 60.0, "mode": "auto", "controller": "on-off"}
COLD = 600.0  # counts of 1024 at 5 V: 19.8 degC
COUNTS_PER_K = 0.010 / 5.0 * 1024.0


class House:
    """Loops `a`, `b`, ... on scripted boards, one wiring each."""

    def __init__(self, clock, *boards, laws=None, shared=False):
        self.clock, self.boards = clock, boards
        self.cycles, self.completed = [], 0
        reports = []
        connections = [
            Connection(
                f"board {n}",
                lambda each=each: each,
                clock,
                lambda *a, **k: reports[0](*a, **k),
                beside=False,
            )
            for n, each in enumerate(boards)
        ]
        names = "ab"
        self.wirings = [
            Wiring(
                name,
                regulator_for(load({"loops": {"tank": TABLE}})),
                connections[0 if shared else n],
                f"input {name}" if shared else "temperature",
                Sensor(LM335, 5.0),
                connections[0 if shared else n],
                f"output {name}" if shared else "heater",
                (laws or [Linear(), Linear()])[n],
            )
            for n, name in enumerate(names)
        ]
        self.connections = connections
        self.loop = Loop(self.wirings, clock, 1.0, self.cycles.append, self._complete)
        reports.append(self.loop.report)

    def _complete(self):
        self.completed += 1

    def run(self, seconds):
        for _ in range(seconds):
            self.loop.cycle(self.clock.now_s())
            self.clock.advance(1.0)

    def last(self, name):
        return [cycle for cycle in self.cycles if cycle.loop == name][-1]

    def events(self):
        return [event for cycle in self.cycles for event in cycle.step.events]


def both(clock, count, **broken):
    """Return samples of inputs a and b, of which `broken` has other counts, or none."""
    return {
        f"input {name}": RawSample(clock.now_s(), broken.get(name, COLD), 1024.0, count)
        for name in "ab"
        if broken.get(name, COLD) is not None
    }


class Shared(ScriptedBoard):
    """A board with two inputs; from the third read on, input a has `broken` counts."""

    broken = None

    def read(self, deadline_s):
        self._read_count += 1
        broken = {"a": self.broken} if self._read_count > 3 else {}
        return both(self._clock, self._read_count, **broken)


@pytest.mark.parametrize(
    ("counts", "quality"), [(None, "missing"), (1024.0, "open"), (0.0, "short")]
)
def test_one_bad_sensor_on_a_shared_board_leaves_the_other_loop_its_heat(counts, quality):
    clock = ManualClock()
    board = Shared(clock)
    board.broken = counts
    house = House(clock, board, shared=True)
    house.run(3)
    assert board.written[-1].outputs == {"output a": 1.0, "output b": 1.0}
    house.run(10)
    assert house.last("a").step.measurement.quality == quality
    assert board.written[-1].outputs == {"output a": 0.0, "output b": 1.0}
    assert house.last("b").step.state is State.RUN


class BrokenLaw(Linear):
    """A law that cannot be asked any more once the power is above 0."""

    def drive_for(self, power):
        raise ArithmeticError("no drive")


def test_a_failing_actuator_law_costs_its_own_loop_the_heat():
    clock = ManualClock()
    board = Shared(clock)
    board.broken = COLD
    house = House(clock, board, shared=True, laws=[BrokenLaw(), Linear()])
    house.run(5)
    assert {write.outputs["output a"] for write in board.written[1:]} == {0.0}
    assert board.written[-1].outputs["output b"] == 1.0
    assert house.last("a").step.state is State.SAFE
    assert house.completed == 0


class Raging(ScriptedBoard):
    """A board whose every call fails in a way no driver may, once it is told to."""

    raging = False

    def read(self, deadline_s):
        if self.raging:
            raise RuntimeError("read")
        return super().read(deadline_s)

    def write(self, outputs, valid_for_s, deadline_s):
        if self.raging:
            raise RuntimeError("write")
        return super().write(outputs, valid_for_s, deadline_s)

    def close(self):
        super().close()
        raise RuntimeError("close")


def test_a_board_that_raises_everywhere_keeps_no_other_board_on():
    clock = ManualClock()
    mad, sane = Raging(clock, [COLD]), ScriptedBoard(clock, [COLD])
    house = House(clock, mad, sane)
    house.run(3)
    assert (mad.power, sane.power) == (1.0, 1.0)
    mad.raging = True
    house.run(3)
    assert house.last("a").step.state is State.SAFE
    assert sane.power == 1.0  # its loop depends on nothing that failed
    assert house.loop.shut_down() is False
    assert sane.power == 0.0
    assert (mad.closed, sane.closed) == (1, 1)


def test_a_cycle_that_failed_feeds_no_watchdog_and_is_published_all_the_same(monkeypatch):
    clock = ManualClock()
    house = House(clock, ScriptedBoard(clock, [COLD]), ScriptedBoard(clock, [COLD]))
    house.run(3)

    def fail():
        raise LookupError("in the middle of the walk")

    monkeypatch.setattr(house.loop._requests, "grant", fail)
    house.run(4)
    assert (house.completed, len(house.cycles)) == (3, 14)
    assert [board.power for board in house.boards] == [0.0, 0.0]
    assert house.last("a").step.state is State.SAFE
    failed = [event for event in house.events() if event.name == "cycle.failed"]
    assert "in the middle of the walk" in str(failed[0].fields)


def test_the_end_is_not_confirmed_by_a_board_that_went_away_while_it_was_heating():
    clock = ManualClock()
    gone = ScriptedBoard(clock, [COLD, COLD, LinkError("gone")])
    house = House(clock, gone, ScriptedBoard(clock, [COLD]))
    house.run(3)
    assert house.connections[0].board is None
    assert house.loop.shut_down() is False


def test_the_end_is_confirmed_where_nothing_was_ever_switched_on():
    clock = ManualClock()
    house = House(clock, ScriptedBoard(clock, [COLD]), ScriptedBoard(clock, [COLD]))
    assert house.loop.shut_down() is True


def test_readers_that_fail_steer_nothing_and_are_told_of_when_somebody_listens_again():
    clock = ManualClock()
    # Water that warms by 20 mK/s: a heater that does nothing for so long would be switched off.
    warming = [COLD + 0.02 * COUNTS_PER_K * second for second in range(101)]
    house = House(clock, ScriptedBoard(clock, warming), ScriptedBoard(clock, warming))

    def fail(*ignored):
        raise OSError("disk full")

    keep = house.loop._publish
    house.loop._publish = house.loop._completed = fail
    house.run(100)
    house.loop._publish = keep
    house.run(1)
    assert "feed.failed" in [event.name for event in house.events()]
    assert house.last("a").step.state is State.RUN
    assert house.boards[0].power == 1.0


class Liar(ScriptedBoard):
    """A simulated board whose truth cannot be had."""

    def truth(self):
        raise RuntimeError("no truth")

    def disturb(self, name, amount=None):
        return ""


def test_a_truth_that_cannot_be_had_costs_no_heat():
    clock = ManualClock()
    house = House(clock, Liar(clock, [COLD]), ScriptedBoard(clock, [COLD]))
    house.run(5)
    assert house.boards[0].power == 1.0
    assert house.completed == 5


def test_what_is_reported_while_nobody_listens_is_bounded():
    clock = ManualClock()
    house = House(clock, ScriptedBoard(clock, [COLD]), ScriptedBoard(clock, [COLD]))
    for n in range(100_000):
        house.loop.report("board.silent", number=n)
    events = house.loop.take_events()
    assert len(events) <= 1000
    assert events[-1].fields["number"] == 99_999


@pytest.mark.parametrize("away_s", [-100.0, -4.0, 1e9, 5.0, math.nan])
def test_a_sample_of_another_time_is_stale_and_heats_nobody(away_s):
    clock = ManualClock()
    board = ScriptedBoard(clock, [COLD])
    house = House(clock, board, ScriptedBoard(clock, [COLD]))
    house.run(3)
    for _ in range(8):
        board._reads = [{"temperature": RawSample(clock.now_s() + away_s, COLD, 1024.0)}]
        house.run(1)
        assert 0.0 <= board.written[-1].valid_for_s <= 2.5
    assert house.last("a").step.measurement.quality is Quality.STALE
    assert (house.last("a").step.state, board.power) == (State.SAFE, 0.0)
    assert house.boards[1].power == 1.0
    assert house.boards[1].written[-1].valid_for_s == 2.5


def test_a_silent_board_is_told_of_once():
    clock = ManualClock()
    silent = ScriptedBoard(clock, [COLD, COLD, *[TransientError("no reply")] * 5, COLD])
    house = House(clock, silent, ScriptedBoard(clock, [COLD]))
    house.run(9)
    told = [event for event in house.cycles and house.events() if event.name == "board.silent"]
    assert len({event.t_s for event in told}) == 1


def test_a_flood_of_requests_does_not_hold_up_a_cycle():
    clock = ManualClock()
    house = House(clock, ScriptedBoard(clock, [COLD]), ScriptedBoard(clock, [COLD]))
    regulator = house.wirings[0].regulator
    asked = []

    def ask_back(request):
        asked.append(request)
        house.loop.ask(Mode.AUTO, "a")

    regulator.request = ask_back
    house.loop.ask(Mode.AUTO, "a")
    house.run(3)
    assert len(asked) == 3
