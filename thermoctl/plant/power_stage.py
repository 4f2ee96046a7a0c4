"""The power stage: a drive in, watts out, from mains that wander and sag."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum

from numpy.random import Generator

from thermoctl.model.actuator import ActuatorLaw, Linear, PhaseAngle, SquareLaw, WholeCycleBurst
from thermoctl.plant.noise import Wander
from thermoctl.plant.parameters import Supply

STAGES: Mapping[str, ActuatorLaw] = {
    "linear": Linear(),
    "square": SquareLaw(),
    "phase-angle": PhaseAngle(),
    "burst": WholeCycleBurst(50),
}
"""Power stages by name; the burst repeats after 50 mains cycles, one second of 50 Hz."""


class Output(Enum):
    """What becomes of the power that is asked for."""

    SOUND = "sound"
    DEAD = "dead"
    INVERTED = "inverted"
    STUCK_ON = "stuck on"

    def given(self, power: float) -> float:
        """Return what reaches the water, as a fraction; negative where power cools."""
        match self:
            case Output.SOUND:
                return power
            case Output.DEAD:
                return 0.0
            case Output.INVERTED:
                return -power
            case Output.STUCK_ON:
                return 1.0


class PowerStage:
    """A resistive heater behind `law`, on a mains voltage that varies.

    Parameters
    ----------
    law : ActuatorLaw
        How the stage answers its drive.
    rated_w : float
        Power of the heater at nominal voltage.
    supply : Supply
        How restless the mains are.
    rng : Generator
        Source of that unrest.
    """

    def __init__(self, law: ActuatorLaw, rated_w: float, supply: Supply, rng: Generator) -> None:
        self._law = law
        self._rated_w = rated_w
        self._unrest = Wander(rng, supply.voltage_spread, supply.voltage_s)
        self._t_s = 0.0
        self._sag = 0.0
        self._sag_until_s = 0.0
        self._output, self._output_until_s = Output.SOUND, 0.0

    @property
    def output(self) -> Output:
        """What becomes of the power at this time."""
        return self._output if self._t_s < self._output_until_s else Output.SOUND

    @property
    def mains(self) -> float:
        """Mains voltage as a fraction of the nominal one."""
        sag = self._sag if self._t_s < self._sag_until_s else 0.0
        voltage = (1.0 + self._unrest.value) * (1.0 - sag)
        return 0.0 if voltage < 0.0 else voltage

    def sag(self, depth: float, duration_s: float) -> None:
        """Lower the mains by the fraction `depth` for `duration_s`."""
        self._sag, self._sag_until_s = depth, self._t_s + duration_s

    def fail(self, output: Output, duration_s: float) -> None:
        """Let the output do what `output` says for `duration_s`."""
        self._output, self._output_until_s = output, self._t_s + duration_s

    def advance(self, step_s: float, drive: float) -> float:
        """Return the power in W during the next `step_s` at `drive`, in [0, 1].

        Negative where the output is inverted.
        """
        power = self._law.power_from(drive)
        if self._t_s < self._output_until_s:
            power = self._output.given(power)
        heater_w = self._rated_w * power * self.mains**2
        self._t_s += step_s
        self._unrest.advance(step_s)
        return heater_w
