"""What outlives a restart of what is known of a heater.

That is its gain, its lag, and how the plant cools. Without it every start begins with a heater of
which nothing is known, and a plant at rest shows nothing: the power that holds it would be cut to
see whether it heats.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from thermoctl.ranges import number
from thermoctl.regulator.heater.response import COOLS_MOST, LAGS_S, Gain

NAME: Final = "heater-check"
"""Key of the heater in the record, beside the models of the laws."""
COOLER_NAME: Final = "cooler-check"
"""Key of the cooler, where there is one beside the heater."""
GAIN_MOST = 1e3
"""Largest gain in K/s that is recalled."""


def remember(known: Gain) -> dict[str, float]:
    """Return what is kept of a heater that is known."""
    return {
        "gain_k_per_s": known.mean,
        "gain_sd_k_per_s": known.sd,
        "lag_s": known.lag_s,
        "cools_per_s": known.cools_per_s,
    }


def recall(model: Mapping[str, Any]) -> Gain:
    """Return what was kept.

    Raises
    ------
    ValueError
        It is not what `remember` returns.
    """
    ranges = {
        "gain_k_per_s": (1e-9, GAIN_MOST),
        "gain_sd_k_per_s": (0.0, GAIN_MOST),
        "lag_s": (LAGS_S[0], LAGS_S[-1]),
        "cools_per_s": (0.0, COOLS_MOST),
    }
    if set(model) != set(ranges):
        raise ValueError(f"expected {sorted(ranges)}, got {sorted(model)}")
    mean, sd, lag_s, cools_per_s = (number(model, name, *each) for name, each in ranges.items())
    nearest = min(range(len(LAGS_S)), key=lambda place: abs(LAGS_S[place] - lag_s))
    return Gain(mean, sd, nearest, cools_per_s)
