r"""What the simulation study of O21 compares, and the process it compares on.

.. math:: y(t) = a(t)\, y(t-1) + v(t), \qquad v(t) \sim N(0, 1)

with a = -0.9, from t = 101 on 0.9, and from t = 201 to 400 again -0.9.

Implements section 2 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from thermoctl.estimation import (
    CorrectedKalman,
    RandomWalkKalman,
    RecursiveLeastSquares,
    VariableForgetting,
)
from thermoctl.estimation.recursion import RecursiveLaw
from thermoctl.quantities import Array

JUMPS: Final = (100, 200)
"""Last samples before a jump."""

SAMPLES: Final = 400
POLE: Final = np.repeat((-0.9, 0.9, -0.9), np.diff((0, *JUMPS, SAMPLES)))
"""a(t) at t = 1 to 400."""

FIRST_OUTPUT: Final = 10.0
P0: Final = 1.0


@dataclass(frozen=True, slots=True)
class Method:
    """An estimator of the study.

    Parameters
    ----------
    name : str
        As it stands in the table.
    title : str
        As it stands over its figures.
    law : RecursiveLaw
        Estimator, with R1 = 0 and R2 = 1 where it has them.
    figures : tuple of int, optional
        Numbers of its figures in the paper: estimate, P and residuals.
    """

    name: str
    title: str
    law: RecursiveLaw
    figures: tuple[int, int, int] | None = None


METHODS: Final = (
    Method("RLS 1", "Recursive least squares, λ = 1", RecursiveLeastSquares(1.0), (1, 2, 3)),
    Method("RLS 0.99", "Recursive least squares, λ = 0.99", RecursiveLeastSquares(0.99), (4, 5, 6)),
    Method("RLS 0.9", "Recursive least squares, λ = 0.9", RecursiveLeastSquares(0.9), (7, 8, 9)),
    Method("RLS 0.8", "Recursive least squares, λ = 0.8", RecursiveLeastSquares(0.8), (10, 11, 12)),
    Method(
        "variable forgetting, Sigma0 10", "Variable forgetting, Σ0 = 10", VariableForgetting(10.0)
    ),
    Method("NKF", "Normal Kalman filter", RandomWalkKalman(R1=0.0, R2=1.0), (14, 15, 17)),
    Method("CKF", "Corrected Kalman filter", CorrectedKalman(R1=0.0, R2=1.0), (13, 16, 18)),
)
"""Rows of the table, in this order."""


def outputs(noise: Sequence[Array]) -> Array:
    """Return y(0) to y(400), shape (401, R), from v(1) to v(400) of R replications."""
    v = np.stack(noise, axis=1)
    y = np.empty((SAMPLES + 1, v.shape[1]))
    y[0] = FIRST_OUTPUT
    for t in range(SAMPLES):
        y[t + 1] = POLE[t] * y[t] + v[t]  # O21 (24)
    return y
