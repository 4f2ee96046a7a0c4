"""What a regulator is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

from thermoctl.estimation.identifier import Identifier
from thermoctl.ports import Controller
from thermoctl.regulator.heater.check import HeaterCheck
from thermoctl.regulator.limits import Limits
from thermoctl.signals import Mode


@dataclass(frozen=True, slots=True)
class Plan:
    """What a regulator is made of; every part is frozen.

    Parameters
    ----------
    limits : Limits
        What may never be left.
    identifier : Identifier
        The model that is learnt beside every controller, in every mode.
    controller : Controller
        The law in charge in mode AUTO.
    setpoint_c : float
        Set point at the start, in degC.
    mode : Mode
        Mode at the start.
    shadow : Controller, optional
        Another law, asked beside the one in charge and not obeyed until it is put in charge.
    heater_check : HeaterCheck, optional
        How the heater is checked against what it was seen to do; not at all when not given.
    setpoint_rate_k_per_s : float
        How fast a set point is approached, at most; infinite: at once.
    disagreement_k : float
        How far apart two sensors may be, where the loop has two.

    Raises
    ------
    ValueError
        The mode is PROGRAM: there is none to begin with. Or both laws have one name: nobody could
        choose between them. Or the rate is not positive.
    """

    limits: Limits
    identifier: Identifier
    controller: Controller
    setpoint_c: float
    mode: Mode = Mode.OFF
    shadow: Controller | None = None
    setpoint_rate_k_per_s: float = math.inf
    heater_check: HeaterCheck | None = None
    disagreement_k: float = 1.0

    def __post_init__(self) -> None:
        if self.mode is Mode.PROGRAM:
            raise ValueError("mode must be off, manual or auto at the start, got 'program'")
        if not self.setpoint_rate_k_per_s > 0.0:
            raise ValueError(
                f"setpoint_rate_k_per_s must be positive, got {self.setpoint_rate_k_per_s!r}"
            )
        if self.shadow is not None and self.shadow.name == self.controller.name:
            raise ValueError(
                f"shadow must be another kind than the controller's, got {self.shadow.name!r} twice"
            )
