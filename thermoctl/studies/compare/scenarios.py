"""What befalls a plant, and over which stretch it is judged: scenarios as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

SETPOINT = "setpoint"
"""Name of a happening that is no mishap: the operator asks for `amount` degC more."""

HELD_C = 37.5
"""Set point of O21, which every scenario on a tank begins with."""

BAND_K = 0.1
"""A tank has settled within this of the set point: ten times what nobody can avoid on the rig."""


@dataclass(frozen=True, slots=True)
class Happening:
    """One thing that befalls the plant.

    Parameters
    ----------
    at_s : float
        When, from the beginning of the stretch that is judged; negative: before it.
    name : str
        What `thermoctl.studies.compare.stand` can do to the plant, or `SETPOINT`.
    amount : float or None
        In the unit of the disturbance; None for its default.
    """

    at_s: float
    name: str
    amount: float | None = None


@dataclass(frozen=True, slots=True)
class Scenario:
    """A run: the controller is given time to settle, then something happens.

    Times are those of the rig; on another plant they are multiplied by its `pace`, except for the
    length of a stretch that is `steady`.

    Parameters
    ----------
    name : str
        What it is called in tables.
    judged_s : float
        Length of the stretch that is judged.
    happenings : tuple of Happening
        What befalls the plant, in the order of time.
    measures : tuple of str
        Names of the measures in the table.
    from_cold : bool
        Judged from the first sample on; else after the controller has had time to settle.
    steady : bool
        Nothing happens and the length is kept on every plant: an hour is an hour.
    """

    name: str
    judged_s: float
    happenings: tuple[Happening, ...] = ()
    measures: tuple[str, ...] = ("overshoot_k", "settled_s")
    from_cold: bool = False
    steady: bool = False

    @property
    def before_s(self) -> float:
        """How long before the judged stretch the first thing happens."""
        return max(0.0, *(-each.at_s for each in self.happenings), 0.0)


_RECOVERY = ("overshoot_k", "settled_s", "largest_k")

_ALL = (
    Scenario("warm-up", 1200.0, from_cold=True),
    Scenario(
        "regulation",
        3600.0,
        measures=("deviation_k", "largest_k", "travel_per_min"),
        steady=True,
    ),
    Scenario("step", 1200.0, (Happening(0.0, SETPOINT, 2.5),)),
    Scenario("cold-water", 1500.0, (Happening(0.0, "cold-water"),), measures=_RECOVERY),
    Scenario("ice", 1500.0, (Happening(0.0, "ice"),), measures=_RECOVERY),
    Scenario(
        "spike-dropout",
        600.0,
        (Happening(0.0, "spike", 20.0), Happening(60.0, "dropout", 15.0)),
        measures=("largest_k",),
    ),
    Scenario("stirrer-stops", 900.0, (Happening(0.0, "stirrer"),), measures=("largest_k",)),
    Scenario(
        "stirrer-back",
        900.0,
        (Happening(-900.0, "stirrer"), Happening(0.0, "stirrer")),
        measures=("largest_k",),
    ),
    Scenario("half-gone", 1200.0, (Happening(0.0, "half-gone", 0.5),), measures=("largest_k",)),
    Scenario("second-heater", 1200.0, (Happening(0.0, "second-heater", 0.5),), measures=_RECOVERY),
)

SCENARIOS: Mapping[str, Scenario] = {each.name: each for each in _ALL}
"""Every scenario by name; `docs/compare.md` describes them."""
