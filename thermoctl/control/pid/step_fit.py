r"""The integrating plant with a lag that explains a rise.

Over a time that is short against the plant's slowest one, its temperature follows

.. math:: y(t) = y_0 - d\,t + k' z(t), \qquad \tau \dot z + z = \int_0^{t - \theta} u,

for whatever power u was applied: linear in start, loss and slope once dead time and lag are chosen.
They are chosen from a grid, weighted by the likelihood of what the best start, loss and slope
leave. Where nobody knows what was applied before the first reading, each of the grid is there once
for every power that it may have been, and its heat still comes. Implements section 6 of
``docs/theory.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from thermoctl.control.pid.simc import Process
from thermoctl.control.pid.stretch import Stretch
from thermoctl.quantities import Array

_TOTALS = 34
_RATIO = 1.15
_SHARES = (0.25, 0.4, 0.55, 0.7, 0.85)
_SHORTEST_S = 1.0
_READINGS_MIN = 8
LOSS_MAX = 0.5
"""Largest loss of a plant, as a share of full power."""
REST = ((0.0, 0.0),)
"""No power before the first reading: none in the dead time, and none in the lag."""
ANY = ((0.0, 0.0), (0.25, 0.25), (0.5, 0.5), (1.0, 0.25), (1.0, 0.5), (1.0, 1.0))
"""None, a power given for long, or full power for a while: what dead time and lag then hold."""
COUNTED = 30
"""Most readings that count where the past is open: no plant is exactly like this, and a loss that
grows would in time rule out the true one, `test_begun_in_the_middle_of_a_warm_up_it_waits_...`."""


@dataclass(frozen=True, slots=True)
class StepFit:
    """A plant as a rise shows it.

    Parameters
    ----------
    process : Process
        Its slope, dead time and lag; it integrates.
    total_s : float
        Dead time and lag together.
    longest : bool
        Whether the grid ends there: the true one may be longer.
    """

    process: Process
    total_s: float
    longest: bool


def step_fit(stretch: Stretch, pasts: tuple[tuple[float, float], ...] = REST) -> StepFit | None:
    """Return what fits best, None where nothing does.

    That is where power seems to warm nothing, or with fewer than 8 readings.

    Parameters
    ----------
    stretch : Stretch
        What was applied and read.
    pasts : tuple of (float, float)
        Powers that dead time and lag may hold at its beginning, as likely one as another.
    """
    readings_c = stretch.readings_c()
    read = np.isfinite(readings_c)
    if np.count_nonzero(read) < _READINGS_MIN:
        return None
    t_s = stretch.times_s()
    dead_s, lag_s = _grid(float(np.median(np.diff(t_s))))
    late_s = _late(t_s, stretch.given_s(), dead_s, lag_s)[1:][read]
    coming_s, kept_s = (each[1:][read] for each in _unseen(t_s, dead_s, lag_s))
    y = readings_c[read] - readings_c[read][0]
    each = [_regressed(t_s[1:][read], late_s + p * coming_s + h * kept_s, y) for p, h in pasts]
    slopes, left = np.array([slopes for slopes, _ in each]), np.array([left for _, left in each])
    least = float(left.min())
    if not math.isfinite(least):
        return None
    counted = len(y) if pasts == REST else min(len(y), COUNTED)
    weights = np.exp(-0.5 * counted * np.log(np.maximum(left, 1e-12) / max(least, 1e-12)))
    weights /= weights.sum()
    total_s = float((weights @ (dead_s + lag_s)).sum())
    lag = float((weights @ lag_s).sum())
    # the product of slope and total is what is seen
    slope = float((weights * slopes * (dead_s + lag_s)).sum()) / total_s
    if not slope > 0.0:
        return None
    on_edge = bool(weights[:, -len(_SHARES) :].sum() > 0.5)
    process = Process(slope, total_s - lag, (math.inf, lag))
    return StepFit(process, total_s, on_edge)


def _grid(interval_s: float) -> tuple[Array, Array]:
    """Return dead time and lag of all candidates, the shortest together first; shape (K,)."""
    shortest_s = max(_SHORTEST_S, interval_s)
    total_s = np.repeat(shortest_s * _RATIO ** np.arange(_TOTALS), len(_SHARES))
    share = np.tile(_SHARES, _TOTALS)
    return share * total_s, (1.0 - share) * total_s


def _late(t_s: Array, given_s: Array, dead_s: Array, lag_s: Array) -> Array:
    """Return the integral of power behind dead time and lag, shape (T, K).

    Between two samples the integral is a straight line, for which a lag has an exact answer.
    """
    delayed_s = np.interp(t_s[:, None] - dead_s, t_s, given_s)
    lengths_s = np.diff(t_s)[:, None]
    left = np.exp(-lengths_s / lag_s)
    rise_s = lag_s * np.diff(delayed_s, axis=0) / lengths_s
    late_s = np.empty_like(delayed_s)
    late_s[0] = delayed_s[0]
    for i in range(len(lengths_s)):
        lagging_s = late_s[i] - delayed_s[i] + rise_s[i]
        late_s[i + 1] = delayed_s[i + 1] - rise_s[i] + lagging_s * left[i]
    return late_s


def _unseen(t_s: Array, dead_s: Array, lag_s: Array) -> tuple[Array, Array]:
    """Return what full power before time 0 adds: of dead time, and of lag; shape (T, K) each."""
    kept_s = -lag_s * np.expm1(-t_s[:, None] / lag_s)
    in_s = np.minimum(t_s[:, None], dead_s)
    stays_s = -lag_s * np.expm1(-in_s / lag_s)
    return in_s - stays_s * np.exp(-(t_s[:, None] - in_s) / lag_s), kept_s


def _regressed(t_s: Array, late_s: Array, y: Array) -> tuple[Array, Array]:
    """Return the slope of each candidate and the mean square it leaves; inf where it cools.

    Where loss and slope cannot be told apart, the loss is no wild guess: at least none, at most
    `LOSS_MAX` of what full power gives. The squares are convex, so a loss beyond belongs on an end.
    """
    t_s, late_s, y = t_s - t_s.mean(), late_s - late_s.mean(axis=0), y - y.mean()
    along = late_s - np.outer(t_s, t_s @ late_s / (t_s @ t_s))
    power = np.einsum("tk,tk->k", along, along)
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = (y @ along) / power
        losses = (t_s @ late_s - (t_s @ y) / slopes) / (t_s @ t_s)
    heats = np.isfinite(losses) & (slopes > 0.0)
    heated_s = late_s - np.outer(t_s, np.clip(np.where(heats, losses, 0.0), 0.0, LOSS_MAX))
    power = np.einsum("tk,tk->k", heated_s, heated_s)
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = (y @ heated_s) / power
    left = np.mean((y[:, None] - heated_s * slopes) ** 2, axis=0)
    known = np.isfinite(slopes) & (slopes > 0.0)
    return np.where(known, slopes, 0.0), np.where(known, left, math.inf)
