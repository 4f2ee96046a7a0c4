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
    if not _is_number(power):
        raise FaultError(f"{name}: expected a finite number, got {power!r}")
    if not _is_number(valid_for_s):
        raise FaultError(f"validity of {name}: expected a finite number, got {valid_for_s!r}")
    return clamp(power, 0.0, 1.0), clamp(valid_for_s, 0.0, longest_s)


def _is_number(value: Any) -> bool:
    """Return whether `value` is finite, or NaN."""
    return is_finite_number(value) or (isinstance(value, float | np.floating) and math.isnan(value))
