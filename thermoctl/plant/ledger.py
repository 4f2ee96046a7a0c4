"""The books of energy and mass: what came, what went, and what is there."""

from __future__ import annotations

from dataclasses import dataclass

from thermoctl.plant.parameters import FUSION_J_PER_KG
from thermoctl.plant.thermal import Heat


def stored_j(heat: Heat) -> float:
    """Return the enthalpy of tank and bath; water of 0 degC has none."""
    ice_j = -FUSION_J_PER_KG * (heat.ice_kg + heat.bath_ice_kg)
    return heat.element_j + heat.water_j + heat.still_j + heat.wall_j + heat.bath_j + ice_j


def stored_kg(heat: Heat) -> float:
    """Return all water and ice, the bath's included."""
    return heat.water_kg + heat.ice_kg + heat.bath_kg + heat.bath_ice_kg


@dataclass(frozen=True, slots=True)
class Ledger:
    """Two states of one tank and what has crossed its boundary between them.

    The boundary runs around tank and bath. Ice that is added counts as poured, with its negative
    enthalpy.

    Parameters
    ----------
    before, after : Heat
        The states; `before` is the older one.
    """

    before: Heat
    after: Heat

    def _crossed(self, name: str) -> float:
        """Return what the counter `name` has gained."""
        gained: float = getattr(self.after, name) - getattr(self.before, name)
        return gained

    @property
    def gained_j(self) -> float:
        """Rise of the stored enthalpy in J."""
        return stored_j(self.after) - stored_j(self.before)

    @property
    def electric_j(self) -> float:
        """Electrical energy that came in, in J."""
        return self._crossed("electric_j")

    @property
    def poured_j(self) -> float:
        """Enthalpy of what was poured or thrown in, in J; negative for ice."""
        return self._crossed("poured_j")

    @property
    def lost_j(self) -> float:
        """Heat that went to room, vapour, drain and cooler, in J."""
        gone = ("room_j", "vapour_j", "drained_j", "cooled_j")
        return sum(self._crossed(name) for name in gone)

    @property
    def error_j(self) -> float:
        """What the balance of energy misses, in J: nothing but rounding."""
        return self.gained_j - (self.electric_j + self.poured_j - self.lost_j)

    @property
    def error_kg(self) -> float:
        """What the balance of mass misses, in kg: nothing but rounding."""
        came_kg = self._crossed("poured_kg")
        went_kg = self._crossed("vapour_kg") + self._crossed("drained_kg")
        return stored_kg(self.after) - stored_kg(self.before) - (came_kg - went_kg)
