r"""A model wide enough for every candidate, fitted to a whole record at once.

.. math::

    y(t) + a_1 y(t-1) + \dots + a_n y(t-n) = b_1 u(t-1) + \dots + b_M u(t-M) + c + v(t)

Its lags hold those of every order that is to be weighed, so its errors tell the noise without a
word on the order; c tells how far the means of a record are from a state of rest; and a model of
equal size without inputs tells whether the input was heard at all.

Explained in ``docs/replay.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from thermoctl.model.arx import Arx
from thermoctl.quantities import Array, frozen
from thermoctl.studies.record import Record, RecordError
from thermoctl.studies.scaled import Scaled, robust_variance

SAMPLES_PER_PARAMETER = 4
"""Samples a fit needs for each of its parameters."""

_RCOND = 1e-12
_SURE = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class WideModel:
    """What was fitted, in the scaled variables.

    Parameters
    ----------
    order : Arx
        Its structure, with delay 1.
    theta : ndarray, shape (n + M + 1,)
        a's, b's and c.
    covariance : ndarray, shape (n + M + 1, n + M + 1)
        Of theta, if the errors are white.
    R2 : float
        Robust variance of the errors.
    samples : int
        Samples it was fitted to.
    evidence : float
        Log likelihood, in nats, by which it beats the model of as many past outputs and no input;
        0 where M is 0.
    """

    order: Arx
    theta: Array
    covariance: Array
    R2: float
    samples: int
    evidence: float

    @property
    def heard(self) -> float:
        """Share that the input foresees of what past outputs leave open."""
        return max(0.0, -math.expm1(-2.0 * self.evidence / self.samples))

    @property
    def rest(self) -> float:
        """Scaled input that keeps the scaled output 0; 0 where that is not known."""
        b = slice(self.order.n, self.order.n + self.order.m)
        gain = float(self.theta[b].sum())
        sd = math.sqrt(max(0.0, float(self.covariance[b, b].sum())))
        return -float(self.theta[-1]) / gain if abs(gain) > _SURE * sd else 0.0


def fit_wide(record: Record, y: Array, u: Array, n: int, reach: int) -> WideModel:
    """Return the model of `n` past outputs and `reach` past inputs of a record.

    Parameters
    ----------
    record : Record
        Tells where stretches begin.
    y, u : ndarray, shape (T,)
        Its scaled outputs and inputs.
    n, reach : int
        Lags of output and input; not both 0.

    Raises
    ------
    RecordError
        If too few samples have a past as long as that.
    """
    order = Arx(n, reach, 1)
    scaled = Scaled.of(record, y, u, order, n + reach)
    samples, parameters = len(scaled.whole), n + reach + 1
    if samples < SAMPLES_PER_PARAMETER * parameters:
        raise RecordError(
            f"{record.source}: expected {SAMPLES_PER_PARAMETER * parameters} samples with"
            f" {n + reach} before them and no gap, to weigh orders that reach so far back;"
            f" got {samples}"
        )
    theta, inverse, errors = _least_squares(scaled)
    freedom = samples - parameters
    R2 = robust_variance(errors, y) * samples / freedom
    evidence = 0.0
    if reach:
        without = Scaled.of(record, y, u, Arx(n + reach, 0))
        alone = _least_squares(without)[2]
        evidence = 0.5 * samples * math.log(_power(alone) / _power(errors))
    covariance = inverse * float(errors @ errors) / freedom
    return WideModel(order, frozen(theta), frozen(covariance), R2, samples, evidence)


def samples_needed(n: int, reach: int) -> int:
    """Return how many samples without a gap a fit with these lags takes."""
    return SAMPLES_PER_PARAMETER * (n + reach + 1) + n + reach


def _least_squares(scaled: Scaled) -> tuple[Array, Array, Array]:
    """Return theta with its constant, the inverse of its information, and the errors."""
    parameters = scaled.order.parameters + 1
    gram, moment = np.zeros((parameters, parameters)), np.zeros(parameters)
    for block, phi in scaled.blocks():
        phi = np.column_stack((phi, np.ones(len(phi))))
        gram += phi.T @ phi
        moment += phi.T @ scaled.y[block]
    inverse = _inverse(gram)
    theta = inverse @ moment
    errors = [scaled.y[block] - phi @ theta[:-1] - theta[-1] for block, phi in scaled.blocks()]
    return theta, inverse, np.concatenate(errors)


def _inverse(gram: Array) -> Array:
    """Return the inverse, with a large variance where the record is silent.

    An input that hardly moves is no other regressor than the constant. A pseudo-inverse would call
    such directions certain, see test_a_power_that_moved_once_claims_no_gain.
    """
    information, directions = np.linalg.eigh(gram)
    information = np.maximum(information, _RCOND * information[-1])
    inverse: Array = (directions / information) @ directions.T
    return inverse


def _power(errors: Array) -> float:
    """Return the mean square, never 0: a record without noise is heard, not endless evidence."""
    return float(np.mean(errors**2)) + np.finfo(np.float64).tiny
