"""The simulated tank: a drive goes in, temperatures come out.

Time is what `Tank.advance` is told; randomness is what the generator gives. Two tanks with equal
parameters, seeds and calls are equal to the last bit. `thermoctl.plant.disturbances` offers what
can be done to a tank by name.
"""

from __future__ import annotations

import math

from numpy.random import Generator

from thermoctl.model.actuator import ActuatorLaw, SquareLaw
from thermoctl.plant import handling, thermal
from thermoctl.plant.coil import CoolingCoil
from thermoctl.plant.ledger import Ledger
from thermoctl.plant.noise import Wander
from thermoctl.plant.parameters import WATER_J_PER_KG_K, TankParameters
from thermoctl.plant.power_stage import PowerStage
from thermoctl.plant.probe import ProbeInTank


class Tank:
    """Two zones of water, glass, ice, a heater with its stage, a cooler, probes.

    Parameters
    ----------
    parameters : TankParameters
        What it is made of.
    rng : Generator
        All randomness; equal generators give equal tanks.
    law : ActuatorLaw
        How the power stage answers its drive; the default is O21's voltage of 0 to 220 V.
    """

    def __init__(
        self, parameters: TankParameters, rng: Generator, law: ActuatorLaw | None = None
    ) -> None:
        probe_rng, mains_rng, loss_rng = rng.spawn(3)
        supply, rated_w = parameters.supply, parameters.element.rated_w
        self.parameters = parameters
        self.probe = ProbeInTank(parameters.probe, parameters.initial_c, probe_rng)
        self.second: ProbeInTank | None = None
        if parameters.second is not None:  # its generator comes last and changes no other
            self.second = ProbeInTank(parameters.second, parameters.initial_c, *rng.spawn(1))
        self.stage = PowerStage(law or SquareLaw(), rated_w, supply, mains_rng)
        self._loss = Wander(loss_rng, supply.loss_spread, supply.loss_s)
        self._start = self._heat = thermal.start(parameters)
        self._t_s = 0.0
        self._heater_w = self._cooled_w = 0.0
        self._coil = CoolingCoil(parameters.cooler) if parameters.cooler.rated_w > 0.0 else None
        self._stirred = True
        self._draught, self._draught_until_s = 1.0, 0.0
        self._k = thermal.conductances(parameters)

    @property
    def t_s(self) -> float:
        """Time since the start."""
        return self._t_s

    @property
    def temperature_c(self) -> float:
        """Mean temperature of the water by mass: what a perfect sensor shows."""
        heat = self._heat
        return (heat.water_j + heat.still_j) / (heat.water_kg * WATER_J_PER_KG_K)

    @property
    def sensor_c(self) -> float:
        """Temperature of the sensing element: late, lagging, without error or noise."""
        return self.probe.sheath_c

    @property
    def heater_w(self) -> float:
        """Electrical power during the last step."""
        return self._heater_w

    @property
    def cooled_w(self) -> float:
        """Heat that the cooler took out during the last step."""
        return self._cooled_w

    @property
    def stirred(self) -> bool:
        """Whether the stirrer turns."""
        return self._stirred

    @property
    def heat(self) -> thermal.Heat:
        """The thermal state: enthalpies, masses, and what has crossed the boundary."""
        return self._heat

    @property
    def temperatures(self) -> thermal.Temperatures:
        """Every temperature of the tank in degC."""
        return thermal.temperatures(self._k, self._heat)

    def truth(self) -> dict[str, float]:
        """Return what no sensor sees, by name."""
        heat = self._heat
        element_c, _, still_c, _, _, bulk_c = thermal.temperatures(self._k, heat)
        return {
            "true_temperature_c": bulk_c,
            "sensor_c": self.probe.sheath_c,
            "element_c": element_c,
            "still_c": still_c,
            "heater_w": self._heater_w,
            "cooled_w": self._cooled_w,
            "ice_kg": heat.bath_ice_kg + heat.ice_kg,
            "water_kg": heat.water_kg,
            "mains": self.stage.mains,
            "stirred": float(self._stirred),
            "energy_j": heat.electric_j,
        }

    @property
    def ledger(self) -> Ledger:
        """The books of energy and mass since the start."""
        return Ledger(self._start, self._heat)

    def advance(self, interval_s: float, drive: float, cooling: float = 0.0) -> None:
        """Let `interval_s` pass with `drive` on the power stage.

        Parameters
        ----------
        interval_s : float
            Time to pass, at least 0 and finite; divided into equal steps of at most 0.5 s.
        drive : float
            Drive in [0, 1]; what lies outside is limited, and NaN is 0.
        cooling : float
            Drive of the cooler, likewise; means nothing where there is none.

        Raises
        ------
        ValueError
            When `interval_s` is negative or not finite.
        """
        if not 0.0 <= interval_s < math.inf:
            raise ValueError(f"interval_s must be at least 0 and finite, got {interval_s!r}")
        steps = math.ceil(interval_s / thermal.LONGEST_STEP_S)
        for _ in range(steps):
            self._step(interval_s / steps, drive, cooling)

    def _step(self, step_s: float, drive: float, cooling: float) -> None:
        """Advance everything by one step."""
        if self._draught != 1.0 and self._t_s >= self._draught_until_s:
            self.draught(1.0, 0.0)
        self._heater_w = self.stage.advance(step_s, drive)
        unrest = 1.0 + self._loss.advance(step_s)
        if self._coil is not None:
            self._cooled_w = self._coil.advance(step_s, cooling, self._water_c)
        self._heat = thermal.step(
            self._k, self._heat, self._heater_w, unrest, step_s, self._cooled_w
        )
        self._t_s += step_s
        water_c = self._water_c
        self.probe.advance(step_s, water_c, stirred=self._stirred)
        if self.second is not None:
            self.second.advance(step_s, water_c, stirred=self._stirred)

    @property
    def _water_c(self) -> float:
        """Temperature of the stirred zone."""
        heat = self._heat
        zone_j_per_k = self._k.stirred_share * heat.water_kg * WATER_J_PER_KG_K
        return heat.water_j / zone_j_per_k

    def stir(self, on: bool) -> None:
        """Start or stop the stirrer."""
        self._stirred = on
        self._k = thermal.conductances(self.parameters, stirred=on, draught=self._draught)

    def draught(self, factor: float, duration_s: float) -> None:
        """Multiply what the air carries off the surface by `factor` for `duration_s`."""
        self._draught, self._draught_until_s = factor, self._t_s + duration_s
        self._k = thermal.conductances(self.parameters, stirred=self._stirred, draught=factor)

    def pour(self, litres: float, temperature_c: float) -> None:
        """Pour water in; raises as `thermoctl.plant.handling.pour` does."""
        self._heat = handling.pour(self._heat, self.parameters.vessel, litres, temperature_c)

    def drain(self, fraction: float) -> None:
        """Let `fraction` of the water run out, as `handling.drain` has it."""
        self._heat = handling.drain(self._heat, self.parameters.vessel, fraction)

    def throw_ice(self, ice_kg: float) -> None:
        """Throw ice into the water; raises as `thermoctl.plant.handling.throw_ice` does."""
        self._heat = handling.throw_ice(self._heat, self.parameters.vessel, ice_kg)

    def refill_bath(self, ice_kg: float) -> None:
        """Throw ice into the bath; raises as `thermoctl.plant.handling.refill_bath` does."""
        self._heat = handling.refill_bath(self._heat, ice_kg)
