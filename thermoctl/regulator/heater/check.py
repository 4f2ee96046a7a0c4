"""Settings of the heater check, and the least gain that is taken for healthy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Protocol

from thermoctl.quantities import WATER_J_PER_L_K, clamp
from thermoctl.ranges import check_ranges, ranged

WEAKEST_K_PER_S = 6e-5
"""Least gain in K/s of a healthy plant where nothing is configured: 50 W in 200 l."""
WEAKEST_RANGE_K_PER_S = 1e-6, 0.5
POWER_RANGE = 1e-6, 1.0
LARGEST_J_PER_K = 400.0 * WATER_J_PER_L_K
"""Largest heat capacity of a plant in J/K: twice that of 200 l of water, to allow for the vessel
and for losses meanwhile."""
HEALTHY_SHARE = 0.2
"""Share of the rise by litres and watts that a sound plant makes at least, for vessel, losses and
what was misjudged."""


@dataclass(frozen=True, slots=True)
class HeaterCheck:
    """Settings of the heater check.

    Parameters
    ----------
    weakest_k_per_s : float
        Least rise at full power that a healthy plant can have, in K/s.
    first_heat_s : float
        Seconds of full power an unknown heater has to show that it heats, before it is asked. Less
        power has longer, by its cube: it does less harm, and a plant that is only held at its set
        point shows no rise. The most power that the loop gives has longer by its square.
    action : {'heat', 'cool', 'heat-cool'}
        What power does to the plant; heat-cool: above 0 the one and below 0 the other.
    block_c : tuple of float, optional
        Where another loop acts in place of a heater: its temperatures at power 0 and 1, in degC.
    power_max, cooler_max : float
        Most power the loop gives, and most of the cooler beside the heater. What is said of full
        power holds for these.

    Raises
    ------
    ValueError
        An argument is outside its range.
    """

    weakest_k_per_s: float = ranged(WEAKEST_K_PER_S, *WEAKEST_RANGE_K_PER_S)
    first_heat_s: float = ranged(60.0, 10.0, 3600.0)
    action: Literal["heat", "cool", "heat-cool"] = "heat"
    block_c: tuple[float, float] | None = None
    power_max: float = ranged(1.0, *POWER_RANGE)
    cooler_max: float = ranged(1.0, *POWER_RANGE)

    def __post_init__(self) -> None:
        check_ranges(self)
        if self.action not in ("heat", "cool", "heat-cool"):
            raise ValueError(f"action must be 'heat', 'cool' or 'heat-cool', got {self.action!r}")

    @property
    def of_heater(self) -> HeaterCheck:
        """How the heater is checked, where there is a cooler beside it."""
        return replace(self, action="heat")

    @property
    def of_cooler(self) -> HeaterCheck:
        """How that cooler is checked; no least gain is configured for it."""
        weakest_k_per_s = min(self.weakest_k_per_s, WEAKEST_K_PER_S)
        return replace(
            self,
            action="cool",
            weakest_k_per_s=weakest_k_per_s,
            power_max=self.cooler_max,
        )


class Reacts(Protocol):
    """Who is told of a fault, and switches off: the supervisor."""

    def fail(self, code: str, fault: int | None, text: str, t_s: float) -> None:
        """Go to SAFE."""
        ...

    def latch(self, code: str, fault: int | None, text: str, t_s: float) -> None:
        """Go to LATCHED."""
        ...


def weakest_of(heater_w: float | None, volume_l: float | None = None) -> float:
    """Return the least rise in K/s at full power that a sound heater makes.

    4 kW warm no vessel as slowly as 50 W may. Where the power is not known, 50 W are assumed.

    Parameters
    ----------
    heater_w, volume_l : float or None
        Its power in W, and the water that it warms in l; None: not known.
    """
    if heater_w is not None and volume_l is not None:
        rate = HEALTHY_SHARE * heater_w / (WATER_J_PER_L_K * volume_l)
        return clamp(rate, *WEAKEST_RANGE_K_PER_S)
    rate = 0.0 if heater_w is None else heater_w / LARGEST_J_PER_K
    return clamp(rate, WEAKEST_K_PER_S, WEAKEST_RANGE_K_PER_S[1])
