import contextlib
import fcntl
import io
import os
import pty
import signal
import struct
import termios
from collections.abc import Callable, Iterator
from typing import TextIO

import pytest

from thermoctl.app.live.look import Colour, Look, Role
from thermoctl.app.live.model import LiveModel
from thermoctl.app.live.screen import FASTEST_S, SMALL_S, LiveScreen, terminal_codes
from thermoctl.signals import Cycle

MakeCycle = Callable[..., Cycle]
ALTERNATE, NORMAL, CURSOR = "\x1b[?1049h", "\x1b[?1049l", "\x1b[?25h"


class ScriptedTime:
    """A clock that stands until it is told."""

    def __init__(self) -> None:
        self.t_s = 0.0

    def __call__(self) -> float:
        return self.t_s


@pytest.fixture
def clock() -> ScriptedTime:
    return ScriptedTime()


@pytest.fixture
def output() -> io.StringIO:
    return io.StringIO()


@pytest.fixture
def screen(sixty: LiveModel, output: io.StringIO, clock: ScriptedTime) -> LiveScreen:
    return LiveScreen(sixty, output, Look(Colour.NONE), clock)


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_the_terminal_is_given_back_however_it_ends(
    screen: LiveScreen, output: io.StringIO, error: type[BaseException]
) -> None:
    with contextlib.suppress(error), screen:
        screen.draw(59.0)
        raise error
    assert output.getvalue().startswith(ALTERNATE)
    assert output.getvalue().endswith(CURSOR + NORMAL)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_to_end_leaves_through_the_same_door(
    screen: LiveScreen, output: io.StringIO, number: signal.Signals
) -> None:
    before = signal.signal(number, signal.SIG_DFL)
    try:
        with pytest.raises(SystemExit) as ended, screen:
            signal.raise_signal(number)
        assert ended.value.code == 128 + number
        assert output.getvalue().endswith(NORMAL)
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, before)


def test_a_signal_somebody_else_handles_is_left_to_them(screen: LiveScreen) -> None:
    seen: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: seen.append(number))
    try:
        with screen:
            signal.raise_signal(signal.SIGTERM)
        assert seen == [signal.SIGTERM]
    finally:
        signal.signal(signal.SIGTERM, before)


def test_pictures_come_no_faster_than_the_eye_sees(screen: LiveScreen, clock: ScriptedTime) -> None:
    assert screen.draw(59.0)
    clock.t_s = 0.99 * FASTEST_S
    assert not screen.draw(59.0)
    assert screen.draw(59.0, at_once=True)
    clock.t_s += FASTEST_S
    assert screen.draw(59.0)


def test_only_rows_that_changed_are_written(
    screen: LiveScreen, output: io.StringIO, clock: ScriptedTime
) -> None:
    screen.draw(59.0)
    whole = output.getvalue()
    assert whole.count("\x1b[24;1H") == 1
    clock.t_s = 1.0
    screen.draw(59.5)
    update = output.getvalue()[len(whole) :]
    assert "0.5" in update
    assert "\x1b[24;1H" not in update
    clock.t_s = 2.0
    screen.draw(59.5)
    assert output.getvalue() == whole + update


@pytest.fixture
def terminal() -> Iterator[tuple[int, TextIO]]:
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w", encoding="utf-8") as output:
        yield ours, output
    os.close(ours)


def resize(fd: int, width: int, height: int) -> None:
    fcntl.ioctl(fd, termios.TIOCSWINSZ, struct.pack("HHHH", height, width, 0, 0))


def read(fd: int) -> str:
    """Return what was written to the terminal; it was flushed, so that it is there."""
    os.set_blocking(fd, False)
    received = b""
    while True:
        try:
            received += os.read(fd, 65_536)
        except BlockingIOError:
            return received.decode("utf-8", "replace")


def test_a_new_size_is_drawn_whole_and_a_small_one_once_a_second(
    sixty: LiveModel, terminal: tuple[int, TextIO], clock: ScriptedTime
) -> None:
    fd, output = terminal
    resize(fd, 40, 5)
    screen = LiveScreen(sixty, output, Look(Colour.NONE), clock)
    assert screen.draw(59.0)
    small = read(fd)
    assert "37.49" in small
    assert "\x1b[6;1H" not in small
    clock.t_s = 0.9 * SMALL_S
    assert not screen.draw(59.0)
    clock.t_s = SMALL_S
    resize(fd, 60, 6)
    assert screen.draw(59.0)
    assert "\x1b[6;1H" in read(fd)


def test_hues_are_written_for_a_terminal_that_has_them_and_not_otherwise() -> None:
    def codes(colour: Colour) -> str:
        return terminal_codes(Look(colour).text(("x", Role.BLUE)), colour)

    assert codes(Colour.TRUE) == "\x1b[38;2;109;181;242;48;2;18;21;23mx\x1b[0m"
    assert codes(Colour.ANSI) == "\x1b[34mx\x1b[0m"
    assert codes(Colour.NONE) == "x"


def test_a_pause_reaches_the_screen(screen: LiveScreen, output: io.StringIO) -> None:
    screen.draw(59.0, paused=True)
    assert "SIM PAUSED" in output.getvalue()
