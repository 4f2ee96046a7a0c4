"""The loop on scripted boards and a manual clock: deadlines, failures, and power 0 at every end."""

import itertools
import math
import threading

import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.errors import FaultError, LinkError, TransientError
from thermoctl.model.actuator import Linear
from thermoctl.model.sensor import LM335, Sensor
from thermoctl.runtime.connection import Connection
from thermoctl.runtime.loop import Loop, Wiring
from thermoctl.signals import Mode, SetPoint, State
from thermoctl.testing import ManualClock, ScriptedBoard

LOOP = {"setpoint_c": 37.5, "trip_above_c": 60.0, "mode": "auto", "controller": "on-off"}
COLD = 600.0  # counts of 1024 at 5 V: 19.8 degC


class Bench:
    """A loop on one scripted board, and what it published."""

    def __init__(self, *boards, beside=False, **keys):
        self.clock = boards[0]._clock if boards else ManualClock()
        self.cycles, self.completed = [], 0
        self.built = 0
        self._boards = boards
        regulator = regulator_for(load({"loops": {"tank": LOOP | keys}}))
        reports = []
        self.connection = Connection(
            "daq", self._build, self.clock, lambda *a, **k: reports[0](*a, **k), beside=beside
        )
        wiring = Wiring(
            "tank",
            regulator,
            self.connection,
            "temperature",
            Sensor(LM335, 5.0),
            self.connection,
            "heater",
            Linear(),
        )
        self.loop = Loop([wiring], self.clock, 1.0, self.cycles.append, self._complete)
        reports.append(self.loop.report)

    def _build(self):
        board = self._boards[min(self.built, len(self._boards) - 1)]
        self.built += 1
        if isinstance(board, Exception):
            raise board
        return board

    def _complete(self):
        self.completed += 1

    def run(self, seconds):
        start_s = self.clock.now_s()
        self.loop.run(until_s=start_s + seconds - 1.0)
        return self.cycles[-1]

    def events(self):
        return [event.name for cycle in self.cycles for event in cycle.step.events]


def scripted(reads=(COLD,), writes=(None,), clock=None, **options):
    return ScriptedBoard(clock or ManualClock(), reads, writes, **options)


def test_a_cold_plant_is_heated_and_what_was_taken_is_published():
    board = scripted(writes=[0.9])
    last = Bench(board).run(3)
    assert last.step.command.power == 1.0
    assert last.accepted_power == 0.9
    assert last.step.measurement.temperature_c == pytest.approx(600 / 1024 * 500 - 273.15)


def test_every_board_is_written_power_0_when_the_loop_ends():
    board = scripted()
    bench = Bench(board)
    bench.run(3)
    assert board.power == 1.0
    assert bench.loop.shut_down() is True
    assert board.power == 0.0
    assert board.closed == 1


def test_a_board_that_does_not_take_the_last_0_is_reported():
    board = scripted(writes=[None, None, FaultError("stuck")])
    bench = Bench(board)
    bench.run(2)
    assert bench.loop.shut_down() is False


def test_commands_expire_soon_after_the_next_sample_is_due():
    board = scripted()
    Bench(board).run(5)
    assert {write.valid_for_s for write in board.written[1:]} == {2.5}


def test_missed_deadlines_are_counted_and_never_caught_up():
    clock = ManualClock()
    board = scripted(clock=clock, takes_s=1.3)
    bench = Bench(board)
    bench.run(30)
    starts = [cycle.step.t_s for cycle in bench.cycles]
    assert all(later - earlier >= 1.0 for earlier, later in itertools.pairwise(starts))
    assert bench.loop.missed > 0
    assert "cycle.missed" in bench.events()
    assert bench.completed == len(bench.cycles)


def test_after_a_suspension_the_first_act_is_power_0():
    board = scripted()
    bench = Bench(board)
    bench.run(3)
    written = len(board.written)
    bench.clock.advance(100.0)
    bench.loop.cycle(deadline_s=bench.clock.now_s() - 99.0)
    assert board.written[written].outputs == {"heater": 0.0}
    assert "cycle.late" in bench.events()


def test_an_exception_from_nowhere_costs_one_cycle_of_power_and_feeds_no_watchdog():
    board = scripted(reads=[COLD, COLD, ZeroDivisionError("bug in a driver"), COLD])
    bench = Bench(board)
    bench.run(2)
    assert board.power == 1.0
    bench.loop.cycle(2.0)
    assert board.power == 0.0
    assert bench.completed == 2
    bench.loop.cycle(3.0)
    assert "cycle.failed" in bench.events()
    assert bench.cycles[-1].step.state is State.SAFE


@pytest.mark.parametrize("error", [TransientError("checksum"), None])
def test_a_silent_board_is_held_for_three_seconds_then_safe(error):
    board = scripted(reads=[COLD, COLD, error])
    bench = Bench(board)
    bench.run(2)
    powers = []
    for t_s in range(2, 8):
        bench.loop.cycle(float(t_s))
        bench.clock.advance(1.0)
        powers.append(board.power)
    print("silent board: power 0 after", powers.index(0.0) + 1, "s")
    assert powers[:1] == [1.0]
    assert powers.index(0.0) <= 3


def test_an_unplugged_board_means_safe_and_is_opened_again_with_growing_patience():
    clock = ManualClock()
    good = scripted(clock=clock, reads=[COLD, COLD, LinkError("gone")])
    back = scripted(clock=clock)
    bench = Bench(good, LinkError("no such port"), LinkError("no such port"), back)
    bench.run(3)
    assert bench.cycles[-1].step.state is State.SAFE
    assert good.closed == 1
    assert math.isnan(bench.cycles[-1].accepted_power)
    bench.run(10)
    assert bench.built == 4
    assert back.written[0].outputs == {"heater": 0.0}
    assert bench.run(40).step.command.power == 1.0
    names = bench.events()
    assert names.count("board.retry") == 2
    assert names.count("board.opened") == 2
    assert "board.lost" in names


def test_a_refused_write_means_safe_in_the_next_cycle():
    board = scripted(writes=[None, None, FaultError("NAK")])
    bench = Bench(board)
    assert bench.run(4).step.state is State.SAFE
    assert [alarm.code for alarm in bench.cycles[-1].step.alarms] == ["output.refused"]


def test_requests_are_read_at_the_top_of_a_cycle_and_a_refusal_is_told():
    bench = Bench(scripted())
    bench.run(1)
    bench.loop.ask(Mode.OFF)
    bench.loop.ask(SetPoint(1000.0))
    last = bench.run(1)
    assert last.step.mode is Mode.OFF
    assert last.step.command.power == 0.0
    assert "request.refused" in bench.events()


def test_a_reader_that_fails_is_told_of_and_steers_nothing():
    bench = Bench(scripted())
    keep = bench.loop._publish

    def fail_once(cycle):
        bench.loop._publish = keep
        raise OSError("disk full")

    bench.loop._publish = fail_once
    last = bench.run(3)
    assert "feed.failed" in bench.events()
    assert last.step.command.power == 1.0
    assert bench.completed == 3


def test_a_reader_that_stops_the_loop_ends_it_within_the_cycle():
    bench = Bench(scripted())
    bench.loop._publish = lambda cycle: bench.loop.stop()
    bench.loop.run()
    assert bench.loop.cycles == 1


class Slow(ScriptedBoard):
    """A board whose opening waits for `go`."""

    def __init__(self, clock, **options):
        super().__init__(clock, [COLD], **options)
        self.go = threading.Event()

    def open(self, deadline_s):
        self.go.wait(10.0)
        return super().open(deadline_s)


def test_nothing_is_told_of_a_loop_before_its_board_has_been_opened_for_the_first_time():
    board = Slow(ManualClock())
    bench = Bench(board, beside=True)
    bench.loop.run(until_s=4.0)
    assert (bench.cycles, bench.completed) == ([], 5)
    board.go.set()
    bench.connection._opening.join()
    assert bench.run(3).step.command.power == 1.0
    assert bench.events() == ["board.opened"]
    assert bench.loop.shut_down() is True


def test_a_board_that_hangs_in_its_first_opening_is_waited_for_ten_seconds():
    board = Slow(ManualClock())
    bench = Bench(board, beside=True)
    bench.loop.run(until_s=9.5)
    assert bench.cycles == []
    last = bench.run(10)
    assert last.step.state is State.SAFE
    assert "sensor.missing" in bench.events()
    board.go.set()
    bench.loop.shut_down()


class Refusing(Slow):
    """A board that cannot be opened, once `go` lets it try."""

    def open(self, deadline_s):
        super().open(deadline_s)
        raise LinkError("no such port")


def test_a_board_that_cannot_be_opened_is_told_by_name_as_soon_as_that_is_known():
    board = Refusing(ManualClock())
    bench = Bench(board, beside=True)
    bench.loop.cycle(0.0)
    board.go.set()
    bench.connection._opening.join()
    bench.loop.cycle(0.0)
    (cycle,) = bench.cycles
    assert cycle.step.state is State.SAFE
    assert {"board.retry", "board.lost"} <= set(bench.events())
    assert [event.fields["board"] for event in cycle.step.events if "board" in event.fields] == [
        "daq"
    ]
    assert cycle.step.alarms[0].text == "board 'daq': no such port"
