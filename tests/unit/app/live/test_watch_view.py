"""The live view of a daemon: what comes from it, what keys ask of it, what is not worth asking."""

from datetime import UTC, datetime

import pytest

from thermoctl.app.live import Action, LiveModel, Look, render
from thermoctl.app.live.daemon_line import Denied, Gone, Heard, Met, call_for, most_urgent
from thermoctl.app.live.watch_view import WatchView, facts_of
from thermoctl.app.sim import bench_settings, simulate
from thermoctl.errors import Refused
from thermoctl.services.control_protocol import asking, parse
from thermoctl.signals import Acknowledge, ChooseController, ManualPower, Mode, SetPoint

MET = Met("tank", 1.0, 4.0, ahead_s=-1000.0)
NOON = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)


class Line:
    """A line to a daemon, written by a test."""

    def __init__(self):
        self.heard, self.asked = [], []

    def take(self):
        heard, self.heard = self.heard, []
        return heard

    def ask(self, request):
        self.asked.append(request)


@pytest.fixture(scope="module")
def cycle():
    """What is heard of a loop at 37.5 degC in auto, with a shadow."""
    return Heard(list(simulate(bench_settings(seed=1), 5.0))[-1], None)


@pytest.fixture
def line():
    return Line()


@pytest.fixture
def view(line):
    return WatchView(LiveModel(facts_of(MET, NOON, 2000.0)), line)


def test_keys_ask_nothing_before_the_first_cycle_is_heard(view, line, cycle):
    assert view.turn([Action.SETPOINT_UP, Action.MODE])
    assert line.asked == []
    line.heard = [cycle]
    assert view.turn([Action.SETPOINT_UP])
    assert line.asked == [SetPoint(37.6)]


def test_nothing_is_asked_of_a_daemon_that_has_gone(view, line, cycle):
    line.heard = [cycle, Gone("it has ended")]
    view.turn([Action.SETPOINT_UP])
    assert view.lost == "it has ended"
    line.heard = [cycle]
    view.turn([])
    assert (view.lost, line.asked) == ("", [])


def test_a_refusal_stands_where_the_keys_do_until_the_next_one(view, line, cycle):
    line.heard = [cycle, Denied("expected less")]
    view.turn([])
    assert view.prompt == "Refused: expected less"
    view.turn([Action.CONTROLLER])
    assert "takes over" in view.prompt


def test_a_simulation_s_keys_do_nothing_to_a_daemon(view, line, cycle):
    line.heard = [cycle]
    assert view.turn([Action.COLD_WATER, Action.ICE, Action.STIRRER, Action.PAUSE])
    assert line.asked == []


def test_quit_ends_it(view):
    assert not view.turn([Action.QUIT])


def test_wall_time_is_counted_from_the_loop_s_own_zero():
    assert facts_of(MET, NOON, 2000.0).zero == datetime(2026, 3, 1, 11, 43, 20, tzinfo=UTC)


@pytest.mark.parametrize(
    "request_", [Mode.OFF, SetPoint(40.0), ChooseController("pid"), Acknowledge(), Acknowledge("x")]
)
def test_every_request_of_a_key_is_a_call_that_a_daemon_knows(request_):
    keys = call_for(request_)
    call = parse(asking(1, keys.pop("do"), {"loop": "tank", **keys}))
    assert call.loop == "tank"
    assert [call.argument] == list(keys.values())


def test_a_power_is_no_key():
    with pytest.raises(Refused, match="ManualPower"):
        call_for(ManualPower(0.5))


def test_of_set_points_in_a_row_the_last_one_counts():
    waiting = [SetPoint(37.6), SetPoint(37.7), Mode.MANUAL, SetPoint(38.0), SetPoint(39.0)]
    assert most_urgent(waiting) == [SetPoint(37.7), Mode.MANUAL, SetPoint(39.0)]


def test_nothing_that_was_asked_before_off_can_come_after_it():
    waiting = [Mode.AUTO, SetPoint(40.0), Acknowledge(), Mode.OFF, SetPoint(20.0)]
    assert most_urgent(waiting) == [Acknowledge(), Mode.OFF, SetPoint(20.0)]


def test_a_view_that_was_opened_late_does_not_say_that_nothing_ever_happened():
    model = LiveModel(facts_of(MET, NOON, 2000.0))
    rows = [row.plain.rstrip() for row in render(model.view(0.0), 80, 24, Look())]
    assert "nothing has happened since this view was opened" in rows
