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

from thermoctl.estimation.batch_one import run_one
from thermoctl.estimation.belief import LARGEST, floats, sane, start
from thermoctl.estimation.kalman import CorrectedKalman
from thermoctl.estimation.recursion import ARRAYS, RecursiveLaw, drift
from thermoctl.estimation.stack import stack
from thermoctl.quantities import Array, frozen
from thermoctl.signals import Estimate


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
        block, well = _run(law, y, columns, belief, careful=False)
        if not well:
            block, _ = _run(law, y, columns, belief, careful=True)
    return _unpacked(block, phi.shape[2])


def _run(
    law: RecursiveLaw, y: Array, phi: Array, belief: Estimate, careful: bool
) -> tuple[Array, bool]:
    """Return what `_unpacked` takes apart, and whether that is what the law would have made of it.

    `careful` looks at every sample and may reject it; without, the run ends where that is needed.
    """
    (T, R), n = y.shape, phi.shape[1]
    # One block for everything: numpy asks for huge pages from 4 MB on, and page faults would
    # otherwise cost as much as the arithmetic (benchmarks/estimators.py: 13 and 8 ms).
    block = np.empty((T, (n + 1) * n + 2, R))
    if not careful and n == 1 and isinstance(law, CorrectedKalman) and not np.any(law.R1):
        return block, run_one(law, y, phi[:, 0], belief, block)
    if not (careful or sane(phi)):
        return block, False
    rows, innovation, inflation = _rows(block, n), block[:, -2], block[:, -1]
    R1 = drift(law.R1, n)[:, :, None] if np.any(law.R1) else None
    before: tuple[Array, ...] = (
        np.repeat(stack(belief)[:, :, None], R, axis=2),
        np.full(R, belief.innovation),
        np.full(R, belief.inflation),
    )
    for t in range(T):
        after = (rows[t], innovation[t], inflation[t])
        S = advance(law, before[0], phi[t], y[t], R1, after)
        if careful:
            unusable = ~usable(phi[t], S, *after[:2])
            for new, old in zip(after, before, strict=True):
                np.copyto(new, old, where=unusable)
        elif not sane(block[t]):
            return block, False
        before = after
    return block, True


def _rows(block: Array, n: int) -> Array:
    """Return theta on top of P after each sample, shape (T, n + 1, n, R)."""
    T, _, R = block.shape
    return block[:, :-2].reshape(T, n + 1, n, R)


def _unpacked(block: Array, n: int) -> Run:
    """Return the trajectories that lie in `block`, replications second."""
    rows = _rows(block, n)
    return Run(
        frozen(np.moveaxis(rows[:, 0], 1, 2)),
        frozen(np.moveaxis(rows[:, 1:], 3, 1)),
        frozen(block[:, -2]),
        frozen(block[:, -1]),
    )


def advance(
    law: RecursiveLaw,
    rows: Array,
    phi: Array,
    y: Array,
    R1: Array | None,
    after: tuple[Array, Array, Array],
) -> Array:
    """Write what each replication believes after a sample into `after`, and return S.

    `after` is the new rows, e and the inflation, none of it an array that is read. Rows, theta on
    top of P as in `thermoctl.estimation.stack`, have shape (n + 1, n, R), `phi` has (n, R), `R1`
    (n, n, 1), and `y`, e, S and the inflation have (R,).
    """
    new_rows, e, inflation = after
    w = _dot(rows.swapaxes(0, 1), phi)
    np.subtract(y, w[0], out=e)
    q = _dot(w[1:], phi)
    S, inflation[:] = law.weigh(np.maximum(q, 0.0, out=q), e, len(phi), ARRAYS)
    np.negative(e, out=w[0])
    w /= np.sqrt(S)
    np.multiply(w[:, None], w[1:], out=new_rows)
    np.subtract(rows, new_rows, out=new_rows)  # O21 (18), (19), (21)
    P = new_rows[1:]
    P *= inflation  # O21 (25), or (13) with 1/lambda
    if R1 is not None:
        P += R1  # O21 (20)
    return S


def usable(phi: Array, S: Array, rows: Array, e: Array) -> npt.NDArray[np.bool_]:
    """Return where a law would take the sample, shape (R,); false for NaN."""
    usable: npt.NDArray[np.bool_] = np.abs(phi).sum(axis=0) < LARGEST
    usable &= (e * e < LARGEST * S) & np.isfinite(S)
    usable &= (rows * rows).sum(axis=(0, 1)) < LARGEST * LARGEST
    return usable


def _dot(a: Array, b: Array) -> Array:
    """Return the sum of ``a[j] * b[j]`` over j, the few rows of `b`."""
    total: Array = a[0] * b[0]
    for j in range(1, len(b)):
        total = total + a[j] * b[j]
    return total
