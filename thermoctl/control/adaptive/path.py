"""Power on its way into the water: through dead time and heater, known exactly.

It was applied, so nothing of it has to be estimated; that is what leaves the filters linear.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from thermoctl.control.adaptive.hypotheses import Hypotheses
from thermoctl.quantities import Array


class Path(NamedTuple):
    """Where the applied power is, under every hypothesis.

    Parameters
    ----------
    powers : ndarray, shape (longest dead time + 1,)
        Applied power of the past periods, newest first.
    pending : ndarray, shape (n,)
        Sum of the powers within the dead time, newest included: ``powers[:dead].sum()``.
    heat : ndarray, shape (n,)
        Power q that reaches the water at the end of the last period.
    mean : ndarray, shape (n,)
        The same in the mean of that period.
    """

    powers: Array
    pending: Array
    heat: Array
    mean: Array


def at_rest(hypotheses: Hypotheses) -> Path:
    """Return the path of a plant that never got any power."""
    n = len(hypotheses)
    return Path(np.zeros(int(hypotheses.dead.max()) + 1), *np.zeros((3, n)))


def pushed(path: Path, hypotheses: Hypotheses, power: float) -> Path:
    """Return the path one period later, during which `power` was applied."""
    powers = np.empty_like(path.powers)
    powers[0] = power
    powers[1:] = path.powers[:-1]
    leaving = powers[hypotheses.dead]  # u[k-1-nd]
    pending = power - leaving
    pending += path.pending
    owed = leaving - path.heat
    mean = owed * hypotheses.element_late
    np.subtract(leaving, mean, out=mean)
    owed *= hypotheses.element_step
    owed += path.heat
    return Path(powers, pending, owed, mean)
