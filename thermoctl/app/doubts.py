"""What a configuration may say and had better not: told, and run all the same."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.parts import COOL, HEAT, action_of, plan_for
from thermoctl.app.readings import coarse_readings
from thermoctl.app.settings import Settings

HEADROOM_K: Final = 1.0
"""Least distance from a set point to a trip, under `adaptive` alone. That passes its set point by
0.1 K at most on 19 of 20 tanks (``docs/compare.md``), but a reading that is off by 1 K is still
believed (`jump_k`), and two of them in a row are a trip."""

_ROUGH_HEADROOM_K: Final = 3.0
"""The same under any other law, or with one in the shadow; there `on-off` passes it by 2.3 K."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """One thing that is allowed and will hardly do: its event, loop, key and words."""

    event: str
    loop: str
    key: str
    text: str

    def __str__(self) -> str:
        return f"loops.{self.loop}.{self.key}: {self.text}"


def doubts(settings: Settings) -> list[Doubt]:
    """Return what is allowed in a configuration and will hardly do."""
    coarse = coarse_readings(settings).items()
    found = [Doubt("config.coarse", name, "sensor", text) for name, text in coarse]
    for name, table in settings.loops.items():
        found += [Doubt("config.narrow", name, key, text) for key, text in _narrow(table)]
    return found


def _narrow(table: LoopTable) -> Iterator[tuple[str, str]]:
    """Yield key and words of each set point that a usual overshoot takes over a trip.

    A heater overshoots upwards, a cooler downwards; of set point and limit the first is enough.
    The law in the shadow may be put in charge, so there is room for either.
    """
    action = action_of(plan_for(table).controller)
    kinds = {law.kind for law in (table.controller, table.shadow) if law is not None}
    least_k = HEADROOM_K if kinds == {"adaptive"} else _ROUGH_HEADROOM_K
    low_c, high_c = table.setpoint_range_c
    above = ("setpoint_max_c", high_c, "below", "trip_above_c", table.trip_above_c)
    below = ("setpoint_min_c", low_c, "above", "trip_below_c", table.trip_below_c)
    for side, spared in ((above, COOL), (below, HEAT)):
        key, limit_c, word, trip, trip_c = side
        sign = 1.0 if word == "below" else -1.0
        for name, held_c in (("setpoint_c", table.setpoint_c), (key, limit_c)):
            if action == spared or sign * (trip_c - held_c) >= least_k - 1e-9:
                continue
            got = "none, which allows the trip" if getattr(table, name) is None else f"{held_c:g}"
            text = f"expected {trip_c - sign * least_k:g}, {least_k:g} K {word} {trip}, or farther"
            yield name, f"{text}, got {got}: an overshoot there switches all off until acknowledged"
            break
