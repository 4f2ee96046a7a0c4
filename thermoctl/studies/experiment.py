"""Measures of a control run: how it warmed up and how well it held.

The true temperature is judged where it is known, not what the sensor says of it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from thermoctl.errors import ThermoctlError
from thermoctl.quantities import Array
from thermoctl.signals import Cycle

REACHED_K = 0.1
"""The warm-up is over this close to the set point."""

SETTLE_S = 300.0
"""Left out after the warm-up, so that its overshoot is not taken for regulation."""

_FEWEST_CYCLES = 3
_REGULAR = 0.35
_SMOOTH_S = 5.0


class RunError(ThermoctlError, ValueError):
    """A run cannot be judged; the message says what was expected and what came."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What happened in one loop; every array has shape (T,).

    Parameters
    ----------
    t_s : ndarray
        Time from the first cycle on, strictly increasing.
    measured_c, true_c : ndarray
        What the sensor said and what only a simulation knows; NaN where not known.
    power : ndarray
        Accepted power from this cycle to the next, as a fraction.
    setpoint_c : ndarray
        What was asked for.
    a, a_sd : ndarray
        Pole of the first-order law and its standard deviation; NaN where not known.
    """

    t_s: Array
    measured_c: Array
    true_c: Array
    power: Array
    setpoint_c: Array
    a: Array
    a_sd: Array

    def __post_init__(self) -> None:
        columns = (self.measured_c, self.true_c, self.power, self.setpoint_c, self.a, self.a_sd)
        if any(column.shape != self.t_s.shape for column in columns):
            shapes = [column.shape for column in (self.t_s, *columns)]
            raise RunError(f"expected arrays of one length, got {shapes}")
        if len(self.t_s) < 2 or not np.all(np.diff(self.t_s) > 0.0):
            raise RunError(f"expected two or more cycles in the order of time, got {len(self.t_s)}")

    @property
    def judged_c(self) -> Array:
        """The true temperature, or the measured one in a run that knows no better."""
        return self.true_c if np.any(np.isfinite(self.true_c)) else self.measured_c


def run_from_cycles(cycles: Iterable[Cycle]) -> Run:
    """Return the run of one loop's `cycles`; `RunError` on fewer than two."""
    rows = [
        (
            cycle.step.t_s,
            cycle.step.measurement.temperature_c,
            cycle.truth.get("true_temperature_c", math.nan),
            cycle.accepted_power,
            cycle.step.setpoint_c,
            _known(cycle.step.beliefs.a),
            _known(cycle.step.beliefs.a_sd),
        )
        for cycle in cycles
    ]
    columns = np.array(rows, dtype=np.float64).reshape(len(rows), 7).T
    t_s, *others = columns
    return Run(t_s - t_s[0] if len(t_s) else t_s, *others)


def _known(value: float | None) -> float:
    """Return NaN for what is not known."""
    return math.nan if value is None else value


@dataclass(frozen=True, slots=True)
class Measures:
    """Figures of a run; None where the run does not show them.

    Parameters
    ----------
    warm_up_s : float or None
        Time until the temperature first came within `REACHED_K` of the set point.
    overshoot_k : float or None
        How far the temperature went beyond the set point afterwards, zero or more; beyond is
        above when it came from below.
    window_s : float or None
        Length of the stretch that the figures below describe: from `SETTLE_S` after the warm-up,
        or from the middle of what is left when that is shorter, to the end.
    bias_k, deviation_k : float or None
        Mean distance from the set point there, and standard deviation about that mean.
    range_k : float or None
        Highest less lowest temperature there.
    cycle_k, cycle_period_s : float or None
        Median peak-to-peak and period of a limit cycle; None unless it comes back regularly.
    travel_per_min : float or None
        Way the actuator went there, in full ranges a minute.
    mean_power : float or None
        Mean accepted power there, as a fraction.
    """

    warm_up_s: float | None = None
    overshoot_k: float | None = None
    window_s: float | None = None
    bias_k: float | None = None
    deviation_k: float | None = None
    range_k: float | None = None
    cycle_k: float | None = None
    cycle_period_s: float | None = None
    travel_per_min: float | None = None
    mean_power: float | None = None


def regulation_window(run: Run) -> slice | None:
    """Return the cycles at the set point; None when it was never reached."""
    arrival = _arrival(run)
    if arrival is None:
        return None
    reached, _ = arrival
    left_s = float(run.t_s[-1] - run.t_s[reached])
    begin = run.t_s[reached] + min(SETTLE_S, 0.5 * left_s)
    window = slice(int(np.searchsorted(run.t_s, begin)), len(run.t_s))
    known = np.isfinite(run.judged_c[window]) & np.isfinite(run.power[window])
    return window if np.count_nonzero(known) >= 2 else None


def measure(run: Run) -> Measures:
    """Return the figures of `run`."""
    arrival = _arrival(run)
    if arrival is None:
        return Measures()
    reached, side = arrival
    error = run.judged_c - run.setpoint_c
    warm_up_s = float(run.t_s[reached])
    overshoot = max(0.0, float(np.nanmax(side * error[reached:])))
    window = regulation_window(run)
    if window is None:
        return Measures(warm_up_s, overshoot)
    t_s, held, power = run.t_s[window], error[window], run.power[window]
    cycle_k, cycle_period_s = limit_cycle(t_s, held) or (None, None)
    window_s = float(t_s[-1] - t_s[0])
    return Measures(
        warm_up_s=warm_up_s,
        overshoot_k=overshoot,
        window_s=window_s,
        bias_k=float(np.nanmean(held)),
        deviation_k=float(np.nanstd(held)),
        range_k=float(np.nanmax(held) - np.nanmin(held)),
        cycle_k=cycle_k,
        cycle_period_s=cycle_period_s,
        travel_per_min=60.0 * float(np.sum(np.abs(np.diff(power[np.isfinite(power)])))) / window_s,
        mean_power=float(np.nanmean(power)),
    )


def limit_cycle(t_s: Array, temperature: Array) -> tuple[float, float] | None:
    """Return peak-to-peak and period of a regular oscillation, or None.

    A cycle runs from one upward crossing of the mean to the next; a crossing counts only after the
    temperature has been half a standard deviation below, so that noise about the mean does not. It
    is regular when the periods scatter by less than 35 % about at least three cycles.

    Parameters
    ----------
    t_s, temperature : ndarray, shape (T,)
        Time in s, and temperature in degC or K; samples that are not finite are passed over.
    """
    known = np.isfinite(temperature)
    t_s, values = t_s[known], _smoothed(t_s[known], temperature[known])
    if len(values) < 2 or not np.ptp(values) > 0.0:
        return None
    crossings = _upward_crossings(values - values.mean(), 0.5 * float(np.std(values)))
    periods = np.diff(t_s[crossings])
    if len(periods) < _FEWEST_CYCLES or float(np.std(periods)) > _REGULAR * float(np.mean(periods)):
        return None
    ranges = [
        float(np.ptp(values[begin:end])) for begin, end in itertools.pairwise(crossings.tolist())
    ]
    return float(np.median(ranges)), float(np.median(periods))


def _arrival(run: Run) -> tuple[int, float] | None:
    """Return the first cycle within `REACHED_K` of the set point, and +1 if it came from below."""
    error = run.judged_c - run.setpoint_c
    known = np.flatnonzero(np.isfinite(error))
    if not len(known):
        return None
    side = 1.0 if error[known[0]] <= 0.0 else -1.0
    hits = known[side * error[known] >= -REACHED_K]
    return (int(hits[0]), side) if len(hits) else None


def _smoothed(t_s: Array, values: Array) -> Array:
    """Return a running mean over about `_SMOOTH_S`, which takes the noise off the peaks."""
    period = float(np.median(np.diff(t_s))) if len(t_s) > 1 else math.inf
    width = max(1, min(round(_SMOOTH_S / period), len(values)))
    padded = np.concatenate(([0.0], np.cumsum(values - values[:1])))
    half = width // 2
    index = np.arange(len(values))
    low, high = np.maximum(index - half, 0), np.minimum(index + width - half, len(values))
    smooth: Array = (padded[high] - padded[low]) / (high - low)
    return smooth


def _upward_crossings(values: Array, band: float) -> npt.NDArray[np.intp]:
    """Return where `values` rise through zero after having been below -`band`."""
    crossings, armed = [], False
    for index, value in enumerate(values.tolist()):
        if value < -band:
            armed = True
        elif armed and value >= 0.0:
            crossings.append(index)
            armed = False
    return np.array(crossings, dtype=np.intp)
