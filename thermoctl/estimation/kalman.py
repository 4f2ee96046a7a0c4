"""Kalman filters for parameters that wander: normal and corrected.

Implements section 2 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from thermoctl.estimation.belief import positive
from thermoctl.estimation.recursion import Arithmetic, RecursiveLaw, V, checked_drift
from thermoctl.quantities import Array, is_finite_number


@dataclass(frozen=True, slots=True, eq=False)
class RandomWalkKalman(RecursiveLaw):
    r"""The normal Kalman filter of the parameters, O21 (15)-(21).

    .. math:: \theta_{t+1} = \theta_t + w_t, \qquad y_t = \varphi_t^T \theta_t + v_t

    Parameters
    ----------
    R1 : float or ndarray, shape (n, n)
        Covariance of the drift w per sample; a float stands for ``R1 * I``.
    R2 : float
        Variance of the noise v, in the square of the unit of y; greater than zero.

    Raises
    ------
    ValueError
        `R1` is no covariance or `R2` not positive.
    """

    R1: float | Array = 0.0
    R2: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "R1", checked_drift(self.R1))
        positive("R2", self.R2)

    def weigh(self, q: V, e: V, n: int, arithmetic: Arithmetic[V]) -> tuple[V, V | float]:
        """Return ``q + R2`` and 1."""
        return q + self.R2, 1.0  # O21 (19)


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedKalman(RecursiveLaw):
    r"""The Kalman filter that inflates P on large innovations, O21 (25)-(26).

    The ratio (26) is the normalised innovation squared over ``n + 1``:

    .. math:: \lambda^* = \max\bigl(1,\ e^2 / (S\,(n + 1))\bigr)

    theta is updated with the uncorrected gain; P is corrected for the next sample.

    Parameters
    ----------
    R1 : float or ndarray, shape (n, n)
        Covariance of the parameters' drift per sample; a float stands for ``R1 * I``.
    R2 : float
        Variance of the noise, in the square of the unit of y; greater than zero.
    inflation_max : float
        Largest inflation of one sample, at least 1; infinite by default.

    Raises
    ------
    ValueError
        `R1` is no covariance, `R2` not positive or `inflation_max` below 1.
    """

    R1: float | Array = 0.0
    R2: float = 1.0
    inflation_max: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "R1", checked_drift(self.R1))
        positive("R2", self.R2)
        limit = self.inflation_max
        unlimited = isinstance(limit, float) and limit == math.inf
        if not unlimited and not (is_finite_number(limit) and limit >= 1.0):
            raise ValueError(f"inflation_max must be at least 1, got {self.inflation_max!r}")

    def weigh(self, q: V, e: V, n: int, arithmetic: Arithmetic[V]) -> tuple[V, V | float]:
        """Return ``q + R2`` and lambda*."""
        S = q + self.R2
        inflation = arithmetic.maximum(1.0, e * e / (S * (n + 1)))  # O21 (26)
        if self.inflation_max < math.inf:
            inflation = arithmetic.minimum(self.inflation_max, inflation)
        return S, inflation
