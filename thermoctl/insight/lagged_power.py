"""The power as the sensor comes to feel it: behind a dead time and two lags.

The total lag is divided as the first shape of the bank divides it. What is computed here takes in
heat over some lags at least, for which the shape hardly matters.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from thermoctl.control.adaptive.hypotheses import SHAPES
from thermoctl.quantities import Array

DEAD, FIRST, SECOND = SHAPES[0]
"""Shares of the total lag."""


def dead_samples(lag_s: float, period_s: float) -> int:
    """Return the dead time of a total lag in whole periods."""
    return round(DEAD * lag_s / period_s)


def _steps(lag_s: float, period_s: float) -> tuple[float, float]:
    return (
        -math.expm1(-period_s / (FIRST * lag_s)),
        -math.expm1(-period_s / (SECOND * lag_s)),
    )


class LaggedPower:
    """The power of every sample, felt.

    Parameters
    ----------
    lag_s, period_s : float
        Total lag, and time between two samples.
    power : float
        What was given before, for ever.
    """

    def __init__(self, lag_s: float, period_s: float, power: float) -> None:
        dead = dead_samples(lag_s, period_s)
        self._waiting = deque([power] * dead)
        self._steps = _steps(lag_s, period_s)
        self._first = self.felt = power

    def after(self, power: float) -> float:
        """Return the power felt at the end of a period in which `power` was given."""
        self._waiting.append(power)
        first, second = self._steps
        self._first += first * (self._waiting.popleft() - self._first)
        self.felt += second * (self._first - self.felt)
        return self.felt


def felt(power: Array, lag_s: float, period_s: float) -> Array:
    """Return `power`, shape (N,), as felt; before the first it was the same."""
    lagged = LaggedPower(lag_s, period_s, float(power[0]))
    return np.array([lagged.after(each) for each in power.tolist()])
