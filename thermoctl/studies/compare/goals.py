"""The figures a controller of this project has to meet: goals as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Statistic = Literal["median", "mean", "p90", "p95", "max"]

STATISTICS: Mapping[Statistic, str] = {
    "median": "median",
    "mean": "mean",
    "p90": "90 %",
    "p95": "95 %",
    "max": "max",
}
"""What is made of the plants of a fleet, and its name in tables."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A statistic of a measure, and the most it may be.

    Parameters
    ----------
    statistic : str
        A key of `STATISTICS`.
    at_most : float
        Of a measure that has a bound the most its ratio to the bound may be; else, and where it is
        `plain`, the most the measure itself may be, in the unit of its key.
    plain : bool
        Whatever the bound.
    """

    statistic: Statistic
    at_most: float
    plain: bool = False


def _goals(*, plain: bool = False, **at_most: float) -> tuple[Goal, ...]:
    return tuple(Goal(name, at_most[name], plain) for name in STATISTICS if name in at_most)


GOALS: Mapping[tuple[str, str, str], tuple[Goal, ...]] = {
    ("rig", "warm-up", "overshoot_k"): _goals(median=0.08, p95=0.12),
    ("rig", "warm-up", "settled_s"): _goals(median=1.2, p95=1.4),
    ("rig", "regulation", "deviation_k"): _goals(mean=1.4),
    ("rig", "regulation", "largest_k"): _goals(p95=0.1),
    ("rig", "regulation", "travel_per_min"): _goals(mean=0.5),
    ("rig", "step", "overshoot_k"): _goals(p95=0.1),
    ("rig", "step", "settled_s"): _goals(median=1.2, p95=1.7),
    ("rig", "cold-water", "overshoot_k"): _goals(p95=0.12),
    ("rig", "cold-water", "settled_s"): _goals(median=1.2, p95=2.0),
    ("rig", "spike-dropout", "largest_k"): _goals(p95=0.1),
    ("rig", "stirrer-stops", "largest_k"): _goals(median=0.8, p95=1.1),
    ("rig", "stirrer-back", "largest_k"): _goals(p95=0.65),
    ("rig", "half-gone", "largest_k"): _goals(p95=0.65),
    ("sizes", "warm-up", "overshoot_k"): _goals(p95=0.15),
    ("sizes", "warm-up", "settled_s"): _goals(p95=1.5),
    ("sizes", "regulation", "deviation_k"): _goals(plain=True, p95=0.02),
    ("lags", "warm-up", "overshoot_k"): _goals(p90=0.3, max=0.5),
    ("lags", "cold-water", "overshoot_k"): _goals(p90=0.4),
    ("lags", "cold-water", "settled_s"): _goals(p90=3.0),
}
"""Goals by fleet, scenario and measure; what stands nowhere has none."""
