"""The picture on a real terminal, and the terminal as it was afterwards."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any, Self, TextIO

from rich.color import ColorSystem
from rich.text import Text

from thermoctl.app.live.look import Colour, Look, look_for, segments
from thermoctl.app.live.model import LiveModel
from thermoctl.app.live.render import LEAST_HEIGHT, LEAST_WIDTH, render

FASTEST_S = 0.1
"""Least time between two pictures; an eye sees no more, and a serial line carries no more."""

SMALL_S = 1.0
"""The same for a terminal that has room for one line only."""

_ENTER = "\x1b[?1049h\x1b[?25l\x1b[?7l"
_LEAVE = "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"

_SYSTEMS = {Colour.TRUE: ColorSystem.TRUECOLOR, Colour.ANSI: ColorSystem.STANDARD}


def terminal_codes(line: Text, colour: Colour) -> str:
    """Return `line` with a terminal's codes; attributes without hues for NONE."""
    # The styles of NONE hold no hue, so that any system writes none.
    system = _SYSTEMS.get(colour, ColorSystem.STANDARD)
    return "".join(
        segment.style.render(segment.text, color_system=system) if segment.style else segment.text
        for segment in segments(line)
    )


def _end_by_signal(number: int, frame: FrameType | None) -> None:
    """Leave through every ``finally``, as an exit would."""
    raise SystemExit(128 + number)


class LiveScreen:
    """Draws a `LiveModel`; a context that restores the terminal.

    However the context is left, by an exception, Ctrl-C or a signal that asks the process to end,
    the terminal is as before. The signals are taken only where nobody else handles them, and only
    in the main thread; otherwise whoever handles them leaves the context.

    Parameters
    ----------
    model : LiveModel
        What is shown. Drawing and feeding belong to one thread.
    output : file, optional
        Terminal to draw on; standard output by default.
    look : Look, optional
        What the terminal can show; found out from `output` and the environment by default.
    now_s : callable, optional
        Monotonic clock the rate of drawing is bounded by.
    """

    def __init__(
        self,
        model: LiveModel,
        output: TextIO | None = None,
        look: Look | None = None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._model = model
        self._output = sys.stdout if output is None else output
        self._look = look_for(self._output.encoding) if look is None else look
        self._now_s = now_s
        self._drawn: list[str] = []
        self._size = (0, 0)
        self._due_s = -float("inf")
        self._taken: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGTERM, signal.SIGHUP):
                if signal.getsignal(number) is signal.SIG_DFL:
                    self._taken[number] = signal.signal(number, _end_by_signal)
        self._write(_ENTER)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self._write(_LEAVE)
        except OSError:
            pass  # the terminal is gone: nothing is left to restore
        finally:
            while self._taken:
                signal.signal(*self._taken.popitem())

    def draw(
        self,
        loop_s: float,
        prompt: str = "",
        *,
        paused: bool = False,
        lost: str = "",
        at_once: bool = False,
    ) -> bool:
        """Draw the model as of loop time `loop_s`; return whether it was time to.

        Parameters
        ----------
        loop_s : float
            Loop time now, in s; the age of the data is counted from it.
        prompt : str
            A question to show instead of the keys.
        paused : bool
            Whether simulated time stands still.
        lost : str
            Why nothing more is heard of the loop; empty while it is.
        at_once : bool
            Draw even when the last picture is younger than `FASTEST_S`.
        """
        now_s = self._now_s()
        if now_s < self._due_s and not at_once:
            return False
        width, height = self._terminal_size()
        small = width < LEAST_WIDTH or height < LEAST_HEIGHT
        self._due_s = now_s + (SMALL_S if small else FASTEST_S)
        view = self._model.view(loop_s, prompt, paused=paused, lost=lost)
        rows = render(view, width, height, self._look)
        lines = [terminal_codes(row, self._look.colour) for row in rows]
        # Asking for the size at each picture notices a resize as soon as SIGWINCH would.
        if (width, height) != self._size:
            self._size, self._drawn = (width, height), []
        before = self._drawn or [""] * len(lines)
        changed = [
            f"\x1b[{row};1H{line}"
            for row, (line, old) in enumerate(zip(lines, before, strict=True), 1)
            if line != old
        ]
        self._drawn = lines
        if changed:
            self._write("".join(changed))
        return True

    def _terminal_size(self) -> tuple[int, int]:
        """Return columns and rows of the terminal; 80 by 24 where nobody knows."""
        try:
            size = os.get_terminal_size(self._output.fileno())
        except (OSError, ValueError):
            return LEAST_WIDTH, LEAST_HEIGHT
        return size.columns or LEAST_WIDTH, size.lines or LEAST_HEIGHT

    def _write(self, codes: str) -> None:
        self._output.write(codes)
        self._output.flush()
