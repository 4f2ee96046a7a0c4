"""What may be asked of an output: a number, and how long it holds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from thermoctl.errors import FaultError
from thermoctl.quantities import clamp, is_finite_number


def commanded(name: str, power: Any, valid_for_s: Any, longest_s: float) -> tuple[float, float]:
    """Return `power` within [0, 1] and how long it holds, at most `longest_s`.

    NaN is a power that nobody could compute, and becomes 0. What is infinite or no number at all
    is a fault of whoever asked, and must not come out as full power.

    Raises
    ------
    FaultError
        `power` or `valid_for_s` is no such number; the caller gives power 0.
    """
    for what, value in ((name, power), (f"validity of {name}", valid_for_s)):
        if not (is_finite_number(value) or _is_nan(value)):
            raise FaultError(f"{what}: expected a finite number, got {value!r}")
    return clamp(power, 0.0, 1.0), clamp(valid_for_s, 0.0, longest_s)


def _is_nan(value: Any) -> bool:
    return isinstance(value, float | np.floating) and math.isnan(value)
