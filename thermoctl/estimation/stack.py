"""Theta on top of P, in one array, so that an update works on both at once.

One product of the stack with phi predicts the output and gives P phi; one subtraction corrects
theta and P. With a few parameters an update costs what its calls of NumPy cost, and the stack
saves a third of them (``docs/benchmarks.md``).

Implements section 2 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from thermoctl.filling import quickly_filled
from thermoctl.quantities import Array, frozen
from thermoctl.signals import Estimate

Learned = tuple[Array, float, float, float]
"""What a sample makes of a stack: the new one, innovation, its variance, inflation of P."""

LearnedOne = tuple[float, float, float, float, float]
"""The same of one parameter: theta, P, innovation, its variance, inflation of P."""


@quickly_filled
@dataclass(frozen=True, slots=True, eq=False)
class Stacked(Estimate):
    """An estimate whose theta and P lie in one array, as the next update wants them.

    Parameters
    ----------
    rows : ndarray, shape (n + 1, n), or None
        theta, then the rows of P. It counts only while theta and P lie in it, which they no longer
        do in a copy that ``dataclasses.replace`` makes with another theta or P.
    """

    rows: Array | None = field(default=None, repr=False)


def stack(belief: Estimate) -> Array:
    """Return theta and P of `belief` in one array, shape (n + 1, n).

    It may be the belief's own: nobody writes to it.
    """
    if isinstance(belief, Stacked):
        rows = belief.rows
        if belief.theta.base is rows and belief.P.base is rows and rows is not None:
            return rows
    n = len(belief.theta)
    rows = np.empty((n + 1, n))
    rows[0], rows[1:] = belief.theta, belief.P
    return rows


def stacked_one(theta: float, P: float) -> Array:
    """Return the stack of one parameter, read-only."""
    rows = np.empty((2, 1))
    rows[0, 0], rows[1, 0] = theta, P
    return frozen(rows)


def unstacked(learned: Learned) -> Stacked:
    """Return the estimate that lies in what was `learned`."""
    rows, innovation, innovation_var, inflation = learned
    return Stacked(rows[0], rows[1:], innovation, innovation_var, inflation, False, rows)
