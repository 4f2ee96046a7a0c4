"""A board that comes and goes, hangs, or breaks its promises."""

import contextlib
import itertools
import threading

import pytest

from thermoctl.errors import FaultError, LinkError, TransientError, WrongDevice
from thermoctl.runtime.connection import SILENT_S, Connection
from thermoctl.testing import ManualClock, ScriptedBoard


class Reports(list):
    def __call__(self, name, **fields):
        self.append((name, fields))

    def names(self):
        return [name for name, _ in self]


def connected(*built, beside=False):
    """Return a connection whose attempts give `built`, with its clock and its reports."""
    clock, reports = ManualClock(), Reports()
    attempts = iter(built)

    def build():
        each = next(attempts)
        each = each(clock) if callable(each) else each
        if isinstance(each, BaseException):
            raise each
        return each

    return Connection("daq", build, clock, reports, beside=beside), clock, reports


def board(reads=(600.0,), writes=(None,)):
    return lambda clock: ScriptedBoard(clock, reads, writes)


@pytest.mark.parametrize(
    "error", [ValueError("bug"), MemoryError(), OSError(5, "gone"), WrongDevice("other")]
)
def test_whatever_opening_raises_is_a_lost_link_and_tried_again(error):
    connection, clock, reports = connected(error, board())
    with pytest.raises(LinkError):
        connection.read(0.2)
    assert {"board.retry", "board.wrong"} & set(reports.names())
    clock.advance(1.1)
    assert connection.read(0.2)["temperature"].counts == 600.0


def test_an_error_that_no_driver_may_raise_is_told_with_its_trace():
    connection, _, reports = connected(ValueError("bug"), board())
    with pytest.raises(LinkError):
        connection.read(0.2)
    assert "bug" in dict(reports)["board.failed"]["trace"]


def test_pauses_between_attempts_grow_from_1_to_30_s():
    connection, clock, reports = connected(*[LinkError("none")] * 200)
    tries = []
    for _ in range(200):
        clock.advance(1.0)
        count = len(reports)
        with pytest.raises(LinkError):
            connection.read(0.2)
        if len(reports) > count:
            tries.append(clock.now_s())
    pauses = [after - before for before, after in itertools.pairwise(tries)]
    assert pauses[:5] == [1.0, 2.0, 4.0, 8.0, 16.0]
    assert set(pauses[5:]) == {30.0}


def test_a_board_that_is_silent_for_long_is_opened_anew():
    connection, clock, reports = connected(board([600.0, TransientError("no reply")]), board())
    connection.read(0.2)
    began_s = clock.now_s()
    while "board.lost" not in reports.names():
        clock.advance(1.0)
        with pytest.raises((TransientError, LinkError)):
            connection.read(0.2)
    assert clock.now_s() - began_s == pytest.approx(SILENT_S, abs=1.0)
    clock.advance(1.0)
    assert connection.read(0.2)


def test_a_board_that_refuses_is_not_silent():
    connection, clock, reports = connected(board([FaultError("NAK")]))
    for _ in range(60):
        clock.advance(1.0)
        with pytest.raises(FaultError):
            connection.read(0.2)
    assert "board.lost" not in reports.names()


def test_an_output_may_be_on_until_a_0_is_confirmed():
    connection, _, _ = connected(board(writes=[None, 0.3, TransientError("?"), None]))
    assert not connection.driven
    connection.write({"heater": 0.5}, 1.0, 0.2)
    assert connection.driven
    connection.write({"heater": 0.0}, 1.0, 0.2)  # and 0.3 was taken
    assert connection.driven
    with pytest.raises(TransientError):
        connection.write({"heater": 0.0}, 1.0, 0.2)
    assert connection.driven
    connection.write({"heater": 0.0}, 1.0, 0.2)
    assert not connection.driven


class Sticky(ScriptedBoard):
    def close(self):
        super().close()
        raise RuntimeError("cannot close")


def test_a_board_that_cannot_be_closed_is_told_of_and_let_go():
    connection, _, reports = connected(lambda clock: Sticky(clock, [LinkError("gone")]), board())
    with pytest.raises(LinkError, match="gone"):
        connection.read(0.2)
    connection.close()
    assert "cannot close" in dict(reports)["board.failed"]["trace"]


def test_a_closed_connection_opens_nothing_any_more():
    connection, clock, reports = connected(board(), board())
    connection.read(0.2)
    connection.close()
    clock.advance(100.0)
    with pytest.raises(LinkError):
        connection.read(0.2)
    assert reports.names() == ["board.opened"]


class Hanging(ScriptedBoard):
    """A board whose opening waits for `go`."""

    go: threading.Event

    def open(self, deadline_s):
        self.go.wait(10.0)
        return super().open(deadline_s)


def hanging():
    go, made = threading.Event(), []

    def build(clock):
        made.append(Hanging(clock, [600.0]))
        made[-1].go = go
        return made[-1]

    return go, made, build


def test_the_loop_goes_on_while_a_board_hangs_in_opening():
    go, made, build = hanging()
    connection, clock, _ = connected(build, build, beside=True)
    for _ in range(50):
        clock.advance(1.0)
        assert connection.awaited
        with pytest.raises(LinkError, match="not opened yet"):
            connection.read(0.2)
    go.set()
    connection._opening.join()
    assert connection.read(0.2)
    assert len(made) == 1
    connection.close()


def test_a_board_that_opens_after_the_end_is_closed_by_its_own_thread():
    go, made, build = hanging()
    connection, _, _ = connected(build, beside=True)
    with pytest.raises(LinkError):
        connection.read(0.2)
    thread = connection._opening
    connection.close()
    assert made[0].closed == 0
    go.set()
    thread.join()
    assert made[0].closed == 1
    assert connection.board is None


def test_a_thread_that_ends_without_a_result_is_a_failed_attempt(monkeypatch):
    monkeypatch.setattr(threading, "excepthook", lambda args: None)
    connection, clock, reports = connected(SystemExit(3), board(), beside=True)
    until_collected(connection, lambda: "board.retry" in reports.names())
    clock.advance(1.1)
    until_collected(connection, lambda: connection.board is not None)
    assert reports.names() == ["board.retry", "board.opened"]
    assert connection.read(0.2)
    connection.close()


def until_collected(connection, reached):
    """Read until `reached`, waiting for the thread that opens and not for time."""
    for _ in range(5):
        if reached():
            return
        with contextlib.suppress(LinkError):
            connection.read(0.2)
        if connection._opening is not None:
            connection._opening.join()
    assert reached()


def test_a_board_that_was_lost_is_given_a_second_before_it_is_opened_again():
    connection, clock, reports = connected(board([600.0, LinkError("gone")]), board())
    connection.read(0.2)
    for _ in range(3):
        with pytest.raises(LinkError, match="gone"):
            connection.read(0.2)
        clock.advance(0.3)
    clock.advance(0.2)
    assert connection.read(0.2)
    assert reports.names() == ["board.opened", "board.lost", "board.opened"]
