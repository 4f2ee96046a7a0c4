"""How a heater is checked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from thermoctl.ranges import check_ranges, ranged


@dataclass(frozen=True, slots=True)
class HeaterCheck:
    """How a heater is checked.

    Parameters
    ----------
    weakest_k_per_s : float
        Least rise at full power that a healthy plant can have, in K/s; 6e-5 is 50 W in 200 l.
    first_heat_s : float
        Seconds of full power an unknown heater has to show that it heats, before it is asked. Less
        power has longer, by its cube: it does less harm, and a plant that is only held at its set
        point shows no rise.
    action : {'heat', 'cool'}
        What power does to the plant.

    Raises
    ------
    ValueError
        An argument is outside its range.
    """

    weakest_k_per_s: float = ranged(6e-5, 1e-6, 0.5)
    first_heat_s: float = ranged(60.0, 10.0, 3600.0)
    action: Literal["heat", "cool"] = "heat"

    def __post_init__(self) -> None:
        check_ranges(self)
        if self.action not in ("heat", "cool"):
            raise ValueError(f"action must be 'heat' or 'cool', got {self.action!r}")
