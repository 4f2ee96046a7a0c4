r"""A predictive law from first principles, in the manner of Marlin's for hot ends.

Marlin, the firmware of many 3D printers, offers it as ``MPCTEMP`` (marlinfw.org, "Model Predictive
Temperature Control"). A heater of power P warms a block of heat capacity C, which loses heat to its
surroundings; a sensor follows the block:

.. math::

    C \dot T_b = P u - \lambda (T_b - T_a), \qquad \dot T_s = r (T_b - T_s)

Every sample carries both temperatures on, moves both by a part of what the sensor reads beside its
model, and, near a state of rest, the surroundings by as much, so that what is wrong with the model
ends as a surrounding that is warmer or colder. The power brings the block to the set point within a
fixed time, and makes up for the loss. Nothing is taken from Marlin but this; filament and fans,
which a printer has beside, are left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import ClassVar

from thermoctl.plant.lab import LabParameters
from thermoctl.plant.parameters import WATER_J_PER_KG_K, TankParameters
from thermoctl.ports import Situation
from thermoctl.quantities import clamp, is_finite_number
from thermoctl.signals import Beliefs
from thermoctl.studies.compare.labs import lab_rest
from thermoctl.studies.compare.linear import rest
from thermoctl.studies.compare.scenarios import HELD_C

WARMEST_START_C = 30.0
"""A block that is hotter when it is switched on stands in a room of this, not in one as hot."""


@dataclass(frozen=True, slots=True)
class Rig:
    """What Marlin's auto-tune measures of a plant.

    Parameters
    ----------
    heater_w : float
        Power of the heater, as it was ordered.
    block_j_per_k : float
        Its heat capacity: what full power is over the steepest rise.
    sensor_per_s : float
        Responsiveness of the sensor, one over its lag: how late the steepest rise is.
    loss_w_per_k : float
        The power that holds the set point, over the rise above where the plant was switched on.
    """

    heater_w: float
    block_j_per_k: float
    sensor_per_s: float
    loss_w_per_k: float

    def speeds(self) -> dict[str, float]:
        """Return the two speeds that Marlin leaves to be chosen, for a plant like this.

        Marlin's own, 1 and 0.5 K/s, are for a hot end that rises by 2.4 K/s. Here they are as
        large as there beside what the plant can do: surroundings that go so fast change the loss by
        the same share of full power in a lag of the sensor, and near rest is the same share of the
        steepest rise.
        """
        loss = (self.heater_w * self.sensor_per_s / self.loss_w_per_k) / (
            HOT_END.heater_w * HOT_END.sensor_per_s / HOT_END.loss_w_per_k
        )
        rise = (self.heater_w / self.block_j_per_k) / (HOT_END.heater_w / HOT_END.block_j_per_k)
        return {"ambient_least_k_per_s": 1.0 * loss, "steady_k_per_s": 0.5 * rise}


HOT_END = Rig(heater_w=40.0, block_j_per_k=16.7, sensor_per_s=0.22, loss_w_per_k=0.068)
"""The constants that Marlin comes with."""


def tuned(ordered: TankParameters | LabParameters, held_c: float = HELD_C) -> Rig:
    """Return what auto-tune makes of a plant that is just as it was ordered.

    Parameters
    ----------
    ordered : TankParameters or LabParameters
        The plant.
    held_c : float
        Where the loss is measured, in degC.
    """
    if isinstance(ordered, LabParameters):
        holding_w = lab_rest(ordered, held_c).power * ordered.first_w
        loss = holding_w / (held_c - ordered.room_c)
        return Rig(ordered.first_w, ordered.heat_j_per_k, 1.0 / ordered.sensor_lag_s, loss)
    heater_w, probe = ordered.element.rated_w, ordered.probe
    late_s = ordered.element.lag_s + probe.transport_s + probe.lag_s
    loss = rest(ordered, held_c).power * heater_w / (held_c - ordered.initial_c)
    return Rig(heater_w, ordered.vessel.water_kg * WATER_J_PER_KG_K, 1.0 / late_s, loss)


def options(rig: Rig) -> dict[str, float]:
    """Return the options of the law for `rig`."""
    return {**asdict(rig), **rig.speeds()}


_NOMINAL = options(tuned(TankParameters()))


@dataclass(frozen=True, slots=True)
class Modelled:
    """What the model holds of block, sensor and surroundings, in degC."""

    block_c: float = math.nan
    sensor_c: float = math.nan
    ambient_c: float = math.nan


@dataclass(frozen=True, slots=True)
class MarlinMpc:
    """The law; its constants are those of the nominal rig unless they are given.

    Parameters
    ----------
    heater_w, block_j_per_k, sensor_per_s, loss_w_per_k : float
        As `Rig` has them.
    smoothing : float
        Part of the sensor's error that is taken over at each sample, in (0, 1].
    horizon_s : float
        Time in which the block is to be at the set point.
    ambient_least_k_per_s : float
        The surroundings are moved by this at least; see `Rig.speeds`.
    steady_k_per_s : float
        Near rest is where the block changes by less than this, or the power is not at an end.

    Raises
    ------
    ValueError
        A constant is not positive, or `smoothing` above 1.
    """

    heater_w: float = _NOMINAL["heater_w"]
    block_j_per_k: float = _NOMINAL["block_j_per_k"]
    sensor_per_s: float = _NOMINAL["sensor_per_s"]
    loss_w_per_k: float = _NOMINAL["loss_w_per_k"]
    smoothing: float = 0.5
    horizon_s: float = 2.0
    ambient_least_k_per_s: float = _NOMINAL["ambient_least_k_per_s"]
    steady_k_per_s: float = _NOMINAL["steady_k_per_s"]

    name: ClassVar[str] = "marlin-mpc"

    def __post_init__(self) -> None:
        for each in fields(self):
            name, value = each.name, getattr(self, each.name)
            if not is_finite_number(value) or not value > 0.0:
                raise ValueError(f"{name} must be positive, got {value!r}")
        if self.smoothing > 1.0:
            raise ValueError(f"smoothing must be at most 1, got {self.smoothing!r}")

    def start(self) -> Modelled:
        """Return a model that has seen nothing."""
        return Modelled()

    def observe(self, belief: Modelled, situation: Situation) -> Modelled:
        """Return the model carried on to this sample, and corrected by it."""
        seen_c = situation.temperature_c
        if not math.isfinite(seen_c):
            return belief
        if not math.isfinite(belief.block_c):
            return Modelled(seen_c, seen_c, min(WARMEST_START_C, seen_c))
        h, power = situation.interval_s, situation.applied
        lost_w = self.loss_w_per_k * (belief.block_c - belief.ambient_c)
        risen_k = h * (power * self.heater_w - lost_w) / self.block_j_per_k
        block_c = belief.block_c + risen_k
        followed = min(self.sensor_per_s * h, 1.0)
        sensor_c = belief.sensor_c + followed * (block_c - belief.sensor_c)
        moved_k = self.smoothing * (seen_c - sensor_c)
        ambient_c = belief.ambient_c
        steady = abs(risen_k + moved_k) < self.steady_k_per_s * h
        if steady or 0.0 < power < 1.0:
            least_k = self.ambient_least_k_per_s * h
            ambient_c += math.copysign(max(abs(moved_k), least_k), moved_k)
        return Modelled(block_c + moved_k, sensor_c + moved_k, ambient_c)

    def decide(self, belief: Modelled, situation: Situation) -> tuple[Modelled, float]:
        """Return the power that brings the block there in time; NaN before a sample."""
        if not math.isfinite(situation.temperature_c):
            return belief, math.nan
        ahead_k = situation.setpoint_c - belief.block_c
        needed_w = ahead_k * self.block_j_per_k / self.horizon_s
        lost_w = self.loss_w_per_k * (belief.block_c - belief.ambient_c)
        return belief, clamp((needed_w + lost_w) / self.heater_w, 0.0, 1.0)

    def beliefs(self, belief: Modelled, situation: Situation) -> Beliefs:
        """Return nothing that an operator would be told: it is a baseline."""
        return Beliefs()

    def ride_s(self, belief: Modelled) -> float:
        """Return 0: without a sensor it is not to steer."""
        return 0.0

    def remarks(self, belief: Modelled) -> Mapping[str, str]:
        """Return nothing."""
        return {}
