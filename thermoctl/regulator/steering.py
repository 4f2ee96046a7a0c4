"""The controller of a loop, together with what it remembers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from thermoctl.ports import Controller, Situation
from thermoctl.quantities import clamp, is_finite_number
from thermoctl.regulator.guard import Guard
from thermoctl.regulator.supervisor import Emit
from thermoctl.signals import Beliefs

_FAILED = "controller.failed"


class Steering:
    """Asks a controller and keeps its belief, which a failed call leaves as it was.

    Parameters
    ----------
    controller : Controller
        The law.
    guard : Guard
        What stands between the law and the loop.
    emit : callable
        Called as ``emit(name, **fields)`` when a remark appears and when it is gone.
    """

    def __init__(self, controller: Controller, guard: Guard, emit: Emit) -> None:
        self._controller = controller
        self._guard = guard
        self._emit = emit
        self._belief: Any = controller.start()
        self._remarks: Mapping[str, str] = {}

    @property
    def name(self) -> str:
        """The name of the controller."""
        return self._controller.name

    def observe(self, situation: Situation) -> None:
        """Show the controller a sample, whether it is in charge or not."""
        self._belief = self._guard.call(
            lambda: self._controller.observe(self._belief, situation),
            self._belief,
            _FAILED,
            situation.t_s,
        )

    def decide(self, situation: Situation) -> object:
        """Return what the controller asks for; 0 when it fails."""

        def decide() -> tuple[Any, object]:
            after, asked = self._controller.decide(self._belief, situation)
            return after, asked

        failed: tuple[Any, object] = (self._belief, 0.0)
        self._belief, asked = self._guard.call(decide, failed, _FAILED, situation.t_s)
        return asked

    def beliefs(self, situation: Situation, observed_power: float | None) -> Beliefs:
        """Return the controller's words; where it is vague, holding power as observed."""

        def beliefs() -> Beliefs:
            told = self._controller.beliefs(self._belief, situation)
            if told.holding_power is None and observed_power is not None:
                return replace(told, holding_power=observed_power)
            return told

        return self._guard.call(beliefs, Beliefs(), _FAILED, situation.t_s)

    def ride_s(self, situation: Situation, beliefs: Beliefs, most_s: float) -> float:
        """Return how long the model may steer without a sensor: 0 until it is known."""
        known = is_finite_number(beliefs.holding_power) and math.isfinite(situation.temperature_c)
        if not known:
            return 0.0
        return self._guard.call(
            lambda: clamp(self._controller.ride_s(self._belief), 0.0, most_s),
            0.0,
            _FAILED,
            situation.t_s,
        )

    def tell_remarks(self, t_s: float) -> None:
        """Say which conditions have appeared since the last sample, and which are gone."""

        def remarks() -> dict[str, str]:
            told = self._controller.remarks(self._belief)
            return {str(name): str(text) for name, text in told.items()}

        before = self._remarks
        self._remarks = self._guard.call(remarks, dict(before), _FAILED, t_s)
        for name in before.keys() - self._remarks.keys():
            self._emit(name, active=False)
        for name, text in self._remarks.items():
            if name not in before:
                self._emit(name, active=True, text=text)
