"""Stationary filters and regulators of a linear plant, in numpy alone.

Both equations are solved by doubling: every step squares the horizon, so that twenty of them look
a million samples ahead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from thermoctl.quantities import Array

_DOUBLINGS = 60
_CLOSE = 1e-12


def riccati(A: Array, B: Array, Q: Array, R: Array) -> Array:
    r"""Return the stabilising solution of the discrete algebraic Riccati equation.

    .. math:: X = A^T X A - A^T X B (R + B^T X B)^{-1} B^T X A + Q

    With (A', C', Q, R) for (A, B, Q, R) it is the covariance of a stationary Kalman filter before
    a measurement.

    Parameters
    ----------
    A : ndarray, shape (n, n)
        Transition over one sample.
    B : ndarray, shape (n, m)
        What acts on it.
    Q : ndarray, shape (n, n)
        Price of the state, symmetric and positive semidefinite.
    R : ndarray, shape (m, m)
        Price of the input, symmetric and positive definite.

    Raises
    ------
    ValueError
        When there is no such solution: something that matters is neither stable nor reached.
    """
    n = len(A)
    H, G, step = Q, B @ np.linalg.solve(R, B.T), A
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(_DOUBLINGS):
            W = np.linalg.inv(np.eye(n) + G @ H)
            grown = step.T @ H @ W @ step
            G = _symmetric(G + step @ W @ G @ step.T)
            step = step @ W @ step
            H = _symmetric(H + grown)
            if not np.all(np.isfinite(H)):
                break
            if np.abs(grown).max() <= _CLOSE * np.abs(H).max():
                return H
    raise ValueError("expected a plant that can be stabilised, found no stationary solution")


def lyapunov(A: Array, Q: Array) -> Array:
    """Return the covariance X = A X A' + Q of a stable plant in noise `Q`.

    Raises
    ------
    ValueError
        When `A` is not stable, so that the covariance grows without end.
    """
    X, step = Q, A
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(_DOUBLINGS):
            grown = step @ X @ step.T
            X, step = _symmetric(X + grown), step @ step
            if not np.all(np.isfinite(X)):
                break
            if np.abs(grown).max() <= _CLOSE * np.abs(X).max():
                return X
    raise ValueError("expected a stable transition, the covariance has no end")


def _symmetric(X: Array) -> Array:
    """Return the symmetric part, which is all that rounding leaves standing."""
    half: Array = 0.5 * (X + X.T)
    return half


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """A linear plant with one input, one measured and one judged output.

    Parameters
    ----------
    A, B, Q : ndarray, shapes (n, n), (n, 1), (n, n)
        Transition over one sample, input, covariance of the noise that enters meanwhile.
    C, R : ndarray, shape (1, n); float
        What is measured, and the variance of its noise.
    z : ndarray, shape (1, n)
        What is judged.
    """

    A: Array
    B: Array
    Q: Array
    C: Array
    R: float
    z: Array


@dataclass(frozen=True, slots=True)
class Spread:
    """Standard deviations in regulation: of what is judged, and of the input."""

    judged: float
    input: float


def regulated(plant: Linear, price: float) -> Spread:
    """Return how far `plant` strays under the best law that knows it.

    The law is linear quadratic with the state from a Kalman filter: it minimises the variance of
    what is judged plus `price` times that of the input. Each input follows the measurement taken
    at the same instant; `price` tending to zero is minimum variance.

    Parameters
    ----------
    plant : Linear
        The plant.
    price : float
        Positive, in units judged squared per unit of input squared.

    Raises
    ------
    ValueError
        When the plant cannot be stabilised, or not be seen.
    """
    A, B, C = plant.A, plant.B, plant.C
    before = riccati(A.T, C.T, plant.Q, np.array([[plant.R]]))
    S = C @ before @ C.T + plant.R
    K = before @ C.T / S
    after = before - K @ C @ before
    ahead = riccati(A, B, plant.z.T @ plant.z, np.array([[price]]))
    L = np.linalg.solve(price + B.T @ ahead @ B, B.T @ ahead @ A)
    # What the filter believes moves by its innovations alone, whose covariance is S.
    believed = lyapunov(A - B @ L, K @ S @ K.T)
    judged = float((plant.z @ (believed + after) @ plant.z.T).item())
    return Spread(math.sqrt(judged), math.sqrt(float((L @ believed @ L.T).item())))
