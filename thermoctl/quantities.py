"""Units, and the few numbers and functions of numbers that every room shares.

A float with a dimension wears it in its name: ``_s`` seconds, ``_c`` degrees Celsius, ``_k`` kelvin
(a difference), ``_w`` watts, ``_v`` volts. Power is a fraction in [0, 1] and is called ``power``;
with a cooler beside the heater it goes down to -1.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
_Values = TypeVar("_Values", bound=npt.NDArray[Any])

_NUMBERS = (int, float, np.integer, np.floating)

ZERO_CELSIUS_K = 273.15
"""0 degC in kelvin, exact by definition."""

WATER_J_PER_L_K = 4186.0
"""Heat that warms a litre of water by a kelvin, as litres are reckoned from watts."""


class Uncertain(NamedTuple):
    """A quantity and its standard deviation, in one unit; NaN where nothing is known."""

    mean: float = math.nan
    sd: float = math.nan

    def scaled(self, factor: float) -> Uncertain:
        """Return both times `factor`."""
        return Uncertain(self.mean * factor, self.sd * abs(factor))

    def over(self, other: Uncertain) -> Uncertain:
        """Return the quotient of two whose errors are independent."""
        mean = self.mean / other.mean
        shares = math.hypot(self.sd / self.mean if self.mean else 0.0, other.sd / other.mean)
        own = self.sd / abs(other.mean)
        return Uncertain(mean, abs(mean) * shares if self.mean else own)


def is_finite_number(value: Any) -> bool:
    """Return whether `value` is a finite real number; bool is none."""
    if type(value) is float:  # nearly always, a dozen times a sample
        return math.isfinite(value)
    if isinstance(value, bool) or not isinstance(value, _NUMBERS):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond every float
        return False


def frozen(values: _Values) -> _Values:
    """Return `values` after making the array read-only."""
    values.setflags(False)  # type: ignore[call-arg]  # `write`: by its name it takes twice as long
    return values


def clamp(value: float, low: float, high: float) -> float:
    """Return `value` limited to [low, high]; NaN becomes `low`, the safe end."""
    if not value >= low:  # written so that NaN fails too
        return low
    return high if value > high else value  # a call of `min` would take as long as all the rest
