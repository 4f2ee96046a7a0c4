import contextlib
import os
import pty
import termios
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermoctl.app.live.desk import DISTURBANCES, Desk
from thermoctl.app.live.keys import Action, Keys, decode
from thermoctl.app.live.model import Facts
from thermoctl.signals import (
    Acknowledge,
    ChooseController,
    Command,
    Estimate,
    Measurement,
    Mode,
    SetPoint,
    State,
    Step,
)


def at(setpoint_c: float = 37.5, mode: Mode = Mode.AUTO, shadow: str | None = None) -> Step:
    """Return a step of a loop that holds `setpoint_c`."""
    return Step(
        t_s=0.0,
        measurement=Measurement(0.0, 37.5),
        mode=mode,
        state=State.RUN,
        setpoint_c=setpoint_c,
        command=Command(0.0, 3.0, "control"),
        controller="adaptive",
        estimate=Estimate(np.zeros(0), np.zeros((0, 0))),
        shadow=shadow,
    )


AUTO, OFF, MANUAL = at(), at(mode=Mode.OFF), at(mode=Mode.MANUAL)


@pytest.mark.parametrize(
    ("received", "actions"),
    [
        (b"\x1b[A\x1b[B", [Action.SETPOINT_UP, Action.SETPOINT_DOWN]),
        (b"\x1bOA\x1bOB", [Action.SETPOINT_UP, Action.SETPOINT_DOWN]),
        (b"\x1b[1;2A\x1b[1;2B", [Action.SETPOINT_UP_MUCH, Action.SETPOINT_DOWN_MUCH]),
        (b"\x1b[5~\x1b[6~", [Action.SETPOINT_UP_MUCH, Action.SETPOINT_DOWN_MUCH]),
        (b"mcdi", [Action.MODE, Action.CONTROLLER, Action.COLD_WATER, Action.ICE]),
        (b"sa q", [Action.STIRRER, Action.ACKNOWLEDGE, Action.PAUSE, Action.QUIT]),
        (b"\r\x03", [Action.CONFIRM, Action.QUIT]),
        (b"\x1bm", [Action.CANCEL, Action.MODE]),
        (b"xyz\x1b[15~\x1b[1;5Cm\xff", [Action.MODE]),
        (b"", []),
    ],
)
def test_keys_are_decoded(received: bytes, actions: list[Action]) -> None:
    assert decode(received) == (actions, b"")


@given(st.binary(max_size=40), st.integers(0, 40))
def test_it_does_not_matter_where_a_stream_is_cut(received: bytes, cut: int) -> None:
    whole = decode(received)
    first, begun = decode(received[:cut])
    rest, left = decode(begun + received[cut:])
    assert (first + rest, left) == whole


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    ours, theirs = pty.openpty()
    yield ours, theirs
    for fd in (ours, theirs):
        try:
            os.close(fd)
        except OSError:
            continue


def test_the_terminal_is_as_before_after_an_exception(terminal: tuple[int, int]) -> None:
    _, fd = terminal
    before = termios.tcgetattr(fd)
    with Keys(fd):
        inside = termios.tcgetattr(fd)
    assert not inside[3] & (termios.ICANON | termios.ECHO)
    assert inside[3] & termios.ISIG  # Ctrl-C still ends a process that hangs
    assert inside[6][termios.VSUSP] == b"\x00"
    with contextlib.suppress(RuntimeError), Keys(fd):
        raise RuntimeError
    assert termios.tcgetattr(fd) == before


def test_keys_come_as_they_are_pressed(terminal: tuple[int, int]) -> None:
    ours, fd = terminal
    with Keys(fd) as keys:
        assert keys.poll() == []
        os.write(ours, b"m\x1b[A")
        assert keys.poll(5.0) == [Action.MODE, Action.SETPOINT_UP]
        os.write(ours, b"\x1b[")
        assert keys.poll(5.0) == []
        os.write(ours, b"B")
        assert keys.poll() == [Action.SETPOINT_DOWN]


def test_escape_alone_cancels(terminal: tuple[int, int]) -> None:
    ours, fd = terminal
    with Keys(fd) as keys:
        os.write(ours, b"\x1b")
        assert keys.poll(5.0) == []
        assert keys.poll() == [Action.CANCEL]


def test_a_terminal_that_hangs_up_is_a_wish_to_quit(terminal: tuple[int, int]) -> None:
    ours, fd = terminal
    with Keys(fd) as keys:
        os.close(ours)
        assert keys.poll(5.0) == [Action.QUIT]


def test_what_is_no_terminal_has_no_keys() -> None:
    reading, writing = os.pipe()
    os.write(writing, b"q")
    with Keys(reading) as keys:
        assert keys.poll() == []
    os.close(reading)
    os.close(writing)


def test_off_acts_at_once_and_every_other_mode_is_confirmed(facts: Facts) -> None:
    desk = Desk(facts)
    assert desk.press(Action.MODE, MANUAL) is Mode.OFF
    assert desk.prompt == ""
    assert desk.press(Action.MODE, OFF) is None
    assert "mode auto" in desk.prompt
    assert desk.press(Action.CONFIRM, OFF) is Mode.AUTO
    assert desk.prompt == ""
    assert desk.press(Action.CONFIRM, OFF) is None


def test_from_auto_two_strokes_are_off(facts: Facts) -> None:
    desk = Desk(facts)
    assert desk.press(Action.MODE, AUTO) is None
    assert "mode manual" in desk.prompt
    assert desk.press(Action.MODE, AUTO) is Mode.OFF
    assert desk.prompt == ""


def test_a_proposed_mode_can_be_left(facts: Facts) -> None:
    desk = Desk(facts)
    desk.press(Action.MODE, OFF)
    assert desk.press(Action.CANCEL, OFF) is None
    assert desk.press(Action.CONFIRM, OFF) is None


@pytest.fixture
def shadowed() -> Step:
    return at(shadow="self-tuning-mv")


def test_the_shadow_takes_over_once_it_is_confirmed(facts: Facts, shadowed: Step) -> None:
    desk = Desk(facts)
    assert desk.press(Action.CONTROLLER, shadowed) is None
    assert desk.prompt == "Enter: self-tuning-mv takes over   Esc: leave it"
    assert desk.press(Action.CONFIRM, shadowed) == ChooseController("self-tuning-mv")
    assert desk.prompt == ""
    assert desk.press(Action.CONFIRM, shadowed) is None


def test_a_proposed_controller_can_be_left(facts: Facts, shadowed: Step) -> None:
    desk = Desk(facts)
    desk.press(Action.CONTROLLER, shadowed)
    assert desk.press(Action.CANCEL, shadowed) is None
    assert desk.prompt == ""
    assert desk.press(Action.CONFIRM, shadowed) is None


def test_a_loop_without_a_shadow_has_nobody_to_propose(facts: Facts) -> None:
    desk = Desk(facts)
    assert desk.press(Action.CONTROLLER, AUTO) is None
    assert desk.prompt == ""
    assert desk.press(Action.CONFIRM, AUTO) is None


def test_a_mode_takes_the_place_of_a_proposed_controller_and_the_other_way_round(
    facts: Facts, shadowed: Step
) -> None:
    desk = Desk(facts)
    desk.press(Action.CONTROLLER, shadowed)
    assert desk.press(Action.MODE, shadowed) is None
    assert desk.prompt.startswith("Enter: mode manual")
    assert desk.press(Action.CONTROLLER, shadowed) is None
    assert desk.press(Action.CONFIRM, shadowed) == ChooseController("self-tuning-mv")


def test_off_acts_at_once_while_a_controller_is_proposed(facts: Facts) -> None:
    desk, manual = Desk(facts), at(mode=Mode.MANUAL, shadow="pid")
    desk.press(Action.CONTROLLER, manual)
    assert desk.press(Action.MODE, manual) is Mode.OFF
    assert desk.prompt == ""


def test_a_refusal_is_told_until_the_next_key_and_strokes_begin_anew(facts: Facts) -> None:
    desk = Desk(facts)
    assert [desk.press(Action.SETPOINT_UP, AUTO) for _ in range(2)][-1] == SetPoint(37.7)
    desk.refused("expected a set point from 5 to 37.5 degC, got 37.7")
    assert desk.prompt == "Refused: expected a set point from 5 to 37.5 degC, got 37.7"
    assert desk.press(Action.SETPOINT_DOWN, AUTO) == SetPoint(37.4)
    assert desk.prompt == ""


def test_strokes_add_up_before_the_loop_takes_the_first(facts: Facts) -> None:
    desk = Desk(facts)
    asked = [desk.press(Action.SETPOINT_UP, AUTO) for _ in range(3)]
    assert asked == [SetPoint(37.6), SetPoint(37.7), SetPoint(37.8)]
    assert desk.press(Action.SETPOINT_DOWN, at(20.0)) == SetPoint(19.9)


def test_a_set_point_stays_within_its_limits(facts: Facts) -> None:
    desk = Desk(facts)
    assert desk.press(Action.SETPOINT_UP_MUCH, at(59.5)) == SetPoint(60.0)
    assert desk.press(Action.SETPOINT_DOWN_MUCH, at(5.5)) == SetPoint(5.0)


def test_at_a_limit_nothing_is_asked_and_the_way_back_is_open(facts: Facts) -> None:
    desk = Desk(facts)
    assert desk.press(Action.SETPOINT_UP, at(60.0)) is None
    assert desk.press(Action.SETPOINT_DOWN, at(60.0)) == SetPoint(59.9)
    assert desk.press(Action.SETPOINT_UP, at(60.0)) == SetPoint(60.0)  # 59.9 is on its way
    assert desk.press(Action.SETPOINT_UP, at(60.0)) is None


def test_acknowledging_asks_for_all_alarms_and_a_disturbance_asks_the_loop_nothing(
    facts: Facts,
) -> None:
    desk = Desk(facts)
    assert desk.press(Action.ACKNOWLEDGE, AUTO) == Acknowledge()
    for action in (*DISTURBANCES, Action.PAUSE, Action.QUIT):
        assert desk.press(action, AUTO) is None
