"""Quantities in words: digits deserved, true minus, no NaN."""

from __future__ import annotations

import math

UNKNOWN = "–"


def number(value: float, sd: float) -> str:
    """Return `value` ± two standard deviations with the decimals that ± deserves."""
    if not (math.isfinite(value) and math.isfinite(sd)):
        return UNKNOWN
    spread = 2.0 * sd
    if not 1e-9 < spread < 1e6 or abs(value) > 1e9:
        return f"{value:.4g} ± {spread:.2g}".replace("-", "−")
    decimals = max(0, 1 - math.floor(math.log10(spread)))
    return f"{_signed(value, f'.{decimals}f')} ± {spread:.{decimals}f}"


def plain(value: float, decimals: int = 0) -> str:
    """Return `value` with this number of decimals, and a true minus."""
    return _signed(value, f",.{decimals}f") if math.isfinite(value) else UNKNOWN


def _signed(value: float, digits: str) -> str:
    """Return `value` with a true minus, and none before a zero."""
    return f"{value:z{digits}}".replace("-", "−")
