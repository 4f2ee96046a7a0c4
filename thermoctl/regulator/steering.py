"""The controller in charge of a loop."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from thermoctl.ports import Knowing, Situation
from thermoctl.quantities import clamp, is_finite_number
from thermoctl.regulator.guard import Failure, Guard, attempt
from thermoctl.regulator.mind import Mind
from thermoctl.regulator.supervisor import Emit
from thermoctl.signals import Beliefs, PlantBelief

_FAILED = "controller.failed"
_SILENT = Beliefs()

Pole = tuple[float | None, float | None]
"""A pole and its standard deviation; None for what is not known."""


class Steering:
    """Asks the controller in charge; when it fails, that costs the heat.

    Parameters
    ----------
    mind : Mind
        The controller; another one may take its place between two samples.
    guard : Guard
        What stands between the law and the loop.
    emit : callable
        Called as ``emit(name, **fields)`` when a remark appears and when it is gone.
    """

    def __init__(self, mind: Mind, guard: Guard, emit: Emit) -> None:
        self.mind = mind
        self._guard = guard
        self._emit = emit
        self._remarks: Mapping[str, str] = {}

    @property
    def name(self) -> str:
        """The name of the controller."""
        return self.mind.name

    def observe(self, situation: Situation) -> None:
        """Show the controller a sample, whether its power is wanted or not."""
        self._guard.call(_FAILED, situation.t_s, None, self.mind.observe, situation)

    def decide(self, situation: Situation) -> object:
        """Return what the controller asks for; 0 when it fails."""
        nothing: object = 0.0
        return self._guard.call(_FAILED, situation.t_s, nothing, self.mind.decide, situation)

    def beliefs(self, situation: Situation, pole: Pole, holding_power: float | None) -> Beliefs:
        """Return the controller's words; where it says nothing, what is known beside it."""
        t_s = situation.t_s
        return self._guard.call(_FAILED, t_s, _SILENT, self._words, situation, pole, holding_power)

    def _words(self, situation: Situation, pole: Pole, holding_power: float | None) -> Beliefs:
        told = self.mind.controller.beliefs(self.mind.belief, situation)
        a, a_sd = pole if told.a is None else (told.a, told.a_sd)
        if told.holding_power is not None:
            holding_power = told.holding_power
        return Beliefs(told.gain, told.gain_sd, a, a_sd, holding_power, told.lag_s)

    def tell(self, beside: Mind | None) -> Callable[[], PlantBelief | None]:
        """Return a function that says what is believed of the plant now, when called.

        Where the one in charge has no words for it, the one `beside` it may have some.
        """
        mind = self.mind if beside is None or self.mind.knows is not None else beside
        return partial(_plant, mind.knows, mind.belief)

    def ride_s(self, situation: Situation, beliefs: Beliefs, most_s: float) -> float:
        """Return how long the model may steer without a sensor: 0 until it is known."""
        known = is_finite_number(beliefs.holding_power) and math.isfinite(situation.temperature_c)
        if not known:
            return 0.0
        return self._guard.call(_FAILED, situation.t_s, 0.0, self._rides, most_s)

    def _rides(self, most_s: float) -> float:
        return clamp(self.mind.controller.ride_s(self.mind.belief), 0.0, most_s)

    def tell_remarks(self, t_s: float) -> None:
        """Say which conditions have appeared since the last sample, and which are gone."""
        before = self._remarks
        self._remarks = self._guard.call(_FAILED, t_s, before, self._remarked)
        if not before and not self._remarks:
            return
        for name in before.keys() - self._remarks.keys():
            self._emit(name, active=False)
        for name, text in self._remarks.items():
            if name not in before:
                self._emit(name, active=True, text=text)

    def _remarked(self) -> Mapping[str, str]:
        told = self.mind.controller.remarks(self.mind.belief)
        return {str(name): str(text) for name, text in told.items()}


def _plant(knows: Knowing | None, belief: Any) -> PlantBelief | None:
    """Return what a controller says of its plant; None where it cannot, or fails."""
    if knows is None:
        return None
    told = attempt(knows.plant, belief)
    return None if isinstance(told, Failure) else told
