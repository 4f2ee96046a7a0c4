"""``thermoctl watch`` on a terminal: the live view of a loop of a running daemon."""

from __future__ import annotations

import math
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from thermoctl.app.live import Action, Desk, Facts, Keys, LiveModel, LiveScreen
from thermoctl.app.live.daemon_line import DaemonLine, Denied, Gone, Heard, Met
from thermoctl.signals import Step

_TURN_S: Final = 0.05


def watch_live(socket: Path | None, met: Met) -> None:
    """Show the loop that was `met` until the user leaves.

    Parameters
    ----------
    socket : Path or None
        The daemon's socket; found as `ControlClient` does when not given.
    met : Met
        The loop.
    """
    model = LiveModel(facts_of(met, datetime.now(UTC).astimezone(), time.monotonic()))
    fd = sys.stdin.fileno()
    with DaemonLine(socket, met) as line, Keys(fd) as keys, LiveScreen(model) as screen:
        view = WatchView(model, line)
        while view.turn(keys.poll(_TURN_S)):
            screen.draw(time.monotonic() + met.ahead_s, view.prompt, lost=view.lost)


def facts_of(met: Met, now: datetime, monotonic_s: float) -> Facts:
    """Return what does not change; limits are the daemon's to know, and to refuse by.

    Parameters
    ----------
    met : Met
        The loop.
    now : datetime
        Wall time.
    monotonic_s : float
        This machine's monotonic clock at the same moment.
    """
    zero = now - timedelta(seconds=monotonic_s + met.ahead_s)
    return Facts(met.loop, met.period_s, -math.inf, math.inf, zero, simulated=False)


class WatchView:
    """What comes from a daemon into the model, and what keys ask of it; does no I/O.

    Parameters
    ----------
    model : LiveModel
        What is shown.
    line : DaemonLine
        The loop.
    """

    def __init__(self, model: LiveModel, line: DaemonLine) -> None:
        self._model, self._line = model, line
        self._desk = Desk(model.facts)
        self._step: Step | None = None
        self.lost = ""

    @property
    def prompt(self) -> str:
        """What stands in the row of keys instead of them; empty when they do."""
        return "" if self.lost else self._desk.prompt

    def turn(self, actions: list[Action]) -> bool:
        """Take what has come and obey `actions`; return whether to go on."""
        for heard in self._line.take():
            match heard:
                case Heard(cycle, insight):
                    self._model.feed(cycle, insight)
                    self._step, self.lost = cycle.step, ""
                case Gone(why):
                    self.lost = why
                case Denied(why):
                    self._desk.refused(why)
        for action in actions:
            if action is Action.QUIT:
                return False
            if self._step is None or self.lost:
                continue  # nobody would hear it, and it must not wait for a daemon of tomorrow
            request = self._desk.press(action, self._step)
            if request is not None:
                self._line.ask(request)
        return True
