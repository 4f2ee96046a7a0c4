"""Controllers from elsewhere, tuned for the rig as it was ordered.

simple-pid, a package with many users, with gains by the SIMC rules (S. Skogestad, Journal of
Process Control 13 (2003) 291-309) from what is known of the nominal rig.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from thermoctl.errors import Unavailable
from thermoctl.plant.parameters import WATER_J_PER_KG_K, TankParameters
from thermoctl.ports import Situation
from thermoctl.quantities import is_finite_number
from thermoctl.signals import Beliefs

if TYPE_CHECKING:
    from simple_pid import PID


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of a PID in its parallel form, power per kelvin: per K, per K s, s per K."""

    Kp: float
    Ki: float
    Kd: float = 0.0


def simc(tank: TankParameters, period_s: float = 1.0, *, derivative: bool = False) -> Gains:
    """Return the gains SIMC gives for a tank that is known as its maker knows it.

    The water integrates; element and sheath are lags; transport and half a sample are dead time.
    The half rule turns the lags that the controller does not cancel into dead time, and the closed
    loop is as quick as the dead time, which is what the rules recommend.

    Parameters
    ----------
    tank : TankParameters
        The tank.
    period_s : float
        Time between two samples.
    derivative : bool
        Cancel the larger lag as well.
    """
    slope_k_per_s = tank.element.rated_w / (tank.vessel.water_kg * WATER_J_PER_KG_K)
    larger_s, lesser_s = sorted((tank.element.lag_s, tank.probe.lag_s), reverse=True)
    dead_s = tank.probe.transport_s + 0.5 * period_s
    if not derivative:
        dead_s += 0.5 * larger_s + lesser_s
        Kp = 1.0 / (slope_k_per_s * 2.0 * dead_s)
        return Gains(Kp, Kp / (8.0 * dead_s))
    dead_s += 0.5 * lesser_s
    Td_s, Ti_s = larger_s + 0.5 * lesser_s, 8.0 * dead_s
    Kp = 1.0 / (slope_k_per_s * 2.0 * dead_s)
    return Gains(Kp * (1.0 + Td_s / Ti_s), Kp / Ti_s, Kp * Td_s)  # from the series form


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


BASELINES: Mapping[str, type] = {"simple-pid": SimplePid}
"""Controllers that exist only to be compared with, by kind."""

_MODULES: Mapping[str, str] = {"simple-pid": "simple_pid"}


def require(kind: str) -> None:
    """Raise `Unavailable`, naming the package, where a baseline cannot run."""
    if importlib.util.find_spec(_MODULES[kind]) is None:
        raise Unavailable(f"{kind} is not installed: pip install {kind}")
