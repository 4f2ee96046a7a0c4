"""An estimate of the plant, whichever controller is in charge."""

from __future__ import annotations

import math

from thermoctl.control.adaptive import Adaptive, AdaptiveBelief
from thermoctl.ports import Situation
from thermoctl.signals import PlantBelief, Quality, Step


class Witness:
    """Takes the plant from the controllers, otherwise from a bank of its own.

    That bank starts at the first step in which no controller estimates its plant. It starts from
    what the last one that did would have kept for the next start, under the power of that moment.

    Parameters
    ----------
    period_s : float
        Time between two samples.
    """

    def __init__(self, period_s: float) -> None:
        self._law = Adaptive(period_s=period_s)
        self._belief: AdaptiveBelief | None = None
        self._told: Step | None = None
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
            self._told, self._belief = step, None
            return told
        if self._belief is None:
            self._belief, self._last_s = self._begun(applied), math.nan
        try:
            self._belief = self._law.observe(self._belief, self._situation(step, applied))
        except ArithmeticError:
            self._belief = self._law.start()
        return self._law.plant(self._belief)

    def _begun(self, applied: float) -> AdaptiveBelief:
        """Return the belief to begin with; an unknown plant is taken to be met cold."""
        if self._told is None:
            return self._law.start()
        kept = self._told.remember().get(self._law.name)
        try:
            begun = self._law.start() if kept is None else self._law.start_from(kept, 0.0)
        except ValueError:  # a law of another action, or with other constants
            begun = self._law.start()
        return self._law.under(begun, applied)

    def _situation(self, step: Step, applied: float) -> Situation:
        """Return the sample of `step` as a controller is shown it."""
        interval_s = step.t_s - self._last_s if math.isfinite(self._last_s) else self._law.period_s
        self._last_s = step.t_s
        good = step.measurement.quality is Quality.GOOD
        seen_c = step.measurement.temperature_c if good else math.nan
        past = step.estimate.theta[:0]
        return Situation(
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
