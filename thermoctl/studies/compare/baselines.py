"""Controllers from elsewhere, tuned for the rig as it was ordered.

simple-pid, a package with many users, with gains by the SIMC rules of `thermoctl.control.pid.simc`
from what is known of the nominal rig, and a law in the manner of Marlin's, which is in
`thermoctl.studies.compare.marlin`.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

from thermoctl.control.pid import simc as rules
from thermoctl.errors import Unavailable
from thermoctl.plant.lab import LabParameters
from thermoctl.plant.parameters import WATER_J_PER_KG_K, TankParameters
from thermoctl.ports import Situation
from thermoctl.quantities import is_finite_number
from thermoctl.signals import Beliefs
from thermoctl.studies.compare.labs import lag_s
from thermoctl.studies.compare.marlin import MarlinMpc, options, tuned
from thermoctl.studies.compare.plants import FLEETS, LAB_HELD_C, Plant

if TYPE_CHECKING:
    from simple_pid import PID


def simc(
    ordered: TankParameters | LabParameters, period_s: float = 1.0, *, derivative: bool = False
) -> rules.Gains:
    """Return the gains SIMC gives for a plant that is known as its maker knows it.

    The water of a tank integrates, its element and sheath are lags; transport and half a sample are
    dead time. Heater and sensor of a lab are lags.

    Parameters
    ----------
    ordered : TankParameters or LabParameters
        The plant.
    period_s : float
        Time between two samples.
    derivative : bool
        Cancel the larger lag as well.
    """
    return rules.simc(_process(ordered, 0.5 * period_s), derivative=derivative)


def _process(ordered: TankParameters | LabParameters, late_s: float) -> rules.Process:
    """Return what the rules have to know of a plant; `late_s` is the dead time of sampling."""
    if isinstance(ordered, LabParameters):
        slope_k_per_s = ordered.first_w / ordered.heat_j_per_k
        lags_s = (lag_s(ordered, LAB_HELD_C), ordered.sensor_lag_s)
        return rules.Process(slope_k_per_s, late_s, lags_s)
    slope_k_per_s = ordered.element.rated_w / (ordered.vessel.water_kg * WATER_J_PER_KG_K)
    lags = sorted((ordered.element.lag_s, ordered.probe.lag_s), reverse=True)
    return rules.Process(slope_k_per_s, ordered.probe.transport_s + late_s, (math.inf, *lags))


def _default(place: str) -> float:
    return float(getattr(simc(TankParameters()), place))


@dataclass(frozen=True, slots=True)
class SimplePid:
    """The PID of the package simple-pid, its output limited to [0, 1].

    Parameters
    ----------
    Kp, Ki, Kd : float
        Gains; those of a PI by SIMC for the nominal rig unless they are given.

    Raises
    ------
    ValueError
        A gain is negative or not finite.
    Unavailable
        When it starts: the package is not installed.
    """

    Kp: float = _default("Kp")
    Ki: float = _default("Ki")
    Kd: float = _default("Kd")

    name: ClassVar[str] = "simple-pid"

    def __post_init__(self) -> None:
        for name in ("Kp", "Ki", "Kd"):
            value = getattr(self, name)
            if not is_finite_number(value) or value < 0.0:
                raise ValueError(f"{name} must be at least 0, got {value!r}")

    def start(self) -> PID:
        """Return a PID that has seen nothing; it remembers by itself."""
        require("simple-pid")
        from simple_pid import PID

        return PID(self.Kp, self.Ki, self.Kd, sample_time=None, output_limits=(0.0, 1.0))

    def observe(self, belief: PID, situation: Situation) -> PID:
        """Return the belief as it was."""
        return belief

    def decide(self, belief: PID, situation: Situation) -> tuple[PID, float]:
        """Return what the package asks for; NaN while the temperature is not known."""
        if not math.isfinite(situation.temperature_c):
            return belief, math.nan
        belief.setpoint = situation.setpoint_c
        power = belief(situation.temperature_c, dt=situation.interval_s)
        return belief, math.nan if power is None else float(power)

    def beliefs(self, belief: PID, situation: Situation) -> Beliefs:
        """Return nothing: it has no model."""
        return Beliefs()

    def ride_s(self, belief: PID) -> float:
        """Return 0: without a sensor it cannot steer."""
        return 0.0

    def remarks(self, belief: PID) -> Mapping[str, str]:
        """Return nothing."""
        return {}


BASELINES: Mapping[str, type] = {"simple-pid": SimplePid, "marlin-mpc": MarlinMpc}
"""Controllers that exist only to be compared with, by kind."""


def options_for(kind: str, where: Plant, *, nameplate: bool = False) -> dict[str, float]:
    """Return the options of a baseline on a plant, from what was ordered alone.

    All plants of a fleet were ordered alike, so that nobody is tuned to the one it meets.

    Parameters
    ----------
    kind : str
        A key of `BASELINES`.
    where : Plant
        The plant.
    nameplate : bool
        Tell a model the litres and watts of this very tank.
    """
    ordered = FLEETS[where.fleet].ordered
    if kind == SimplePid.name:
        gains = simc(ordered)
        return {"Kp": gains.Kp, "Ki": gains.Ki}
    rig = tuned(ordered, where.held_c)
    if nameplate and isinstance(where.parameters, TankParameters):
        vessel, element = where.parameters.vessel, where.parameters.element
        block_j_per_k = vessel.water_kg * WATER_J_PER_KG_K
        rig = replace(rig, heater_w=element.rated_w, block_j_per_k=block_j_per_k)
    return options(rig)


_MODULES: Mapping[str, str] = {"simple-pid": "simple_pid"}


def require(kind: str) -> None:
    """Raise `Unavailable`, naming the package, where a baseline cannot run."""
    if kind in _MODULES and importlib.util.find_spec(_MODULES[kind]) is None:
        raise Unavailable(f"{kind} is not installed: pip install {kind}")
