r"""The Kalman filter of a known model, and what its fading relatives share.

.. math:: x_k = F x_{k-1} + w_k, \qquad z_k = H x_k + v_k

Implements section 7 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from thermoctl.estimation.belief import LARGEST, bounded, covariance, floats
from thermoctl.quantities import Array, frozen


@dataclass(frozen=True, slots=True, eq=False)
class LinearModel:
    """A linear model with noise, BO17 (1)-(2).

    Parameters
    ----------
    F : ndarray, shape (n, n)
        Transition from one sample to the next; Phi in the paper.
    H : ndarray, shape (m, n)
        What is observed of the state.
    Q : float or ndarray, shape (n, n)
        Covariance of the state's noise per sample; a float stands for ``Q * I``.
    R : float or ndarray, shape (m, m)
        Covariance of the observation's noise, positive definite; a float stands for ``R * I``.

    Raises
    ------
    ValueError
        A matrix is not finite or has a shape that does not fit; `Q` or `R` is no covariance, or
        `R` is singular.
    """

    F: Array
    H: Array
    Q: Array
    R: Array

    def __post_init__(self) -> None:
        F, H = (bounded(name, getattr(self, name)) for name in ("F", "H"))
        if F.ndim != 2 or F.shape[0] != F.shape[1] or F.size == 0:
            raise ValueError(f"F must be a square matrix, got shape {F.shape}")
        if H.ndim != 2 or H.shape[0] == 0 or H.shape[1] != len(F):
            raise ValueError(f"H must have shape (m, {len(F)}), got {H.shape}")
        R = covariance("R", self.R, len(H))
        if not float(np.linalg.eigvalsh(R)[0]) > 0.0:
            raise ValueError(f"R must be positive definite, got {R.tolist()}")
        Q = covariance("Q", self.Q, len(F))
        for name, matrix in (("F", F), ("H", H), ("Q", Q), ("R", R)):
            object.__setattr__(self, name, frozen(matrix))

    @property
    def n(self) -> int:
        """Number of states."""
        return len(self.F)

    @property
    def m(self) -> int:
        """Number of observations per sample."""
        return len(self.H)


@dataclass(frozen=True, slots=True, eq=False)
class StateBelief:
    """A belief about the state; its arrays are read-only.

    Parameters
    ----------
    x : ndarray, shape (n,)
        The state after the last observation, x(k|k).
    P : ndarray, shape (n, n)
        Its covariance, P(k|k).
    innovation : ndarray, shape (m,)
        v(k) = z(k) - H x(k|k-1); NaN before the first update.
    innovation_cov : ndarray, shape (m, m)
        The covariance the law expected of it, after fading; NaN before the first update.
    fading : ndarray, shape (n,)
        Diagonal of S(k); ones where nothing was adapted.
    rejected : bool
        The last observation was not used.
    samples : int
        Observations used so far.
    mean_square : ndarray, shape (m, m)
        Mean of v v' over them, the last one included; C in the paper.
    """

    x: Array
    P: Array
    innovation: Array
    innovation_cov: Array
    fading: Array
    rejected: bool = False
    samples: int = 0
    mean_square: Array = field(default_factory=lambda: frozen(np.zeros(())))


class Prediction(NamedTuple):
    """What is known once an observation is there and nothing is corrected yet."""

    x: Array
    """x(k|k-1), shape (n,)."""
    J: Array
    """F P F', shape (n, n): the part of P(k|k-1) that fading scales."""
    v: Array
    """Innovation, shape (m,)."""
    C: Array
    """Mean of v v', this v included, shape (m, m)."""


@dataclass(frozen=True, slots=True, eq=False)
class StateLaw:
    """What the laws of this module share: predict, choose factors, correct.

    Parameters
    ----------
    model : LinearModel
        The model taken for true.

    Raises
    ------
    TypeError
        `model` is no `LinearModel`.
    """

    model: LinearModel

    def __post_init__(self) -> None:
        if not isinstance(self.model, LinearModel):
            raise TypeError(f"model must be a LinearModel, got {type(self.model).__name__}")

    def start(self, x0: npt.ArrayLike, P0: float | npt.ArrayLike) -> StateBelief:
        """Return the belief one step before the first observation.

        Parameters
        ----------
        x0 : array_like, shape (n,)
            The state at k-1: the first update predicts before it corrects.
        P0 : float or array_like, shape (n, n)
            Its covariance; a float stands for ``P0 * I``.

        Raises
        ------
        ValueError
            `x0` is not finite or not of that shape; `P0` is no covariance of that size.
        """
        n, m = self.model.n, self.model.m
        x = bounded("x0", x0)
        if x.shape != (n,):
            raise ValueError(f"x0 must have shape ({n},), got {x.shape}")
        return StateBelief(
            frozen(x),
            covariance("P0", P0, n),
            innovation=frozen(np.full(m, np.nan)),
            innovation_cov=frozen(np.full((m, m), np.nan)),
            fading=frozen(np.ones(n)),
            mean_square=frozen(np.zeros((m, m))),
        )

    def update(self, belief: StateBelief, z: npt.ArrayLike) -> StateBelief:
        """Return the belief one sample later, after observation `z`.

        Parameters
        ----------
        belief : StateBelief
            What was believed at k-1; it is not changed.
        z : array_like, shape (m,)
            Observation at k; a float will do where m is 1.

        Returns
        -------
        StateBelief
            The new belief. Where `z` is not finite, or no factors give a finite result, the old
            one with ``rejected=True``.

        Raises
        ------
        TypeError
            `belief` is no `StateBelief`.
        ValueError
            `z` does not consist of numbers or has another shape, or `belief` is one of another
            number of states or observations.
        """
        n, m = self.model.n, self.model.m
        observation = np.atleast_1d(floats("z", z))
        if observation.shape != (m,):
            raise ValueError(f"z must have shape ({m},), got {np.shape(z)}")
        _check_belief(belief, n, m)
        with np.errstate(all="ignore"):  # overflow shows in the result, which is looked at
            prediction = self._predict(belief, observation)
            for fading in self.factors(prediction):
                corrected = self._correct(belief, prediction, fading)
                if corrected is not None:
                    return corrected
        return replace(belief, rejected=True)

    def factors(self, prediction: Prediction) -> Iterator[Array]:
        """Yield diagonals of S(k), shape (n,): the wanted one, then fallbacks."""
        yield np.ones(self.model.n)

    def _predict(self, belief: StateBelief, z: Array) -> Prediction:
        """Return the prediction and how far the observation is from it."""
        F, H = self.model.F, self.model.H
        x = F @ belief.x  # BO17 (3)
        J = F @ belief.P @ F.T  # BO17 (19)
        v = z - H @ x  # BO17 (8)
        C = belief.mean_square + (np.outer(v, v) - belief.mean_square) / (belief.samples + 1)
        return Prediction(x, J, v, C)

    def _correct(
        self, belief: StateBelief, prediction: Prediction, fading: Array
    ) -> StateBelief | None:
        """Return the corrected belief; None if it would not be finite."""
        H, R = self.model.H, self.model.R
        P = faded(self.model, prediction.J, fading)
        S = H @ P @ H.T + R  # BO17 (10)
        try:
            K = np.linalg.solve(S, H @ P).T  # BO17 (5)
        except np.linalg.LinAlgError:  # R drowned in H P H'
            return None
        x = prediction.x + K @ prediction.v  # BO17 (6)
        A = np.eye(self.model.n) - K @ H
        # Joseph's form of BO17 (7): a large factor beside a small R leaves it positive where the
        # short form cancels, see test_a_huge_prior_leaves_the_covariance_positive_definite.
        P = A @ P @ A.T + K @ R @ K.T
        P = 0.5 * (P + P.T)
        if not _sane(x, P, S, prediction.C):
            return None
        return StateBelief(
            frozen(x),
            frozen(P),
            innovation=frozen(prediction.v),
            innovation_cov=frozen(0.5 * (S + S.T)),
            fading=frozen(fading),
            samples=belief.samples + 1,
            mean_square=frozen(prediction.C),
        )


@dataclass(frozen=True, slots=True, eq=False)
class StateKalman(StateLaw):
    """The Kalman filter, BO17 (3)-(7).

    Parameters
    ----------
    model : LinearModel
        The model taken for true.

    Raises
    ------
    TypeError
        `model` is no `LinearModel`.
    """


def faded(model: LinearModel, J: Array, fading: Array) -> Array:
    """Return P(k|k-1), shape (n, n), with its part `J` scaled from both sides."""
    return fading[:, None] * J * fading + model.Q  # BO17 (14)


def _check_belief(belief: StateBelief, n: int, m: int) -> None:
    """Raise unless `belief` is one of `n` states and `m` observations."""
    if not isinstance(belief, StateBelief):
        raise TypeError(f"belief must be a StateBelief, got {type(belief).__name__}")
    if belief.x.shape != (n,):
        raise ValueError(f"belief must be one of {n} states, got {len(belief.x)}")
    if belief.innovation.shape != (m,):
        raise ValueError(f"belief must be one of {m} observations, got {len(belief.innovation)}")


def _sane(*arrays: Array) -> bool:
    """Return whether all elements are finite and below LARGEST."""
    return all(bool((np.abs(array) < LARGEST).all()) for array in arrays)
