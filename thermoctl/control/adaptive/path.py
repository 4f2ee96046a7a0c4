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
    under_way : ndarray, shape (n,)
        Sum of what was applied less what has reached the water: what dead time and heater hold.
    heat : ndarray, shape (n,)
        Power q that reaches the water at the end of the last period.
    mean : ndarray, shape (n,)
        The same in the mean of that period.
    """

    powers: Array
    under_way: Array
    heat: Array
    mean: Array


def at_rest(hypotheses: Hypotheses, power: float = 0.0) -> Path:
    """Return the path of a plant that has had this `power` for long."""
    powers = np.full(int(hypotheses.dead.max()) + 1, power)
    heat = np.full(len(hypotheses), power)
    return Path(powers, power * hypotheses.held, heat, heat)


def pushed(path: Path, hypotheses: Hypotheses, power: float) -> Path:
    """Return the path one period later, during which `power` was applied."""
    powers = np.empty(len(path.powers))
    powers[0] = power
    powers[1:] = path.powers[:-1]
    entering = powers[hypotheses.dead]  # u[k-1-nd], into the heater
    owed = entering - path.heat
    mean = entering - owed * hypotheses.element_late
    heat = path.heat + owed * hypotheses.element_step
    under_way = path.under_way + power
    under_way -= mean
    return Path(powers, under_way, heat, mean)
