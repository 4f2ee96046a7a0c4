"""Heat, water and ice that a temperature amounts to.

What the heater warms is more than water: glass, element and fittings take their share. They are
counted as water here, so a volume is that of as much water as would behave alike.
"""

from __future__ import annotations

from thermoctl.plant.parameters import FUSION_J_PER_KG, WATER_J_PER_KG_K, WATER_KG_PER_L

COLD_C = 10.0
"""Temperature of the water that a loss is compared with: that of a cold tap."""


def capacity_j_per_k(heater_w: float, gain_k_per_s: float) -> float:
    """Return the heat capacity that `heater_w` warms at `gain_k_per_s`."""
    return heater_w / gain_k_per_s


def litres(capacity: float) -> float:
    """Return the water that has a heat capacity, in J/K."""
    return capacity / (WATER_J_PER_KG_K * WATER_KG_PER_L)


def cold_water_kg(capacity: float, fall_k: float, temperature_c: float) -> float | None:
    """Return how much water of `COLD_C` makes a fall; None: none does.

    Parameters
    ----------
    capacity : float
        Of what is in the vessel, in J/K.
    fall_k : float
        How far it fell, positive.
    temperature_c : float
        Where it fell from, in degC.
    """
    left_k = temperature_c - fall_k - COLD_C
    return capacity * fall_k / (WATER_J_PER_KG_K * left_k) if left_k > 0.0 else None


def ice_kg(capacity: float, fall_k: float, temperature_c: float) -> float | None:
    """Return how much ice of 0 degC makes a fall; None: none does."""
    after_c = temperature_c - fall_k
    if after_c < 0.0:
        return None
    return capacity * fall_k / (FUSION_J_PER_KG + WATER_J_PER_KG_K * after_c)
