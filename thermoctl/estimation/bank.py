r"""The Lainiotis bank: order and delay, by filters weighed against each other.

Every candidate runs a Kalman filter of its own on the same samples. How well it predicted each of
them multiplies up to the probability that it is the true one, and what the bank as a whole
believes is the average under these probabilities.

All filters run at once: the candidates are the replications of `thermoctl.estimation.batch`, each
padded with zeros to the regressor that would hold them all. A coefficient a candidate does not have
meets a regressor of 0: nothing is ever learned of it, so it stays 0, exactly, and disturbs nothing
(``test_padding_changes_nothing_for_any_candidate``).

Implements section 8 of ``docs/theory.md``.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from thermoctl.estimation.batch import advance, usable
from thermoctl.estimation.belief import LARGEST, positive, scalar, shown
from thermoctl.estimation.identifier import pushed
from thermoctl.estimation.kalman import RandomWalkKalman
from thermoctl.estimation.recursion import drift, identity
from thermoctl.model.arx import Arx
from thermoctl.quantities import Array, frozen, is_finite_number

PAST_LIMIT = math.sqrt(LARGEST)
"""No sample beyond this enters the past: with one a regressor might never be usable again."""

ZERO: Array = frozen(np.zeros(1))


@dataclass(frozen=True, slots=True)
class Order:
    """One hypothesis about the structure of an ARX model, O21 (1).

    Parameters
    ----------
    n, m : int
        Number of past outputs and of inputs; at least 0, not both 0.
    delay : int
        Samples from an input to its first effect; at least 1, without meaning for ``m=0``.

    Raises
    ------
    ValueError
        An argument is outside its range.
    """

    n: int
    m: int
    delay: int = 1

    def __post_init__(self) -> None:
        self.structure()  # which refuses what is none

    def structure(self) -> Arx:
        """Return the ARX structure of these numbers, in variables as they come."""
        return Arx(self.n, self.m, self.delay)


@dataclass(frozen=True, slots=True, eq=False)
class LainiotisBank:
    r"""The adaptive Lainiotis filter over orders and delays, ALF (4)-(8).

    .. math::

        p(\tau \mid t) \propto L(t; \tau)\, p(\tau \mid t-1), \qquad
        L = S_\tau^{-1/2} \exp\bigl(-e_\tau^2 / (2 S_\tau)\bigr)

    A bank never changes: `update` returns the next one. The prior is uniform, the past before the
    first sample 0 unless `remember` fills it. After each sample probabilities below `floor` are
    raised to it, all are divided by their sum, and what results is both `posterior` and the prior
    of the next sample.

    Parameters
    ----------
    candidates : sequence of Order
        The hypotheses, all different; kept as a tuple.
    R : float
        Variance of the noise, in the square of the unit of y; greater than zero.
    P0 : float
        Variance of every coefficient before the first sample; greater than zero. Coefficients cost
        a candidate the more the larger it is, which is what decides against needless ones.
    Q : float
        Variance every coefficient gains per sample; at least 0.
    floor : float
        Least probability of a candidate before normalising, in [0, 1/k]. Zero lets one fall so far
        that it needs as many samples to come back.

    Raises
    ------
    ValueError
        No candidates, two that are the same or one that is no `Order`; a number outside its range.
    """

    candidates: Sequence[Order]
    R: float = 1.0
    P0: float = 100.0
    Q: float = 0.0
    floor: float = 1e-3
    _law: RandomWalkKalman = field(init=False, repr=False)
    _layout: _Layout = field(init=False, repr=False)
    _belief: _Belief = field(init=False, repr=False)

    def __post_init__(self) -> None:
        orders = _checked(self.candidates)
        positive("R", self.R)
        positive("P0", self.P0)
        if not (is_finite_number(self.Q) and 0.0 <= self.Q < LARGEST):
            raise ValueError(f"Q must be a float of at least 0, got {shown(self.Q)}")
        if not (is_finite_number(self.floor) and 0.0 <= self.floor <= 1.0 / len(orders)):
            raise ValueError(f"floor must lie in [0, 1/{len(orders)}], got {self.floor!r}")
        layout = _Layout(orders)
        object.__setattr__(self, "candidates", orders)
        object.__setattr__(self, "_law", RandomWalkKalman(self.Q, self.R))
        object.__setattr__(self, "_layout", layout)
        object.__setattr__(self, "_belief", layout.start(self.P0))

    @property
    def posterior(self) -> Array:
        """Probability of each candidate after the last sample, shape (k,)."""
        return self._belief.posterior

    @property
    def prediction(self) -> float:
        """What the last sample was expected to be before it came; NaN without one.

        The mean of the candidates' predictions under the posterior of the sample before.
        """
        return self._belief.prediction

    @property
    def rejected(self) -> bool:
        """Whether the last sample could not be used."""
        return self._belief.rejected

    @property
    def best(self) -> Order:
        """The most probable candidate, of equals the one listed first."""
        return self._layout.orders[int(np.argmax(self.posterior))]

    @property
    def theta(self) -> Array:
        """Coefficients, a's then b's: fused where candidates are nested, else of `best`.

        Candidates are nested when all that have inputs share one delay: each is then the largest
        with some coefficients 0, and the mean has shape (largest n + largest m,). Under different
        delays the same place would mean different coefficients.
        """
        layout, belief = self._layout, self._belief
        if layout.nested:
            return frozen(belief.theta @ belief.posterior)  # ALF (5)
        i = int(np.argmax(belief.posterior))
        return frozen(belief.theta[layout.present[:, i], i])

    def update(self, y: float, u: float) -> LainiotisBank:
        """Return the bank after one sample.

        Parameters
        ----------
        y : float
            Output y(t).
        u : float
            u(t-1), the power applied since the sample before.

        Returns
        -------
        LainiotisBank
            The next bank. Where `y` or `u` is not finite, or the result would not be, this one
            with ``rejected`` true; its past closes over the gap as if nothing had been missed.

        Raises
        ------
        ValueError
            `y` or `u` is no number.
        """
        y, u = scalar("y", y), scalar("u", u)
        before, layout = self._belief, self._layout
        if not (abs(y) < PAST_LIMIT and abs(u) < PAST_LIMIT):  # false for NaN
            return self._with(before.marked())
        u_past = pushed(before.u_past, u)
        phi = np.concatenate((-before.y_past, u_past, ZERO))[layout.lags]  # O21 (3)
        rows, e = np.empty_like(before.rows), np.empty(phi.shape[1])
        R1 = drift(self.Q, len(phi))[:, :, None] if self.Q else None
        after = (rows, e, np.empty_like(e))
        with np.errstate(all="ignore"):  # what overflows here is found in the result
            S = advance(self._law, before.rows, phi, np.full_like(e, y), R1, after)
            if not usable(phi, S, rows, e).all():
                return self._with(before.marked())
        log_L = -0.5 * (np.log(S) + e * e / S)  # ALF (7), (8)
        log_posterior = _floored(before.log_posterior + log_L, self.floor)  # ALF (6)
        predictions = (before.theta * phi).sum(axis=0)
        return self._with(
            _Belief(
                frozen(rows),
                frozen(log_posterior),
                frozen(np.exp(log_posterior)),
                pushed(before.y_past, y),
                u_past,
                float(before.posterior @ predictions),  # ALF (5)
            )
        )

    def remember(self, y: float, u: float) -> LainiotisBank:
        """Return the bank with one more sample in its past, of which nothing is learned.

        For the first samples of a record and those after a gap, whose own past is not known: with
        as many as the longest regressor reaches back, no candidate is judged by a past of zeros.

        Parameters
        ----------
        y, u : float
            As in `update`; where one is not finite, the bank comes back with ``rejected`` true.

        Raises
        ------
        ValueError
            `y` or `u` is no number.
        """
        y, u = scalar("y", y), scalar("u", u)
        before = self._belief
        if not (abs(y) < PAST_LIMIT and abs(u) < PAST_LIMIT):  # false for NaN
            return self._with(before.marked())
        y_past, u_past = pushed(before.y_past, y), pushed(before.u_past, u)
        return self._with(
            replace(before, y_past=y_past, u_past=u_past, prediction=math.nan, rejected=False)
        )

    def _with(self, belief: _Belief) -> LainiotisBank:
        """Return this bank with another belief; the checks need not be made again."""
        after = copy.copy(self)
        object.__setattr__(after, "_belief", belief)
        return after


@dataclass(frozen=True, slots=True, eq=False)
class _Belief:
    """What k filters of p padded coefficients believe; arrays read-only, candidates last.

    `rows`, shape (p + 1, p, k), is theta on top of P. The past runs newest first, as far back as
    any candidate looks.
    """

    rows: Array
    log_posterior: Array
    posterior: Array
    y_past: Array
    u_past: Array
    prediction: float = math.nan
    rejected: bool = False

    @property
    def theta(self) -> Array:
        """Coefficients of each candidate, shape (p, k)."""
        theta: Array = self.rows[0]
        return theta

    @property
    def P(self) -> Array:  # noqa: N802 - P keeps its letter
        """Their covariances, shape (p, p, k)."""
        return self.rows[1:]

    def marked(self) -> _Belief:
        """Return this belief with the mark that a sample was not used."""
        return replace(self, rejected=True)


class _Layout:
    """Where each coefficient of each candidate finds its regressor.

    `lags`, shape (p, k), are places in (-y(t-1), -y(t-2), ..., u(t-1), u(t-2), ..., 0); the 0 at
    the end is for coefficients a candidate does not have, and `present` tells those it has.
    """

    __slots__ = ("lags", "nested", "orders", "present", "u_memory", "y_memory")

    def __init__(self, orders: tuple[Order, ...]) -> None:
        self.orders = orders
        self.nested = len({order.delay for order in orders if order.m}) <= 1
        n, m = max(order.n for order in orders), max(order.m for order in orders)
        self.y_memory = n
        self.u_memory = max(order.structure().u_memory for order in orders)
        zero = n + self.u_memory
        self.lags = np.full((n + m, len(orders)), zero)
        for i, order in enumerate(orders):
            newest = n + order.delay - 1
            self.lags[: order.n, i] = np.arange(order.n)
            self.lags[n : n + order.m, i] = np.arange(newest, newest + order.m)
        self.present: npt.NDArray[np.bool_] = self.lags < zero

    def start(self, P0: float) -> _Belief:
        """Return what is believed before the first sample."""
        p, k = self.lags.shape
        return _Belief(
            frozen(np.repeat(np.vstack((np.zeros(p), P0 * identity(p)))[:, :, None], k, axis=2)),
            frozen(np.full(k, -math.log(k))),
            frozen(np.full(k, 1.0 / k)),
            frozen(np.zeros(self.y_memory)),
            frozen(np.zeros(self.u_memory)),
        )


def _checked(candidates: Sequence[Order]) -> tuple[Order, ...]:
    """Return the candidates as a tuple, or raise ``ValueError``."""
    try:
        orders = tuple(candidates)
    except TypeError as error:
        raise ValueError(f"candidates must be a sequence of Order, got {candidates!r}") from error
    if not orders:
        raise ValueError("candidates must not be empty")
    seen = set()
    for order in orders:
        if not isinstance(order, Order):
            raise ValueError(f"candidates must be of type Order, got {order!r}")  # noqa: TRY004
        structure = order if order.m else Order(order.n, 0)
        if structure in seen:
            raise ValueError(f"candidates must differ, {order} repeats another")
        seen.add(structure)
    return orders


def _floored(log_weights: Array, floor: float) -> Array:
    """Return the logarithm of probabilities raised to `floor`, then normalised."""
    log_p = _normalised(log_weights)
    if floor == 0.0:
        return log_p
    return _normalised(np.maximum(log_p, math.log(floor)))


def _normalised(log_weights: Array) -> Array:
    """Return logarithms of probabilities; no exponential overflows or is all zero."""
    shifted: Array = log_weights - log_weights.max()
    return shifted - math.log(float(np.exp(shifted).sum()))
