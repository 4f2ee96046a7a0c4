"""One loop, watched: finished steps go in, an `Insight` comes out.

Fed beside the loop, never by its thread: see ``thermoctl/app/insight_watch.py``.
"""

from __future__ import annotations

import math

from thermoctl.insight.gate import GateWatch
from thermoctl.insight.rows import Known, rows
from thermoctl.insight.values import Gate, Insight
from thermoctl.insight.witness import Witness
from thermoctl.signals import Event, Quality, Step


class Insights:
    """Watches one loop.

    Parameters
    ----------
    period_s : float
        Time between two samples.
    heater_w : float, optional
        Rated power of the heater in W; without it nothing is told in watts, joules or litres.

    Raises
    ------
    ValueError
        `heater_w` is not positive and finite.
    """

    def __init__(self, period_s: float = 1.0, heater_w: float | None = None) -> None:
        if heater_w is not None and not 0.0 < heater_w < math.inf:
            raise ValueError(f"heater_w must be positive and finite, got {heater_w!r}")
        self._heater_w = heater_w
        self._witness = Witness(period_s)
        self._gate_watch = GateWatch()
        self._gate = Gate.UNKNOWN
        self._applied = 0.0
        self._t_s = math.nan
        self._plant: object = None
        self._now = Insight()

    @property
    def now(self) -> Insight:
        """What is told after the last step."""
        return self._now

    def after(self, step: Step, accepted_power: float) -> tuple[Event, ...]:
        """Take a finished step; return what is news for the journal.

        Parameters
        ----------
        step : Step
            The regulator's step.
        accepted_power : float
            What the hardware took, until the next step; NaN when it took nothing.
        """
        applied, self._applied = self._applied, _taken(accepted_power)
        plant = self._witness.after(step, applied)
        if plant is None or step.measurement.quality is not Quality.GOOD:
            return ()
        gate = self._gate_watch.after(step.t_s, plant)
        gain = Known(plant.gain_k_per_s, plant.gain_sd_k_per_s)
        self._now = Insight(step.t_s, gate, rows(plant, gain, None, self._heater_w))
        return ()


def _taken(power: float) -> float:
    return power if math.isfinite(power) else 0.0
