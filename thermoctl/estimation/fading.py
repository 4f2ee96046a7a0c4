r"""Kalman filters that enlarge what they propagate when innovations surprise them.

.. math:: P_{k|k-1} = S_k F P_{k-1} F^T S_k + Q, \qquad S_k = \mathrm{diag}(s_1, \dots, s_n)

Implements section 7 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from thermoctl.estimation.belief import positive, truth
from thermoctl.estimation.state_space import LinearModel, Prediction, StateLaw, faded
from thermoctl.quantities import Array, frozen, is_finite_number

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class MultipleFading(StateLaw):
    """A fading factor for each observed state; Filter 1 of BO17, after Geng and Wang.

    The factor is the smallest that brings its innovation within the confidence limit. States that
    are not observed themselves keep the factor 1.

    Parameters
    ----------
    model : LinearModel
        The model taken for true; each row of its H has exactly one non-zero.
    confidence : float
        Share of innovations that are to pass unadapted if the model is right, in (0, 1).

    Raises
    ------
    TypeError
        `model` is no `LinearModel`.
    ValueError
        A row of H has not exactly one non-zero; `confidence` is not in (0, 1).
    """

    confidence: float = 0.95
    critical: float = field(init=False, repr=False)
    """The chi-square quantile of `confidence` with one degree of freedom."""
    observed: Indices = field(init=False, repr=False)
    """Which state each row of H observes, shape (m,)."""

    def __post_init__(self) -> None:
        StateLaw.__post_init__(self)  # super() does not see through slots
        if not is_finite_number(self.confidence) or not 0.0 < self.confidence < 1.0:
            raise ValueError(f"confidence must lie between 0 and 1, got {self.confidence!r}")
        # By the lower tail, which is still exact where 1 - confidence is next to nothing.
        quantile = NormalDist().inv_cdf(0.5 * (1.0 - self.confidence)) ** 2
        object.__setattr__(self, "critical", quantile)
        object.__setattr__(self, "observed", _observed_states(self.model.H))

    def factors(self, prediction: Prediction) -> Iterator[Array]:
        """Yield the factors (24), then ones."""
        yield self._observed_factors(prediction)
        yield np.ones(self.model.n)

    def _observed_factors(self, prediction: Prediction) -> Array:
        """Return the factors (24), shape (n,)."""
        H, Q, R = self.model.H, self.model.Q, self.model.R
        rows, states = np.arange(self.model.m), self.observed
        b = np.diag(H @ Q @ H.T + R)  # BO17 (18)
        scale = H[rows, states] ** 2 * prediction.J[states, states]
        known = ~(scale > 0.0)  # exactly, so that no factor would change anything
        # BO17 (22) solved for s^2
        wanted = (prediction.v**2 / self.critical - b) / np.where(known, np.inf, scale)
        s = np.ones(self.model.n)
        # Of several rows on one state the largest counts.
        np.maximum.at(s, states, np.sqrt(np.maximum(wanted, 1.0)))  # BO17 (23)
        return s


@dataclass(frozen=True, slots=True, eq=False)
class MatrixFading(MultipleFading):
    """Factors for unobserved states as well, by descent; Filter 2 of BO17.

    With a diagonal Q the criterion is least at a factor of 0, where the filter no longer corrects
    an unobserved state: read section 7 of the theory before using this law. Where the search
    ends above where it began, or on something not finite, the factors of `MultipleFading` are
    taken.

    Parameters
    ----------
    model : LinearModel
        The model taken for true; each row of its H has exactly one non-zero.
    confidence : float
        As for `MultipleFading`, in (0, 1).
    tau : float
        Step of the descent, in (0, 1).
    normalised : bool
        Divide the step by the largest squared gradient of T; otherwise as printed.
    delta : float
        The search ends when a step changes the criterion by no more than this; positive.
    max_iterations : int
        The search ends after so many steps, at least 1.
    s_min, s_max : float
        Bounds of the factors sought, one on either side of 1; may be infinite.
    gate : float, optional
        Search only where the normalised innovation squared (11) reaches this value, the
        chi-square quantile with m degrees of freedom; by default at every sample.

    Raises
    ------
    TypeError
        `model` is no `LinearModel`.
    ValueError
        A row of H has not exactly one non-zero, or a number is out of its range.
    """

    tau: float = 0.1
    normalised: bool = True
    delta: float = 1e-4
    max_iterations: int = 20
    s_min: float = 0.0
    s_max: float = 1.0
    gate: float | None = None

    def __post_init__(self) -> None:
        MultipleFading.__post_init__(self)
        if not is_finite_number(self.tau) or not 0.0 < self.tau < 1.0:
            raise ValueError(f"tau must lie between 0 and 1, got {self.tau!r}")
        positive("delta", self.delta)
        truth("normalised", self.normalised)
        steps = self.max_iterations
        if isinstance(steps, bool) or not isinstance(steps, int) or steps < 1:
            raise ValueError(f"max_iterations must be a positive integer, got {steps!r}")
        for name in ("s_min", "s_max"):
            bound = getattr(self, name)
            if isinstance(bound, bool) or not isinstance(bound, int | float) or math.isnan(bound):
                raise ValueError(f"{name} must be a number, got {bound!r}")
        if not self.s_min <= 1.0:
            raise ValueError(f"s_min must be at most 1, got {self.s_min!r}")
        if not self.s_max >= 1.0:
            raise ValueError(f"s_max must be at least 1, got {self.s_max!r}")
        if self.gate is not None:
            positive("gate", self.gate)

    def factors(self, prediction: Prediction) -> Iterator[Array]:
        """Yield the factors (33), then those of Filter 1, then ones."""
        s = self._observed_factors(prediction)
        hidden = np.setdiff1d(np.arange(self.model.n), self.observed)
        if len(hidden) and self._surprised(prediction):
            criterion = Criterion.of(self.model, prediction, s, hidden)
            if criterion is not None:
                sought = self._descend(criterion)
                if sought is not None:
                    adapted = s.copy()
                    adapted[hidden] = sought  # BO17 (33)
                    yield adapted
        yield s
        yield np.ones(self.model.n)

    def _surprised(self, prediction: Prediction) -> bool:
        """Return whether the innovation reaches the gate, BO17 (12)."""
        if self.gate is None:
            return True
        H, v = self.model.H, prediction.v
        S = H @ faded(self.model, prediction.J, np.ones(self.model.n)) @ H.T + self.model.R
        try:
            return bool(v @ np.linalg.solve(S, v) >= self.gate)  # BO17 (11)
        except np.linalg.LinAlgError:
            return False

    def _descend(self, criterion: Criterion) -> Array | None:
        """Return the factors at the end of the search, or None if it failed."""
        first = value = criterion.value(s := np.ones(len(criterion.slope)))
        step = self.tau
        if self.normalised:
            steepest = float((criterion.slope**2).sum(axis=1).max())
            if not steepest > 0.0:
                return s
            step /= steepest
        for _ in range(self.max_iterations):
            s = np.clip(s - step * criterion.gradient(s), self.s_min, self.s_max)  # BO17 (30)
            before, value = value, criterion.value(s)
            if not abs(value - before) > self.delta:  # BO17 (31); NaN ends it too
                break
        return s if value <= first < math.inf else None


@dataclass(frozen=True, slots=True, eq=False)
class Criterion:
    r"""What Filter 2 minimises, as far as the factors sought can change it.

    Their rows of :math:`T = P(S) H^T - K(S)\,C` are linear in them, one factor to a row, and no
    other row depends on them.

    Parameters
    ----------
    slope : ndarray, shape (h, m)
        Derivative of each row of T by its own factor.
    rest : ndarray, shape (h, m)
        Those rows where the factors are 0.
    """

    slope: Array
    rest: Array

    @classmethod
    def of(
        cls, model: LinearModel, prediction: Prediction, s: Array, hidden: Indices
    ) -> Criterion | None:
        """Return the criterion for the states `hidden`; None where S is singular.

        `s` holds the factors of all states, shape (n,); those of `hidden` do not matter, because
        they do not enter the innovation's covariance.
        """
        H = model.H
        S = H @ faded(model, prediction.J, s) @ H.T + model.R
        try:
            excess = np.eye(model.m) - np.linalg.solve(S, prediction.C)
        except np.linalg.LinAlgError:
            return None
        # P(S) H' - K C with K = P(S) H' S^-1 is P(S) H' (I - S^-1 C): the gain is that of the
        # factors being tried. With the gain held fixed there would be nothing to gain.
        propagated = ((prediction.J * s) @ H.T)[hidden]
        return cls(propagated @ excess, (model.Q @ H.T)[hidden] @ excess)

    def value(self, s: Array) -> float:
        """Return the sum of T squared over the rows of the factors `s`, shape (h,)."""
        return float(((s[:, None] * self.slope + self.rest) ** 2).sum())  # BO17 (28)

    def gradient(self, s: Array) -> Array:
        """Return its gradient at `s`, shape (h,)."""
        T = s[:, None] * self.slope + self.rest  # BO17 (29)
        gradient: Array = 2.0 * (T * self.slope).sum(axis=1)
        return gradient


def _observed_states(H: Array) -> Indices:
    """Return the column of the one non-zero in each row, or raise ValueError naming H."""
    if not ((H != 0.0).sum(axis=1) == 1).all():
        raise ValueError(f"H must have exactly one non-zero in each row, got {H.tolist()}")
    return frozen(np.argmax(H != 0.0, axis=1))
