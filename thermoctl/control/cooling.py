"""Heat that one signed power brings in or takes out, in units of the heater's."""

from __future__ import annotations

RATIO_MIN, RATIO_MAX = 0.02, 10.0
"""Bounds of the cooling ratio: what a cooler takes out at full power over what the heater beside it
brings in."""


def heat_of(power: float, ratio: float) -> float:
    """Return the heat of `power`: less of it below 0 where a cooler is weaker."""
    return power * ratio if power < 0.0 else power


def power_for_heat(heat: float, ratio: float) -> float:
    """Return the power that gives `heat`."""
    return heat / ratio if heat < 0.0 else heat
