"""Whether the converters that are configured can tell a temperature well enough."""

from __future__ import annotations

import math
from typing import Final

from thermoctl.app.parts import sensor_for
from thermoctl.app.settings import Settings

USUAL, FEWEST = 32, 4
"""Conversions to a reading; from the second on, more of them change little."""

_WORST_K: Final = 0.15
"""Error of a reading of fewer that is too much: see the figures in ``docs/configuration.md``."""

_FEW_BITS_K: Final = 0.6
"""A step that noise does not cross, so that no number of conversions tells more than one."""


def coarse_readings(settings: Settings) -> dict[str, str]:
    """Return what is wrong with readings, by loop; nothing where they are good.

    Only a board whose settings tell bits and conversions can be judged.
    """
    told = {name: _coarse(settings, name) for name in settings.loops}
    return {name: text for name, text in told.items() if text}


def _coarse(settings: Settings, name: str) -> str:
    """Return what to say of the readings of a loop, empty where they are good."""
    table = settings.loops[name]
    board = None if table.sensor is None else settings.boards.get(table.sensor.board)
    bits, conversions = getattr(board, "bits", None), getattr(board, "conversions", None)
    if table.sensor is None or bits is None or conversions is None:
        return ""
    sensor = sensor_for(table.sensor)
    fraction = sensor.fraction(table.setpoint_c)
    step_k = abs(sensor.temperature_c(fraction + 2.0**-bits) - table.setpoint_c)
    k_per_mv = step_k * 2.0**bits / (1e3 * sensor.reference_v)
    noise_k = k_per_mv * getattr(board, "noise_mv", 0.0)
    pickup_k = k_per_mv * getattr(board, "pickup_mv", 0.0)
    once_k = math.hypot(step_k / math.sqrt(12.0), noise_k, pickup_k / math.sqrt(2.0))
    where = f"boards.{table.sensor.board}"
    if step_k > _FEW_BITS_K:
        advice = f"take a converter of more bits, 10 with conversions = {USUAL} at least"
    elif conversions < FEWEST and once_k / math.sqrt(conversions) > _WORST_K:
        advice = f"set conversions to {USUAL}, {FEWEST} at least, which averages them"
    else:
        return ""
    return (
        f"a conversion of {where} is in steps of {1e3 * step_k:.0f} mK and is off by"
        f" {1e3 * once_k:.0f} mK, and a reading is made of {conversions}: that spoils regulation"
        f" and learning; {advice}"
    )
