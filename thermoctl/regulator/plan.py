"""What a regulator is made of."""

from __future__ import annotations

from dataclasses import dataclass

from thermoctl.estimation.identifier import Identifier
from thermoctl.ports import Controller
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

    Raises
    ------
    ValueError
        The mode is PROGRAM: there is none to begin with. Or both laws have one name: nobody could
        choose between them.
    """

    limits: Limits
    identifier: Identifier
    controller: Controller
    setpoint_c: float
    mode: Mode = Mode.OFF
    shadow: Controller | None = None

    def __post_init__(self) -> None:
        if self.mode is Mode.PROGRAM:
            raise ValueError("mode must be off, manual or auto at the start, got 'program'")
        if self.shadow is not None and self.shadow.name == self.controller.name:
            raise ValueError(
                f"shadow must be another kind than the controller's, got {self.shadow.name!r} twice"
            )
