"""Theta on top of P, in one array, so that an update works on both at once.

One product of the stack with phi predicts the output and gives P phi; one subtraction corrects
theta and P. With a few parameters an update costs what its calls of NumPy cost, and the stack
saves a third of them (``docs/benchmarks.md``).

Implements section 2 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from thermoctl.quantities import Array
from thermoctl.signals import Estimate

Learned = tuple[Array, float, float, float]
"""What a sample makes of a stack: the new one, innovation, its variance, inflation of P."""


@dataclass(frozen=True, slots=True, eq=False)
class Stacked(Estimate):
    """An estimate whose theta and P lie in one array, as the next update wants them.

    Parameters
    ----------
    rows : ndarray, shape (n + 1, n), or None
        theta, then the rows of P. Only `unstacked` fills it: a copy that ``dataclasses.replace``
        makes, perhaps with another theta or P, is without.
    """

    rows: Array | None = field(default=None, init=False, repr=False)


S = TypeVar("S", bound=Stacked)


def stack(belief: Estimate) -> Array:
    """Return theta and P of `belief` in one array, shape (n + 1, n).

    It may be the belief's own: nobody writes to it.
    """
    if isinstance(belief, Stacked) and belief.rows is not None:
        return belief.rows
    n = len(belief.theta)
    rows = np.empty((n + 1, n))
    rows[0], rows[1:] = belief.theta, belief.P
    return rows


def unstacked(
    kind: type[S], rows: Array, innovation: float, innovation_var: float, inflation: float
) -> S:
    """Return the estimate that lies in the read-only `rows`, of this `kind`.

    Where a kind has fields of its own, they are left to the caller.
    """
    belief = object.__new__(kind)
    _set_theta(belief, rows[0])
    _set_P(belief, rows[1:])
    _set_innovation(belief, innovation)
    _set_innovation_var(belief, innovation_var)
    _set_inflation(belief, inflation)
    _set_rejected(belief, False)
    _set_rows(belief, rows)
    return belief


# A frozen dataclass fills its fields through object.__setattr__, which takes twice as long.
_set_theta = vars(Estimate)["theta"].__set__
_set_P = vars(Estimate)["P"].__set__  # noqa: N816 - P keeps its letter
_set_innovation = vars(Estimate)["innovation"].__set__
_set_innovation_var = vars(Estimate)["innovation_var"].__set__
_set_inflation = vars(Estimate)["inflation"].__set__
_set_rejected = vars(Estimate)["rejected"].__set__
_set_rows = vars(Stacked)["rows"].__set__
