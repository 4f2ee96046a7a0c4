"""Loops that give others their set points: what is handed on and comes back."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from thermoctl.runtime.lead import Lead
from thermoctl.runtime.stored_heat import StoredHeat
from thermoctl.runtime.wiring import Wiring
from thermoctl.signals import Measurement, Quality


def outer_first(wirings: Iterable[Wiring]) -> tuple[Wiring, ...]:
    """Return `wirings` in an order in which every loop comes before the one it leads."""
    listed = tuple(wirings)
    master = {each.lead.inner: each.name for each in listed if each.lead is not None}

    def depth(name: str, seen: int = 0) -> int:
        above = master.get(name)
        return seen if above is None or seen > len(listed) else depth(above, seen + 1)

    return tuple(sorted(listed, key=lambda each: depth(each.name)))


def hand_down(wiring: Wiring, power: float, wirings: Mapping[str, Wiring]) -> None:
    """Give the loop that `wiring` leads, if any, the set point for `power`."""
    if wiring.lead is not None:
        setpoint_c = wiring.lead.setpoint_c(power)
        inner = wirings[wiring.lead.inner].regulator
        inner.lead(setpoint_c, released=wiring.regulator.released)


class Cascade:
    """Tells loops that lead others what those gave, and what they still hold.

    Parameters
    ----------
    wirings : iterable of Wiring
        All loops.
    """

    def __init__(self, wirings: Iterable[Wiring]) -> None:
        named = {each.name: each for each in wirings}
        self._leads = [(each, each.lead) for each in named.values() if each.lead is not None]
        followers = [named[lead.inner] for _, lead in self._leads]
        self._stored = {each.name: StoredHeat() for each in followers if _only_heats(each)}
        self.gave: Mapping[str, float] = {}
        """Power that each loop gave in the last cycle; NaN: not known."""

    def tell(self, seen: Mapping[str, Measurement]) -> dict[str, float]:
        """Tell each loop that leads another one what it really gave, and return that."""
        return {outer.name: self._told(outer, lead, seen) for outer, lead in self._leads}

    def _told(self, outer: Wiring, lead: Lead, seen: Mapping[str, Measurement]) -> float:
        bath, block = seen[outer.name], seen[lead.inner]
        taken = lead.taken(bath, block)
        if math.isfinite(taken):
            outer.regulator.applied(taken, self._kept_s(lead.inner, block, bath))
        return taken

    def _kept_s(self, inner: str, block: Measurement, bath: Measurement) -> float:
        """Return for how long a block goes on giving heat that it holds."""
        if inner not in self._stored:
            return 0.0
        power = self.gave.get(inner, math.nan)
        block_c, bath_c = (
            each.temperature_c if each.quality is Quality.GOOD else math.nan
            for each in (block, bath)
        )
        heat = self._stored[inner].after(block.t_s, power, block_c, bath_c)
        self._stored[inner] = heat
        return heat.lasts_s


def _only_heats(wiring: Wiring) -> bool:
    """Return whether the power of a loop is heat, and nothing but the plant takes it back."""
    return len(wiring.outputs) == 1 and not wiring.regulator.plan.limits.power_cools
