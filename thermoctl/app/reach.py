"""Whether the sensors of a loop can show its limits at all."""

from __future__ import annotations

import math
from collections.abc import Iterator

from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.plugins import BadOption
from thermoctl.model.sensor import Sensor

_ROOM_C, _ROOM_VOLTS = 25.0, ("lm335", "lm35", "tmp36")  # which are made to show that
_HALVINGS = 50
_LEAST_K = 1.0


def reach_errors(table: LoopTable, part: str, sensor: Sensor) -> Iterator[BadOption]:
    """Yield each limit of a loop that its `sensor`, of table `part`, cannot show.

    Beyond its ends a sensor counts as broken, so a trip out there would never act.
    """
    coldest_c, hottest_c = reach_c(sensor)
    resistor_ohm = getattr(table, part).pull_up_ohm
    if resistor_ohm is not None and not hottest_c - coldest_c > _LEAST_K:  # NaN is no reach at all
        text = "expected a resistor with which the converter can tell the sensor's temperatures"
        yield BadOption(f"{text}, got {resistor_ohm:g} ohm", (part, "pull_up_ohm"))
        return
    if not coldest_c < table.setpoint_c < hottest_c:
        if getattr(table, part).curve in _ROOM_VOLTS and not coldest_c < _ROOM_C < hottest_c:
            text = f"expected a converter that can show a room, got {sensor.reference_v:g} V"
            yield BadOption(text, (part, "reference_v"))
            return
        text = f"expected what the sensor can show, {coldest_c:.1f} to {hottest_c:.1f} °C"
        yield BadOption(f"{text}, got {table.setpoint_c:g}", ("setpoint_c",))
    if not table.trip_above_c < hottest_c:
        text = f"expected less than the {hottest_c:.1f} °C that the sensor can show at most"
        yield BadOption(f"{text}, got {table.trip_above_c:g}", ("trip_above_c",))
    if "trip_below_c" in table.model_fields_set and not table.trip_below_c > coldest_c:
        text = f"expected more than the {coldest_c:.1f} °C that the sensor shows at least"
        yield BadOption(f"{text}, got {table.trip_below_c:g}", ("trip_below_c",))


def reach_c(sensor: Sensor) -> tuple[float, float]:
    """Return the coldest and the hottest temperature that `sensor` can show, in degC."""
    ends_c = [_last_shown_c(sensor, end) for end in (sensor.short_below, sensor.open_above)]
    return min(ends_c), max(ends_c)


def _last_shown_c(sensor: Sensor, end: float) -> float:
    """Return what is shown at fraction `end`, or where the curve stops on the way there."""
    if math.isfinite(shown_c := sensor.temperature_c(end)):
        return shown_c
    room = sensor.fraction(_ROOM_C)  # on every curve, though not on every converter
    shown, blind = min(max(room, sensor.short_below), sensor.open_above), end
    for _ in range(_HALVINGS):
        middle = 0.5 * (shown + blind)
        if math.isfinite(sensor.temperature_c(middle)):
            shown = middle
        else:
            blind = middle
    return sensor.temperature_c(shown)
