"""The measures of a run, on the true temperature of what is controlled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from thermoctl.studies.compare.play import Trace

STAY = 0.2
"""For good means for the last fifth of the stretch at least."""


@dataclass(frozen=True, slots=True)
class Measure:
    """A figure of a run.

    Parameters
    ----------
    heading : str
        What it is called in a table.
    unit : str
        Unit, after `factor`.
    shown : str
        Format of the number.
    of : callable
        Returns it for a trace; None where the trace does not show it.
    factor : float
        From the unit in its key to the one it is shown in.
    """

    heading: str
    unit: str
    shown: str
    of: Callable[[Trace], float | None]
    factor: float = 1.0


def _overshoot_k(trace: Trace) -> float:
    """Return how far the water came above the set point, zero or more."""
    return max(0.0, float((trace.true_c - trace.setpoint_c).max()))


def _settled_s(trace: Trace) -> float | None:
    """Return when the water came into the band for good; None: it did not.

    For good is until the end, and that for a fifth of the stretch: a swing may end inside.
    """
    outside = np.flatnonzero(np.abs(trace.true_c - trace.setpoint_c) > trace.band_k)
    if not outside.size:
        return 0.0
    inside = int(outside[-1]) + 1
    return float(trace.t_s[inside]) if inside <= (1.0 - STAY) * len(trace.t_s) else None


def _largest_k(trace: Trace) -> float:
    return float(np.abs(trace.true_c - trace.setpoint_c).max())


def _deviation_k(trace: Trace) -> float:
    """Return the standard deviation about the mean."""
    return float(np.std(trace.true_c - trace.setpoint_c))


def _bias_k(trace: Trace) -> float:
    return float(np.mean(trace.true_c - trace.setpoint_c))


def _travel_per_min(trace: Trace) -> float:
    """Return the way of the actuator, in full ranges a minute."""
    minutes = float(trace.t_s[-1] - trace.t_s[0]) / 60.0
    return float(np.abs(np.diff(trace.power)).sum()) / minutes


MEASURES: Mapping[str, Measure] = {
    "overshoot_k": Measure("overshoot", "K", ".3f", _overshoot_k),
    "settled_s": Measure("settled after", "s", ".0f", _settled_s),
    "deviation_k": Measure("deviation", "mK", ".1f", _deviation_k, 1e3),
    "bias_k": Measure("bias", "mK", ".1f", _bias_k, 1e3),
    "largest_k": Measure("farthest off", "K", ".3f", _largest_k),
    "travel_per_min": Measure("travel", "/min", ".2f", _travel_per_min),
}
"""Every measure by its key in JSON."""


def measured(trace: Trace) -> dict[str, float | None]:
    """Return all measures of `trace`."""
    return {name: measure.of(trace) for name, measure in MEASURES.items()}
