"""What the plant might be: total lags times four ways of dividing them.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
import numpy.typing as npt

from thermoctl.control.adaptive.constants import Lags
from thermoctl.quantities import Array, frozen
from thermoctl.ranges import require

SHAPES = ((0.18, 0.31, 0.51), (0.10, 0.75, 0.15), (0.05, 0.10, 0.85), (0.18, 0.31, 0.51))
"""Shares of dead time, heater and sensor: all in even parts, a slow heater, and a sensor so slow
that dead time hardly counts beside it. With dead time of .10 its first readings, which rise at
once, would speak for a shorter lag, and the water be far too hot before it is known. The fourth is
the first, as long as its lag is short; from there on a pipe is before the sensor."""
PIPE = 3
"""Number of the shape of which heater and sensor together are no slower than `Lags.pipe_beyond_s`:
what its lag has beyond is dead time. Water that comes through a pipe rises late and then all at
once, which to any other shape is a long lag and a gain far too large. No more dead time than that:
were it a share of each lag, short ones as well, plants without a pipe would be taken for one."""

PERIOD_MIN_S, PERIOD_MAX_S = 0.05, 3600.0
ANY = Lags()


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """Constants of every hypothesis at one period; arrays of shape (n,), read-only.

    Parameters
    ----------
    period_s : float
        Time from one sample to the next.
    lag_s : ndarray
        Total lag L: dead time, heater and sensor together.
    lag_squared, lag_inverse : ndarray
        Its square in s^2, and one over it, in 1/s.
    dead : ndarray of int
        Dead time in whole periods.
    element, sensor : ndarray
        Time constants of heater and sensor in periods.
    held : ndarray
        Periods for which power is under way, through dead time and heater.
    element_step, sensor_step : ndarray
        What heater and sensor make up of a step within a period, in (0, 1].
    element_late, sensor_soon : ndarray
        How much of a step the heater owes in the mean of a period, and how much of a ramp that
        begins with a period the sensor shows at its end, in (0, 1).
    """

    period_s: float
    lag_s: Array
    lag_squared: Array
    lag_inverse: Array
    dead: npt.NDArray[np.intp]
    element: Array
    sensor: Array
    held: Array
    element_step: Array
    sensor_step: Array
    element_late: Array
    sensor_soon: Array

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if isinstance(value, np.ndarray):
                frozen(value)

    @classmethod
    def at_period(cls, period_s: float, lags: Lags = ANY) -> Self:
        """Return all of `lags` times `SHAPES`, lag by lag.

        Raises
        ------
        ValueError
            `period_s` lies outside .05 to 3,600 s.
        """
        require("period_s", period_s, PERIOD_MIN_S, PERIOD_MAX_S)
        lag_s = np.repeat(lags.each_s, len(SHAPES))
        parts = np.tile(np.array(SHAPES), (lags.count, 1)).T * lag_s
        slow = parts[1:, PIPE :: len(SHAPES)]
        slow *= np.minimum(lags.pipe_beyond_s / slow.sum(axis=0), 1.0)
        dead_s, element_s, sensor_s = lag_s - parts[1] - parts[2], parts[1], parts[2]
        dead = np.rint(dead_s / period_s)
        element, sensor = element_s / period_s, sensor_s / period_s
        element_step, sensor_step = -np.expm1(-1.0 / element), -np.expm1(-1.0 / sensor)
        return cls(
            period_s=float(period_s),
            lag_s=lag_s,
            lag_squared=lag_s * lag_s,
            lag_inverse=1.0 / lag_s,
            dead=dead.astype(np.intp),
            element=element,
            sensor=sensor,
            held=dead + element,
            element_step=element_step,
            sensor_step=sensor_step,
            element_late=element * element_step,
            sensor_soon=1.0 - sensor * sensor_step,
        )

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.lag_s)
