"""Many replications of one estimator at once, for Monte Carlo studies.

The recursion of `thermoctl.estimation.recursion` with one more axis. Replications lie on the LAST
axis while it runs, so that every array operation is one pass over contiguous memory and the loops
that remain are over samples and parameters.

Implements section 2 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from thermoctl.estimation.belief import LARGEST, floats, frozen, start
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
        `y`, `phi`, `P0` or `theta0` does not consist of numbers or has another shape, or R1 does
        not fit.
    """
    if not isinstance(law, RecursiveLaw):
        raise TypeError(f"law must be a bare estimator, got {type(law).__name__}")
    y, phi = floats("y", y), floats("phi", phi)
    if y.ndim != 2:
        raise ValueError(f"y must have shape (T, R), got {y.shape}")
    if phi.ndim != 3 or phi.shape[:2] != y.shape or phi.shape[2] < 1:
        raise ValueError(f"phi must have shape ({y.shape[0]}, {y.shape[1]}, n), got {phi.shape}")
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
    # One block for everything: numpy asks for huge pages from 4 MB on, and page faults would
    # otherwise cost as much as the arithmetic (benchmarks/estimators.py: 13 and 8 ms).
    block = np.empty((T, n + n * n + 2, R))
    theta, P = block[:, :n], block[:, n:-2].reshape(T, n, n, R)
    innovation, inflation = block[:, -2], block[:, -1]
    R1 = drift(law.R1, n)[:, :, None] if np.any(law.R1) else None
    before: tuple[Array, ...] = (
        np.repeat(belief.theta[:, None], R, axis=1),
        np.repeat(belief.P[:, :, None], R, axis=2),
        np.full(R, belief.innovation),
        np.full(R, belief.inflation),
    )
    for t in range(T):
        after = (theta[t], P[t], innovation[t], inflation[t])
        S = advance(law, before[0], before[1], phi[t], y[t], R1, after)
        if careful:
            unusable = ~usable(phi[t], S, *after[:3])
            for new, old in zip(after, before, strict=True):
                np.copyto(new, old, where=unusable)
        before = after
    return Run(
        frozen(np.moveaxis(theta, 1, 2)),
        frozen(np.moveaxis(P, 3, 1)),
        frozen(innovation),
        frozen(inflation),
    )


def advance(
    law: RecursiveLaw,
    theta: Array,
    P: Array,
    phi: Array,
    y: Array,
    R1: Array | None,
    after: tuple[Array, Array, Array, Array],
) -> Array:
    """Write what each replication believes after a sample into `after`, and return S.

    `after` is theta, P, e and the inflation. `theta` and `phi` have shape (n, R), P has (n, n, R)
    and `y`, e, S and the inflation have (R,).
    """
    new_theta, new_P, e, inflation = after
    P_phi = _dot(P, phi)  # P is symmetric: its rows are its columns
    np.subtract(y, _dot(theta, phi), out=e)
    S, inflation[:] = law.weigh(np.maximum(_dot(P_phi, phi), 0.0), e, len(phi), ARRAYS)
    root = np.sqrt(S)
    g = P_phi / root
    np.add(theta, g * (e / root), out=new_theta)  # O21 (18), (19)
    np.subtract(P, g[:, None] * g, out=new_P)  # O21 (21)
    new_P *= inflation  # O21 (25), or (13) with 1/lambda
    if R1 is not None:
        new_P += R1  # O21 (20)
    return S


def usable(phi: Array, S: Array, theta: Array, P: Array, e: Array) -> npt.NDArray[np.bool_]:
    """Return where a law would take the sample, shape (R,); false for NaN."""
    size = (P * P).sum(axis=(0, 1)) + (theta * theta).sum(axis=0)
    usable: npt.NDArray[np.bool_] = np.abs(phi).sum(axis=0) < LARGEST
    usable &= (e * e < LARGEST * S) & np.isfinite(S) & (size < LARGEST * LARGEST)
    return usable


def _dot(a: Array, b: Array) -> Array:
    """Return the sum of ``a[j] * b[j]`` over j, the few rows of `b`."""
    total: Array = a[0] * b[0]
    for j in range(1, len(b)):
        total = total + a[j] * b[j]
    return total


def _sane(phi: Array, run: Run) -> bool:
    """Return whether everything is far from what `update` rejects; false for NaN."""
    return all(
        values.size == 0 or (values.max() < SANE and values.min() > -SANE)
        for values in (phi, run.innovation, run.theta, run.P)
    )
