"""Many replications of a filter with one parameter that does not drift.

That is the study of O21. With one parameter and R1 = 0 the information ``i = R2/P`` is a number
that only gains, and P need not be divided at every turn. That leaves eleven array operations to a
sample, half of what `thermoctl.estimation.batch.advance` takes for any number of parameters.

Implements section 2 of ``docs/theory.md``.
"""

from __future__ import annotations

import numpy as np

from thermoctl.estimation.belief import sane
from thermoctl.estimation.kalman import CorrectedKalman
from thermoctl.quantities import Array
from thermoctl.signals import Estimate

STRIDE = 8
"""Samples that are looked at together while they are still in the cache."""


def run_one(law: CorrectedKalman, y: Array, phi: Array, belief: Estimate, block: Array) -> bool:
    """Fill `block` with theta, P, e and inflation; return whether all is sane.

    Parameters
    ----------
    law : CorrectedKalman
        One whose R1 is 0.
    y, phi : ndarray, shape (T, R)
        Outputs and regressors.
    belief : Estimate
        What is believed of the one parameter before the first sample.
    block : ndarray, shape (T, 4, R)
        Is written to. What it holds where the answer is no has no meaning.
    """
    T, R = y.shape
    theta = np.full(R, belief.theta[0])
    before = law.R2 / np.full(R, belief.P[0, 0])
    information = np.empty((STRIDE, R))
    for first in range(0, T, STRIDE):
        part = slice(first, first + STRIDE)
        rows = block[part]
        after = information[: len(rows)]
        theta, before = _stride(law, y[part], phi[part], (theta, before), rows, after)
        np.divide(law.R2, after, out=rows[:, 1])
        if not (sane(rows) and sane(phi[part])):
            return False
    return True


def _stride(
    law: CorrectedKalman,
    y: Array,
    phi: Array,
    start: tuple[Array, Array],
    rows: Array,
    information: Array,
) -> tuple[Array, Array]:
    """Fill all of `rows` but P, and `information`; return the last theta and information."""
    theta, before = start
    now, gain, ratio = np.empty((3, *theta.shape))
    one, half = np.array(1.0), np.array(0.5 / law.R2)  # a float is made an array at every turn
    thetas, innovations, inflations = (rows[:, column] for column in (0, 2, 3))
    turns = zip(y, phi, np.square(phi), thetas, innovations, inflations, information, strict=True)
    for y_t, h, square, new_theta, e, inflation, after in turns:
        np.multiply(h, theta, e)
        np.subtract(y_t, e, e)
        np.add(before, square, now)  # so that S = R2 now/before
        np.divide(e, now, gain)
        np.multiply(gain, e, ratio)
        ratio *= before
        ratio *= half
        np.maximum(one, ratio, out=inflation)  # O21 (26), where n + 1 = 2
        if law.inflation_max < np.inf:
            np.minimum(law.inflation_max, inflation, out=inflation)
        gain *= h
        np.add(theta, gain, new_theta)  # O21 (18), (19)
        np.divide(now, inflation, after)  # O21 (21), (25)
        theta, before = new_theta, after
    return theta, before
