"""What keeps a recursive estimator sane for years: a wrapper of any law.

Implements section 4 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from thermoctl.estimation.belief import LARGEST, positive, scalar, truth
from thermoctl.estimation.kalman import CorrectedKalman, RandomWalkKalman
from thermoctl.estimation.least_squares import RecursiveLeastSquares
from thermoctl.estimation.recursion import RecursiveLaw, regressor
from thermoctl.estimation.stack import Stacked, stack, stacked_one
from thermoctl.filling import quickly_filled
from thermoctl.quantities import Array, clamp, frozen
from thermoctl.signals import Estimate

EXCITATION_MEMORY = 50
"""Samples over which the spread of the regressor is taken."""
RESIDUALS = 60
"""Innovations of the parallel least squares of which the median is taken."""
RESIDUALS_MIN = 5
"""Fewer innovations than this say nothing; the law's own R2 holds until then."""
R2_FLOOR = 1e-6
"""Least robust R2, as a share of the law's own: constant readings must not make it zero."""
PARALLEL = RecursiveLeastSquares(forgetting=0.95)
NORMAL_SD = 1.4826
"""Standard deviation of a normal variable over the median of its magnitude."""
_WITH_R2 = (CorrectedKalman, RandomWalkKalman)


_Parallel = Array | tuple[float, float]
"""Theta and P of the parallel least squares: a stack; of one parameter plain numbers."""


class _Memory(NamedTuple):
    """What the guards remember: spread of the regressor, parallel least squares, residuals.

    The residuals are there twice, newest first and by size; nobody writes to either.
    """

    phi_mean: tuple[float, ...]
    spread_squared: float
    parallel: _Parallel
    residuals: tuple[float, ...] = ()
    ranked: Sequence[float] = ()


@quickly_filled
@dataclass(frozen=True, slots=True, eq=False)
class GuardedEstimate(Stacked):
    """An estimate with what its guards remember.

    Parameters
    ----------
    excitation : float
        Root mean square distance of recent regressors from their mean, in the units of phi; NaN
        without an `excitation_min`, for which alone it is reckoned.
    R2 : float
        Noise variance the last update used; NaN where the law has none.
    """

    excitation: float = math.nan
    R2: float = math.nan
    _memory: _Memory | None = field(default=None, repr=False)


@dataclass(frozen=True, slots=True, eq=False)
class Guarded:
    r"""A bare law with guards against a life without excitation and a wrong R2.

    Each guard is off unless asked for; without any, theta and P are those of the bare law.

    Parameters
    ----------
    law : RecursiveLaw
        One of the four bare laws.
    covariance_max : float, optional
        Largest variance a parameter may have. ``P <- D P D`` with
        ``d_i = min(1, sqrt(covariance_max / P_ii))`` keeps P positive definite and its
        correlations; about P0 is a good choice.
    excitation_min : float, optional
        Nothing is learned, and P stays, while the regressor has moved less than this (root mean
        square about its running mean over some 50 samples, in the units of phi); about
        ``3 sqrt(n)`` times the noise. A constant regressor then teaches nothing: leave it off for
        the structure of O21 (27), whose learning of a at rest is its integral action.
    robust_R2 : bool
        Take R2 from parallel least squares with forgetting .95: ``(1.4826 median |e|)^2`` over its
        last 60 innovations. For the two Kalman filters.
    R2_min : float, optional
        Least R2 that `robust_R2` may find. Where the model is known to be too simple, as that of
        O21 (27) is for a plant with lag, what it cannot explain is not noise: with the law's own
        R2 here the estimate can only make the law more patient.

    Raises
    ------
    TypeError
        `law` is none of the bare laws.
    ValueError
        A limit is not positive, `robust_R2` no bool, or asked of a law without R2.
    """

    law: RecursiveLaw
    covariance_max: float | None = None
    excitation_min: float | None = None
    robust_R2: bool = False  # noqa: N815 - R2 keeps its letter
    R2_min: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.law, RecursiveLaw):
            raise TypeError(f"law must be a bare estimator, got {type(self.law).__name__}")
        if self.covariance_max is not None:
            positive("covariance_max", self.covariance_max)
        if self.excitation_min is not None:
            positive("excitation_min", self.excitation_min)
        if self.R2_min is not None:
            positive("R2_min", self.R2_min)
        truth("robust_R2", self.robust_R2)
        if self.robust_R2 and not isinstance(self.law, _WITH_R2):
            raise ValueError(f"robust_R2 needs a law with R2, got {type(self.law).__name__}")

    def update(self, belief: Estimate, phi: Array, y: float) -> GuardedEstimate:
        """Return the belief after regressor `phi`, shape (n,), met output `y`.

        `belief` may come from `start`; the memory of the guards then begins here. A sample that
        teaches nothing for want of excitation is ``rejected``, with its innovation given.

        Raises
        ------
        TypeError, ValueError
            As the bare law.
        """
        phi, y = regressor(phi), scalar("y", y)
        before = belief if isinstance(belief, GuardedEstimate) else _adopted(belief)
        law, known = self._law(before._memory), stack(before)
        learned = law.learn(known, phi, y)
        if learned is None:
            return replace(before, rejected=True)
        memory = self._remembered(before._memory, known, phi, y)
        least = self.excitation_min
        excitation = math.nan if least is None else math.sqrt(memory.spread_squared)
        R2 = getattr(law, "R2", math.nan)
        rows, e, S, inflation = learned
        paused = least is not None and excitation < least
        if paused:
            theta, P, stacked, inflation = before.theta, before.P, before.rows, 1.0
        else:
            stacked = self._bounded(rows)
            theta, P = stacked[0], stacked[1:]
        return GuardedEstimate(theta, P, e, S, inflation, paused, stacked, excitation, R2, memory)

    def _bounded(self, rows: Array) -> Array:
        """Return `rows` with no variance above `covariance_max` and the correlations kept."""
        most = self.covariance_max
        if most is None:
            return rows
        if rows.size == 2:  # one parameter, as in most models
            return rows if rows.item(1) <= most else stacked_one(rows.item(0), most)
        variances = rows[1:].diagonal()
        if max(variances.tolist()) <= most:
            return rows
        bounded = rows.copy()
        d = np.sqrt(most / np.maximum(variances, most))
        bounded[1:] *= np.multiply.outer(d, d)
        return frozen(bounded)

    def _law(self, memory: _Memory | None) -> RecursiveLaw:
        """Return the law with the R2 of the moment."""
        law = self.law
        if not self.robust_R2 or memory is None or len(memory.ranked) < RESIDUALS_MIN:
            return law
        assert isinstance(law, _WITH_R2)
        sd = NORMAL_SD * memory.ranked[len(memory.ranked) // 2]
        least = R2_FLOOR * law.R2 if self.R2_min is None else self.R2_min
        R2 = sd * sd
        R2 = least if least > R2 else R2
        return law if R2 == law.R2 else replace(law, R2=clamp(R2, 1.0 / LARGEST, LARGEST))

    def _remembered(self, memory: _Memory | None, rows: Array, phi: Array, y: float) -> _Memory:
        """Return the memory after a usable sample; it begins with the stack `rows`."""
        if memory is None:
            memory = _Memory(tuple(phi.tolist()), 0.0, self._parallel(rows))
        phi_mean, spread_squared = memory.phi_mean, memory.spread_squared
        if self.excitation_min is not None:
            phi_mean, spread_squared = _moved(memory, phi.tolist())
        if not self.robust_R2:
            return _Memory(phi_mean, spread_squared, memory.parallel)
        parallel, newest = _learned(memory.parallel, phi, y)
        residuals, ranked = _renewed(memory.residuals, memory.ranked, newest)
        return _Memory(phi_mean, spread_squared, parallel, residuals, ranked)

    def _parallel(self, rows: Array) -> _Parallel:
        """Return the least squares that begin with the stack `rows`."""
        parallel = rows.copy()
        parallel[1:] /= getattr(self.law, "R2", 1.0)  # least squares counts in units of noise
        if parallel.size == 2:
            return parallel.item(0), parallel.item(1)
        return frozen(parallel)


def _learned(parallel: _Parallel, phi: Array, y: float) -> tuple[_Parallel, float | None]:
    """Return the least squares after a sample, and how far off it was; None: nobody knows."""
    if isinstance(parallel, tuple):
        one = PARALLEL.learn_one(*parallel, phi.item(), y)
        return (parallel, None) if one is None else (one[:2], abs(one[2]))
    learned = PARALLEL.learn(parallel, phi, y)
    return (parallel, None) if learned is None else (learned[0], abs(learned[1]))


def _adopted(belief: Estimate) -> GuardedEstimate:
    """Return a bare belief as one whose guards remember nothing yet."""
    if not isinstance(belief, Estimate):
        raise TypeError(f"belief must be an Estimate, got {type(belief).__name__}")
    return GuardedEstimate(
        belief.theta,
        belief.P,
        belief.innovation,
        belief.innovation_var,
        belief.inflation,
        belief.rejected,
    )


def _moved(memory: _Memory, phi: list[float]) -> tuple[tuple[float, ...], float]:
    """Return mean and spread after `phi`; a few plain numbers, quicker than in arrays."""
    share = 1.0 / EXCITATION_MEMORY
    mean, squared = [], 0.0
    for value, before in zip(phi, memory.phi_mean, strict=True):
        step = value - before
        mean.append(before + share * step)
        squared += step * step
    return tuple(mean), (1.0 - share) * (memory.spread_squared + share * squared)


def _renewed(
    residuals: tuple[float, ...], ranked: Sequence[float], newest: float | None
) -> tuple[tuple[float, ...], Sequence[float]]:
    """Return the residuals with `newest`, if there is one, and without what is too old."""
    ranked = list(ranked)
    for oldest in residuals[RESIDUALS - 1 :]:
        del ranked[bisect_left(ranked, oldest)]
    residuals = residuals[: RESIDUALS - 1]
    if newest is not None:
        insort(ranked, newest)
        residuals = (newest, *residuals)
    return residuals, ranked
