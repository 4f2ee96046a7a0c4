"""Many replications of one estimator at once, for Monte Carlo studies.

The recursion of `thermoctl.estimation.recursion` with one more axis. Replications lie on the LAST
axis while it runs, so that every array operation is one pass over contiguous memory and the loops
that remain are over samples and parameters.

Implements section 2 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from thermoctl.estimation.belief import LARGEST, frozen, start
from thermoctl.estimation.recursion import ARRAYS, RecursiveLaw, drift
from thermoctl.quantities import Array
from thermoctl.signals import Estimate

SANE = 1e10
"""A run that stays within this rejected nothing, and need not be looked at sample by sample."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Trajectories of T samples in R replications; the arrays are read-only.

    Parameters
    ----------
    theta : ndarray, shape (T, R, n)
        Parameters after each sample.
    P : ndarray, shape (T, R, n, n)
        Covariance the next update starts from.
    innovation, inflation : ndarray, shape (T, R)
        As in `thermoctl.signals.Estimate`; a rejected sample repeats those before it.
    """

    theta: Array
    P: Array
    innovation: Array
    inflation: Array


class _State(NamedTuple):
    """One sample of every replication: (n, R), (n, n, R), (R,), (R,) and (R,)."""

    theta: Array
    P: Array
    innovation: Array
    inflation: Array
    usable: npt.NDArray[np.bool_] | None


def run_batch(
    law: RecursiveLaw,
    y: npt.ArrayLike,
    phi: npt.ArrayLike,
    P0: float | npt.ArrayLike = 1.0,
    theta0: npt.ArrayLike | None = None,
) -> Run:
    """Return what `law` makes of R replications of T samples.

    Equal to a loop of ``law.update`` over each replication, rejected samples included.

    Parameters
    ----------
    law : RecursiveLaw
        One of the four bare laws of this package.
    y : array_like, shape (T, R)
        Outputs.
    phi : array_like, shape (T, R, n)
        Regressors.
    P0, theta0
        As in `start`, common to all replications.

    Raises
    ------
    TypeError
        `law` is none of the bare laws (a guarded one keeps a memory of its own).
    ValueError
        `y`, `phi`, `P0` or `theta0` has another shape, or R1 does not fit.
    """
    if not isinstance(law, RecursiveLaw):
        raise TypeError(f"law must be a bare estimator, got {type(law).__name__}")
    y = np.asarray(y, dtype=np.float64)
    phi = np.asarray(phi, dtype=np.float64)
    if y.ndim != 2:
        raise ValueError(f"y must have shape (T, R), got {y.shape}")
    if phi.ndim != 3 or phi.shape[:2] != y.shape or phi.shape[2] < 1:
        raise ValueError(f"phi must have shape {(*y.shape, 'n')}, got {phi.shape}")
    belief = start(phi.shape[2], P0, theta0)
    columns = np.ascontiguousarray(np.moveaxis(phi, 1, 2))
    with np.errstate(all="ignore"):  # what overflows here is found in the result
        run = _run(law, y, columns, belief, careful=False)
        if not _sane(phi, run):
            run = _run(law, y, columns, belief, careful=True)
    return run


def _run(law: RecursiveLaw, y: Array, phi: Array, belief: Estimate, careful: bool) -> Run:
    """Run the recursion; `careful` looks at every sample and rejects what cannot be used."""
    (T, R), n = y.shape, phi.shape[1]
    theta, P = np.empty((T, n, R)), np.empty((T, n, n, R))
    innovation, inflation = np.empty((T, R)), np.empty((T, R))
    R1 = drift(law.R1, n)[:, :, None] if np.any(law.R1) else None
    state = _State(
        np.repeat(belief.theta[:, None], R, axis=1),
        np.repeat(belief.P[:, :, None], R, axis=2),
        np.full(R, belief.innovation),
        np.full(R, belief.inflation),
        None,
    )
    for t in range(T):
        new = _step(law, state, phi[t], y[t], R1, careful)
        state = new if new.usable is None else _kept(state, new, new.usable)
        theta[t], P[t] = state.theta, state.P
        innovation[t], inflation[t] = state.innovation, state.inflation
    return Run(
        frozen(np.moveaxis(theta, 1, 2)),
        frozen(np.moveaxis(P, 3, 1)),
        frozen(innovation),
        frozen(inflation),
    )


def _step(
    law: RecursiveLaw, state: _State, phi: Array, y: Array, R1: Array | None, careful: bool
) -> _State:
    """Return the state after one sample; `phi` has shape (n, R) and `y` (R,)."""
    n = len(phi)
    P_phi = _dot(state.P, phi)  # P is symmetric: its rows are its columns
    e = y - _dot(state.theta, phi)
    S, inflation = law.weigh(np.maximum(_dot(P_phi, phi), 0.0), e, n, ARRAYS)
    root = np.sqrt(S)
    g = P_phi / root
    theta = state.theta + g * (e / root)  # O21 (18), (19)
    P = (state.P - g[:, None] * g) * inflation  # O21 (21), (25), (13)
    if R1 is not None:
        P += R1  # O21 (20)
    usable = None
    if careful:
        size = (P * P).sum(axis=(0, 1)) + (theta * theta).sum(axis=0)
        usable = np.abs(phi).sum(axis=0) < LARGEST
        usable &= (e * e < LARGEST * S) & (size < LARGEST * LARGEST)
    return _State(theta, P, e, np.broadcast_to(inflation, e.shape), usable)


def _dot(a: Array, b: Array) -> Array:
    """Return the sum of ``a[j] * b[j]`` over j, the few rows of `b`."""
    total: Array = a[0] * b[0]
    for j in range(1, len(b)):
        total = total + a[j] * b[j]
    return total


def _kept(old: _State, new: _State, usable: npt.NDArray[np.bool_]) -> _State:
    """Return `new` where its samples are usable and `old` elsewhere."""
    return _State(
        np.where(usable, new.theta, old.theta),
        np.where(usable, new.P, old.P),
        np.where(usable, new.innovation, old.innovation),
        np.where(usable, new.inflation, old.inflation),
        None,
    )


def _sane(phi: Array, run: Run) -> bool:
    """Return whether everything is far from what `update` rejects; false for NaN."""
    return all(
        values.size == 0 or (values.max() < SANE and values.min() > -SANE)
        for values in (phi, run.innovation, run.theta, run.P)
    )
