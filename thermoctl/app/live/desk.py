"""From actions to requests: what a key asks, and what is asked back."""

from __future__ import annotations

import math
from collections.abc import Mapping

from thermoctl.app.live.keys import Action
from thermoctl.app.live.model import Facts
from thermoctl.quantities import clamp
from thermoctl.signals import Acknowledge, ChooseController, Mode, Request, SetPoint, Step

DISTURBANCES = frozenset({Action.COLD_WATER, Action.ICE, Action.STIRRER})
"""Actions that disturb a simulated plant and are no request to the loop."""

_SETPOINT_STEPS_K: Mapping[Action, float] = {
    Action.SETPOINT_UP: 0.1,
    Action.SETPOINT_DOWN: -0.1,
    Action.SETPOINT_UP_MUCH: 1.0,
    Action.SETPOINT_DOWN_MUCH: -1.0,
}

_NEXT_MODE: Mapping[Mode, Mode] = {
    Mode.OFF: Mode.AUTO,
    Mode.AUTO: Mode.MANUAL,
    Mode.MANUAL: Mode.OFF,
    Mode.PROGRAM: Mode.OFF,
}


class Desk:
    """Turns actions into requests for one loop; does no I/O.

    Off acts at once, because it is the safe direction. Every other mode, and the controller in
    shadow, is proposed first and confirmed with Enter; `prompt` is the question meanwhile.
    """

    def __init__(self, facts: Facts) -> None:
        self._facts = facts
        self._proposed: Mode | ChooseController | None = None
        self._refusal = ""
        self._in_force_c = self._asked_c = math.nan

    @property
    def prompt(self) -> str:
        """Return the question that is open, else why the last request was refused."""
        if self._proposed is None:
            return self._refusal
        if isinstance(self._proposed, ChooseController):
            return f"Enter: {self._proposed.name} takes over   Esc: leave it"
        return f"Enter: mode {self._proposed.value}   m: another   Esc: leave it"

    def refused(self, why: str) -> None:
        """Take note that what was asked last is not granted; told until the next key."""
        self._refusal = f"Refused: {why}"
        self._in_force_c = math.nan  # strokes begin anew from what is in force

    def press(self, action: Action, step: Step) -> Request | None:
        """Return what `action` asks of a loop after `step`; None when nothing yet.

        Set points stay within the limits, on whole tenths; at a limit nothing more is asked.
        """
        self._refusal = ""
        if action is Action.MODE:
            return self._next(step.mode)
        proposed, self._proposed = self._proposed, None
        if action is Action.CONTROLLER and step.shadow is not None:
            self._proposed = ChooseController(step.shadow)
        if action is Action.CONFIRM:
            return proposed
        if action is Action.ACKNOWLEDGE:
            return Acknowledge()
        step_k = _SETPOINT_STEPS_K.get(action)
        return None if step_k is None else self._moved(step.setpoint_c, step_k)

    def _moved(self, setpoint_c: float, step_k: float) -> SetPoint | None:
        """Return the set point that lies `step_k` from the last one asked for."""
        if setpoint_c != self._in_force_c:
            self._in_force_c = self._asked_c = setpoint_c
        # From what was asked last, so that quick strokes add up before the loop takes the first.
        asked_c = round(self._asked_c + step_k, 1)
        low_c, high_c = self._facts.setpoint_low_c, self._facts.setpoint_high_c
        before_c, self._asked_c = self._asked_c, clamp(asked_c, low_c, high_c)
        return None if self._asked_c == before_c else SetPoint(self._asked_c)

    def _next(self, mode: Mode) -> Mode | None:
        """Return Off, to act at once, or propose the mode that comes next."""
        before = self._proposed if isinstance(self._proposed, Mode) else mode
        following = _NEXT_MODE[before]
        if following is mode:
            following = _NEXT_MODE[following]
        if following is Mode.OFF:
            self._proposed = None
            return Mode.OFF
        self._proposed = following
        return None
