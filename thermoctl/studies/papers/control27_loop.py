r"""The loop of O21 (27), closed by the law of (23): who steers, over which plant.

.. math:: y(t) = a(t)\, y(t-1) + u(t-1) + v(t), \qquad u(t) = y^*(t+1) - \hat a(t)\, y(t)

in degC and in K a sample, with v of standard deviation .1 K. The estimators regress y(t) - u(t-1)
on y(t-1) from theta = 0, P = 1; the filters know R2 = .01 K^2. Nothing bounds the input.

Implements section 5 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from thermoctl.estimation import (
    CorrectedKalman,
    RandomWalkKalman,
    RecursiveLeastSquares,
    VariableForgetting,
)
from thermoctl.estimation.batch import advance
from thermoctl.estimation.recursion import RecursiveLaw, drift
from thermoctl.quantities import Array

SAMPLES: Final = 400
NOISE_K: Final = 0.1
P0: Final = 1.0
SETPOINT_C, FIRST_C = 37.5, 25.0
RISE_K: Final = SETPOINT_C - FIRST_C

_T: Final = np.arange(1, SAMPLES + 1)


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """What the plant does, and what is wanted of it.

    Parameters
    ----------
    name : str
        As it stands in the table.
    title : str
        As it stands over its figures.
    pole : ndarray, shape (SAMPLES,)
        a(t) at t = 1 to SAMPLES.
    setpoint : ndarray, shape (SAMPLES,)
        y* at t = 1 to SAMPLES.
    first : float
        y(0).
    """

    name: str
    title: str
    pole: Array
    setpoint: Array
    first: float = FIRST_C


@dataclass(frozen=True, slots=True)
class Method:
    """Who tells the law of (23) what a is: an estimator; None: a(t+1) is known."""

    name: str
    law: RecursiveLaw | None


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """What happened in R replications.

    Parameters
    ----------
    output, reference : ndarray, shapes (SAMPLES, R) and (SAMPLES,)
        y and y* at t = 1 to SAMPLES.
    input : ndarray, shape (SAMPLES, R)
        u(t-1), which led to y(t).
    a, P : ndarray, shape (SAMPLES, R)
        The estimate after y(t) and the variance P(t+1|t) the next one starts from; who knows a has
        its true value, and 0.
    """

    output: Array
    reference: Array
    input: Array
    a: Array
    P: Array


_WARM: Final = np.full(SAMPLES, SETPOINT_C)

SCENARIOS: Final = (
    Scenario("sine", "a swings slowly", 0.95 + 0.03 * np.sin(2.0 * np.pi * _T / SAMPLES), _WARM),
    Scenario("drift", "a drifts", np.linspace(0.98, 0.92, SAMPLES), _WARM),
    Scenario("steps", "a jumps", np.where((_T > 133) & (_T <= 266), 0.92, 0.98), _WARM),
    Scenario("constant", "a stays as it is", np.full(SAMPLES, 0.95), _WARM),
    Scenario(
        "rest",
        "nothing moves, until the set point does",
        np.full(SAMPLES, 0.95),
        np.where(_T > 300, RISE_K, 0.0),
        -RISE_K,
    ),
)
"""The last one counts temperatures from the set point, so that the regressor is noise at rest.

The others count from 0 degC as the paper does: there a warm tank is never without excitation.
"""

METHODS: Final = (
    Method("CKF", CorrectedKalman(R1=0.0, R2=NOISE_K**2)),
    Method("NKF, R1 = 0", RandomWalkKalman(R1=0.0, R2=NOISE_K**2)),
    Method("NKF, R1 = 1e-6", RandomWalkKalman(R1=1e-6, R2=NOISE_K**2)),
    Method("RLS 1", RecursiveLeastSquares(1.0)),
    Method("RLS 0.99", RecursiveLeastSquares(0.99)),
    Method("RLS 0.9", RecursiveLeastSquares(0.9)),
    Method("variable forgetting, Sigma0 0.1", VariableForgetting(10.0 * NOISE_K**2)),
    Method("a known", None),
)
"""Rows of the table for every scenario, in this order; variable forgetting has N0 = 10."""


def close_loop(law: RecursiveLaw | None, scenario: Scenario, noise: Array) -> Loop:
    """Return what `law` makes of `scenario`.

    Parameters
    ----------
    law : RecursiveLaw or None
        The estimator; None: a(t+1) is known at t.
    scenario : Scenario
        Plant and set points.
    noise : ndarray, shape (SAMPLES, R)
        v of R replications, in K.
    """
    replications = noise.shape[1]
    y, u = np.empty((SAMPLES + 1, replications)), np.empty((SAMPLES, replications))
    rows = np.zeros((SAMPLES + 1, 2, 1, replications))
    theta, P = rows[:, 0], rows[:, 1]
    P[:] = P0
    e, inflation = np.empty(replications), np.empty(replications)
    R1 = None if law is None or not np.any(law.R1) else drift(law.R1, 1)[:, :, None]
    if law is None:
        theta[:-1], theta[-1], P[:] = scenario.pole[:, None, None], scenario.pole[-1], 0.0
    y[0] = scenario.first
    for t in range(SAMPLES):
        u[t] = scenario.setpoint[t] - theta[t, 0] * y[t]  # O21 (23)
        y[t + 1] = scenario.pole[t] * y[t] + u[t] + noise[t]  # O21 (27)
        if law is not None:
            after = (rows[t + 1], e, inflation)
            advance(law, rows[t], y[t : t + 1], y[t + 1] - u[t], R1, after)
    return Loop(y[1:], scenario.setpoint, u, theta[1:, 0], P[1:, 0])
