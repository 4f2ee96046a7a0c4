"""Cascades: why one loop may not lead another, and how a follower is set up."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from thermoctl.app import plugins
from thermoctl.app.configuration.bases import Options
from thermoctl.app.configuration.device_tables import CascadeTable
from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.plugins import nearest

BLOCK_LAGS = {"shortest_s": 1.0, "longest_s": 60.0}
"""Lags of what heats another loop: a block, a jacket or an oven, and no vessel of 200 l. A law that
takes a block of 5 s for one of 150 s believes in no gain of several K/s, and never learns it."""
BLOCK_JUMP_K = 25.0
"""What a block may be warmed by in a sample: one of 50 J/K by 1 kW is, by 20 K in a second. By what
a vessel may jump every warm-up of a block is a row of outliers, and ends in SAFE time and again."""


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


def as_blocks(loops: Mapping[str, LoopTable]) -> dict[str, LoopTable]:
    """Return `loops`, of which those that follow may be as quick as a block.

    Those that drive an output have `BLOCK_LAGS`, where a law knows of lags, and `BLOCK_JUMP_K`.
    What is configured stays.
    """
    followers = {each.leads.loop for each in loops.values() if each.leads is not None}
    return {
        name: _as_block(table) if name in followers and table.leads is None else table
        for name, table in loops.items()
    }


def _as_block(table: LoopTable) -> LoopTable:
    laws = {"controller": table.controller, "shadow": table.shadow}
    changed: dict[str, Any] = {
        name: Options.model_validate({**law.model_dump(), "lags": BLOCK_LAGS})
        for name, law in laws.items()
        if law is not None and _wants_lags(law)
    }
    if "jump_k" not in table.model_fields_set:
        changed["jump_k"] = BLOCK_JUMP_K
    return table.model_copy(update=changed)


def _wants_lags(law: Options) -> bool:
    """Return whether it has lags that nobody has configured."""
    known = plugins.option_names(plugins.find(plugins.CONTROLLERS, law.kind))
    return "lags" in known and "lags" not in law.options
