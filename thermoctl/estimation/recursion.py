r"""The recursion every estimator of this room runs, for one sample of one loop.

All of them are the same Kalman update and differ in two numbers, which a law computes in `weigh`:
the variance :math:`S` it expected of the innovation, and the factor :math:`\lambda` by which the
covariance is inflated afterwards.

.. math::

    \theta \leftarrow \theta + P\varphi\, e / S, \qquad
    P \leftarrow \lambda\,(P - P\varphi\varphi^T P / S) + R_1

The letters of `RecursiveLaw.learn`: `rows` are theta and P (`thermoctl.estimation.stack`), `w`
their product with phi, which begins with the prediction and goes on with P phi.

Implements section 2 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Generic, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from thermoctl.estimation.belief import LARGEST, covariance, floats, numbers, scalar, shown
from thermoctl.estimation.stack import Learned, LearnedOne, stack, stacked_one, unstacked
from thermoctl.quantities import Array, frozen, is_finite_number
from thermoctl.signals import Estimate

V = TypeVar("V", float, Array)
"""A number of one loop, or one for each replication."""


_FLOAT = np.dtype(np.float64)


class Arithmetic(NamedTuple, Generic[V]):
    """The larger and the smaller of two, for numbers or for arrays."""

    maximum: Callable[[float, V], V]
    minimum: Callable[[float, V], V]


NUMBERS: Arithmetic[float] = Arithmetic(max, min)
ARRAYS: Arithmetic[Array] = Arithmetic(np.maximum, np.minimum)


class RecursiveLaw(ABC):
    """A law that learns theta of ``y = phi' theta + v`` from one sample at a time."""

    __slots__ = ()

    @property
    @abstractmethod
    def R1(self) -> float | Array:  # noqa: N802 - R1 keeps its letter
        """Drift covariance added after every sample; 0 for least squares."""

    @abstractmethod
    def weigh(self, q: V, e: V, n: int, arithmetic: Arithmetic[V]) -> tuple[V, V | float]:
        """Return S, the variance expected of innovation `e`, and the inflation of P.

        `q` is ``phi' P phi`` and `n` the number of parameters.
        """

    def update(self, belief: Estimate, phi: Array, y: float) -> Estimate:
        """Return the belief after regressor `phi` met output `y`.

        Parameters
        ----------
        belief : Estimate
            What was believed before; it is not changed.
        phi : ndarray, shape (n,)
            Regressor, in the units the parameters are to have.
        y : float
            Output.

        Returns
        -------
        Estimate
            The new belief. Where `phi` or `y` is not finite, or the result would not be, the old
            one with ``rejected=True``.

        Raises
        ------
        TypeError
            `belief` is no `Estimate`.
        ValueError
            `phi` or `y` does not consist of numbers; `phi` does not have the shape of
            ``belief.theta``, or R1 that of ``belief.P``.
        """
        phi = regressor(phi)
        if not isinstance(belief, Estimate):
            raise TypeError(f"belief must be an Estimate, got {type(belief).__name__}")
        learned = self.learn(stack(belief), phi, scalar("y", y))
        return rejected(belief) if learned is None else unstacked(learned)

    def learn(self, rows: Array, phi: Array, y: float) -> Learned | None:
        """Return what the stack `rows` becomes; None for a sample that cannot be used.

        It is `update` for who keeps theta and P alone, and has made sure of `phi` and `y`.

        Raises
        ------
        ValueError
            `phi` does not have the shape of theta, or R1 that of P.
        """
        if phi.shape != rows.shape[1:]:
            raise ValueError(f"phi must have shape {rows.shape[1:]}, got {phi.shape}")
        if phi.shape == (1,):
            one = self.learn_one(rows.item(0), rows.item(1), phi.item(), y)
            if one is None:
                return None
            theta, variance, e, S, inflation = one
            return stacked_one(theta, variance), e, S, inflation
        # Plain floats add up without a warning; the comparison is false for NaN. Once phi, and
        # below e, are known to be sane, nothing here can overflow.
        if not sum(map(abs, phi.tolist())) < LARGEST:
            return None
        n = len(phi)
        w = rows.dot(phi)  # ndarray.dot, not @: it is twice as fast on small arrays
        e = y - w.item(0)
        q = float(phi.dot(w[1:]))
        if q < 0.0:  # which rounding can leave of a vanishing one
            q = 0.0
        S, inflation = self.weigh(q, e, n, NUMBERS)
        if not e * e < LARGEST * S < math.inf:
            return None
        # theta gains g e / sqrt(S) while P loses g g', where g = P phi / sqrt(S): with the root
        # on both sides P stays symmetric to the last bit.
        w[0] = -e
        w /= math.sqrt(S)
        rows = rows - w[:, None].dot(w[None, 1:])  # O21 (18), (19), (21)
        P = rows[1:]
        if inflation != 1.0:
            P *= inflation  # O21 (25), or (13) with 1/lambda
        R1 = self.R1
        if isinstance(R1, np.ndarray) or R1:
            P += drift(R1, n)  # O21 (20)
        flat = rows.ravel()
        return (frozen(rows), e, S, inflation) if flat.dot(flat) < LARGEST * LARGEST else None

    def learn_one(self, theta: float, P: float, phi: float, y: float) -> LearnedOne | None:
        """Return the same for one parameter, in plain floats: a third of the time."""
        if not abs(phi) < LARGEST:
            return None
        e, g = y - theta * phi, P * phi
        q = g * phi
        if q < 0.0:
            q = 0.0
        S, inflation = self.weigh(q, e, 1, NUMBERS)
        if not e * e < LARGEST * S < math.inf:
            return None
        root = math.sqrt(S)
        w = g / root
        theta += e / root * w  # O21 (18), (19)
        P = (P - w * w) * inflation  # O21 (21), and (25) or (13)
        R1 = self.R1
        P += drift(R1, 1).item() if isinstance(R1, np.ndarray) else R1  # O21 (20)
        if not theta * theta + P * P < LARGEST * LARGEST:
            return None
        return theta, P, e, S, inflation


def regressor(phi: npt.ArrayLike) -> Array:
    """Return `phi` as an array of floats; ``ValueError`` if it is none."""
    if isinstance(phi, np.ndarray) and phi.dtype is _FLOAT:  # nearly always
        return phi
    return floats("phi", phi)


def rejected(belief: Estimate) -> Estimate:
    """Return `belief` with nothing changed but the mark that a sample was not used."""
    return replace(belief, rejected=True)


def checked_drift(value: float | Array) -> float | Array:
    """Return R1 as a float or a read-only matrix, or raise ``ValueError`` naming it."""
    if is_finite_number(value) and 0.0 <= value < LARGEST:
        return float(value)
    matrix = numbers("R1", value)
    if matrix.ndim == 2:
        return covariance("R1", matrix)
    raise ValueError(f"R1 must be a non-negative float or a covariance matrix, got {shown(value)}")


def drift(R1: float | Array, n: int) -> Array:
    """Return R1 as a matrix of shape (n, n); ``ValueError`` if it has another."""
    if not isinstance(R1, np.ndarray):
        return _diagonal(R1, n)
    if R1.shape != (n, n):
        raise ValueError(f"R1 must be a float or of shape ({n}, {n}), got {R1.shape}")
    return R1


@lru_cache(maxsize=32)
def identity(n: int) -> Array:
    """Return the read-only unit matrix of size `n`."""
    return frozen(np.eye(n))


@lru_cache(maxsize=32)
def _diagonal(variance: float, n: int) -> Array:
    """Return the read-only matrix of size `n` with `variance` on its diagonal."""
    return frozen(variance * identity(n))
