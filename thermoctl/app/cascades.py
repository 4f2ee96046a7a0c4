"""Loops that lead loops: what keeps them from it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from thermoctl.app.configuration.tables import CascadeTable, LoopTable
from thermoctl.app.plugins import nearest


def cascade_errors(loops: Mapping[str, LoopTable]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield a path below ``loops`` and a reason for every cascade that cannot be."""
    masters: dict[str, str] = {}
    for name, table in loops.items():
        lead = table.leads
        if lead is None:
            continue
        path = (name, "actuator", "loop")
        if lead.loop not in loops:
            yield path, f"no table [loops.{lead.loop}] there{nearest(lead.loop, loops)}"
        elif lead.loop in masters:
            yield path, f"{lead.loop} follows {masters[lead.loop]} already"
        elif _comes_back(name, loops):
            yield path, f"following {lead.loop} leads back to {name}"
        else:
            masters[lead.loop] = name
            yield from _range_errors(name, lead, loops[lead.loop])
        if table.cooler is not None:
            yield (name, "cooler"), f"expected none, for {lead.loop} is what acts in this loop"


def _comes_back(name: str, loops: Mapping[str, LoopTable]) -> bool:
    """Return whether following the loops from `name` on never comes to an end."""
    at = name
    for _ in loops:
        lead = loops[at].leads if at in loops else None
        if lead is None:
            return False
        at = lead.loop
    return True


def _range_errors(
    name: str, lead: CascadeTable, inner: LoopTable
) -> Iterator[tuple[tuple[str, ...], str]]:
    low_c, high_c = inner.setpoint_range_c
    for key, value in (("low_c", lead.low_c), ("high_c", lead.high_c)):
        if not low_c <= value <= high_c or value >= inner.trip_above_c:
            yield (
                (name, "actuator", key),
                f"expected a set point of {lead.loop}, {low_c:g} to {high_c:g} and below its trip "
                f"at {inner.trip_above_c:g}, got {value:g}",
            )
