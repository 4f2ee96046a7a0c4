"""Loops and what they are connected to, and a signed power on one output or two."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from thermoctl.model.actuator import ActuatorLaw
from thermoctl.model.sensor import Sensor
from thermoctl.quantities import is_finite_number
from thermoctl.regulator import Regulator
from thermoctl.runtime.connection import Connection
from thermoctl.runtime.lead import Lead
from thermoctl.signals import TRUE_TEMPERATURE


@dataclass(frozen=True, slots=True, eq=False)
class Output:
    """A channel of a board, and the law of what hangs on it; equal to itself alone."""

    board: Connection
    channel: str
    law: ActuatorLaw

    def power(self, drive: object) -> float:
        """Return the power of what was taken; NaN, and not 0, when that is not said."""
        known = is_finite_number(drive)
        return self.law.power_from(drive) if known else math.nan  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Input:
    """A channel of a board, and the sensor that hangs on it."""

    board: Connection
    channel: str
    sensor: Sensor


@dataclass(frozen=True, slots=True)
class Wiring:
    """One loop and what it is connected to.

    Parameters
    ----------
    name : str
        Name of the loop.
    regulator : Regulator
        Its regulator.
    sensor_board, input, sensor : Connection, str, Sensor
        Where its temperature comes from.
    actuator_board, output, law : Connection, str, ActuatorLaw
        Where its power goes to: the heater, or a cooler that is the only actuator; no board for a
        loop that leads another one.
    cooler : Output, optional
        Where negative power goes to.
    lead : Lead, optional
        What its power means to another loop, in place of an output.
    second : Input, optional
        Where another sensor of the same plant is.
    """

    name: str
    regulator: Regulator
    sensor_board: Connection
    input: str
    sensor: Sensor
    actuator_board: Connection | None
    output: str
    law: ActuatorLaw
    cooler: Output | None = None
    lead: Lead | None = None
    second: Input | None = None
    inputs: tuple[Input, ...] = field(init=False, repr=False)
    """The sensor, and the second one where there is one."""
    outputs: tuple[Output, ...] = field(init=False, repr=False)
    """The heater, and the cooler where there is one."""
    own_truth: str = field(init=False, repr=False)
    """What the truth of its input is called where that is not the truth of the whole board."""

    def __post_init__(self) -> None:
        board = self.actuator_board
        heater = None if board is None else Output(board, self.output, self.law)
        outputs = tuple(each for each in (heater, self.cooler) if each is not None)
        first = Input(self.sensor_board, self.input, self.sensor)
        inputs = (first,) if self.second is None else (first, self.second)
        object.__setattr__(self, "outputs", outputs)
        object.__setattr__(self, "inputs", inputs)
        object.__setattr__(self, "own_truth", f"{self.input}_c")

    def truth(self) -> Mapping[str, float]:
        """Return what a simulated board knows, the true temperature that of this input."""
        told = self.sensor_board.truth()
        own_c = told.get(self.own_truth)
        return told if own_c is None else {**told, TRUE_TEMPERATURE: own_c}

    @property
    def boards(self) -> tuple[Connection, ...]:
        """Every board it uses."""
        return (*(i.board for i in self.inputs), *(o.board for o in self.outputs))

    @property
    def needs(self) -> tuple[Connection, ...]:
        """The boards it cannot do without: of two that read, it can spare either."""
        read = {id(i.board): i.board for i in self.inputs}
        only = tuple(read.values()) if len(read) == 1 else ()
        return (*only, *(o.board for o in self.outputs))

    def on(self, board: Connection) -> list[Output]:
        """Return its outputs on `board`."""
        return [each for each in self.outputs if each.board is board]

    def share(self, output: Output, power: float) -> float:
        """Return the part of the signed `power` that `output` gives; never both give one."""
        part = -power if output is self.cooler else power
        return 0.0 if part < 0.0 else part


def signed(shares: Sequence[float]) -> float:
    """Return what one output, or heater and cooler, took, as one power.

    NaN when one of them is not known; and when both are on, for no power is meant by that.
    """
    heat, *cold = shares
    if not cold:
        return heat
    return math.nan if heat > 0.0 and cold[0] > 0.0 else heat - cold[0]
