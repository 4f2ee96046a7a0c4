"""Somebody who knows the plant, whoever steers."""

from __future__ import annotations

import math

from thermoctl.control.adaptive import Adaptive
from thermoctl.ports import Situation
from thermoctl.signals import PlantBelief, Quality, Step


class Witness:
    """Asks the controller in charge what it believes, else a bank of its own.

    The bank is only begun when a step comes whose controller has no words for its plant.

    Parameters
    ----------
    period_s : float
        Time between two samples.
    """

    def __init__(self, period_s: float) -> None:
        self._law = Adaptive(period_s=period_s)
        self._belief = self._law.start()
        self._last_s = math.nan

    def after(self, step: Step, applied: float) -> PlantBelief | None:
        """Return what is believed of the plant after `step`.

        Parameters
        ----------
        step : Step
            The finished step.
        applied : float
            Power in the time before it, as a fraction.
        """
        told = step.plant
        if told is not None:
            return told
        interval_s = step.t_s - self._last_s if math.isfinite(self._last_s) else self._law.period_s
        self._last_s = step.t_s
        good = step.measurement.quality is Quality.GOOD
        seen_c = step.measurement.temperature_c if good else math.nan
        past = step.estimate.theta[:0]
        situation = Situation(
            step.t_s,
            interval_s,
            seen_c,
            step.setpoint_c,
            applied,
            step.estimate,
            past,
            past,
            seen_c,
        )
        try:
            self._belief = self._law.observe(self._belief, situation)
        except ArithmeticError:
            self._belief = self._law.start()
        return self._law.plant(self._belief)
