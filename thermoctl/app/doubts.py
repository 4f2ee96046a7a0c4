"""What a configuration may say and had better not: told, and run all the same."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.parts import COOL, HEAT, action_of, plan_for
from thermoctl.app.readings import coarse_readings
from thermoctl.app.settings import Settings

NO_HARDWARE: Final = ("null", "simulated")
"""Kinds of boards that heat nothing."""

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
        boards = [settings.boards.get(each.board) for each in table.outputs]
        if not all(getattr(each, "kind", "") in NO_HARDWARE for each in boards):
            found += [Doubt("config.unstated", name, key, text) for key, text in _unstated(table)]
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


def _unstated(table: LoopTable) -> Iterator[tuple[str, str]]:
    """Yield key and words where nothing says what a heater that is sound does at least.

    Of one that nobody has seen to heat, a weak one and a sensor that hangs beside its tank look
    alike until the heat of all that time should have shown.
    """
    check = table.heater_check
    told = check.weakest_k_per_s is not None or table.volume_l is not None
    if told or not check.enabled or action_of(plan_for(table).controller) == COOL:
        return
    key, got = ("heater_w", "neither") if table.heater_w is None else ("volume_l", "watts alone")
    text = f"expected heater_w and volume_l, or weakest_k_per_s in heater_check, got {got}"
    yield key, f"{text}: a heater dead from the start, or a sensor beside its tank, is told late"
