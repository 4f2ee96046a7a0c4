"""Loops that give others their set points: who is first, and what is handed on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from thermoctl.runtime.wiring import Wiring


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
