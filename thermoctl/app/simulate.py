"""``thermoctl simulate thermodaq``: board and tank behind a pseudo terminal.

The firmware runs on a simulated chip where compiler and simulator are installed, else the board is
played by `thermoctl_drivers.thermodaq_board`; the caller is told which. A daemon, or anybody's own
client, opens the terminal as it would open the serial port.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import select
import time
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from pydantic import BaseModel

from thermoctl.errors import Unavailable
from thermoctl.model.actuator import Linear
from thermoctl.plant.parameters import TankParameters
from thermoctl.plant.tank import Tank
from thermoctl.quantities import clamp
from thermoctl_drivers.thermodaq_board import BoardModel
from thermoctl_drivers.thermodaq_chip import Chip

Firmware = Literal["auto", "simavr", "python"]
Report = Callable[[str], None]

COUPLING_S = 0.1
"""How often tank and board exchange voltage and power; a tenth of the fastest lag there is."""

SUPPLY_V = 5.0
"""Reference of the converter, and what the pull-up shows when the sensor is off."""

_TURN_S = 0.002
_READ_SIZE = 4096
_LONGEST_LAG_S = 0.5  # behind by more than this, the simulated time is let go


class BoardInAProcess(Protocol):
    """What both simulated boards offer."""

    @property
    def t_s(self) -> float:
        """Time since power-on."""
        ...

    @property
    def on_s(self) -> float:
        """How long the heater pin has been high, in all."""
        ...

    def analog(self, millivolts: float, noise_mv: float, pickup_mv: float, mains_hz: float) -> None:
        """Put a voltage on the analog input."""
        ...

    def send(self, data: bytes) -> None:
        """Put bytes on the line to the board."""
        ...

    def receive(self) -> bytes:
        """Return what the board has sent."""
        ...

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        ...

    def close(self) -> None:
        """Let it go."""
        ...


def board_for(
    firmware: Firmware, seed: int = 1, report: Report = lambda text: None
) -> Chip | BoardModel:
    """Return a simulated board; `report` is told which one, and why not the other.

    Raises
    ------
    Unavailable
        When ``simavr`` was asked for and is not there.
    """
    if firmware != "python":
        try:
            chip = Chip(seed)
        except Unavailable as missing:
            if firmware == "simavr":
                raise
            report(f"no simulated chip: {missing}")
        else:
            report("the firmware runs on a simulated ATmega328P")
            return chip
    report("the board is played in Python")
    return BoardModel(seed)


@dataclass(frozen=True, slots=True)
class Wiring:
    """What the wires add: noise rms and mains pickup amplitude, in mV."""

    noise_mv: float = 5.0
    pickup_mv: float = 20.0
    mains_hz: float = 50.0


_OWN = {
    "it has a converter of its own": {"bits", "reference_v", "conversions"},
    "it has a power stage of its own": {"power_stage", "dac_bits"},
    "its dead-man is set over its port": {"dead_man_s"},
    "it has one input": {"second_sensor", "second_lag_s", "second_gain_error", "element_sensor"},
    "it only heats": {"cooler_w", "cooler_lag_s"},
}
"""What a simulated tank may have and this board does not, by what there is instead."""


def left_out(name: str, board: BaseModel) -> list[str]:
    """Return a line for what the simulated board `name` says and this one has not."""
    written = board.model_fields_set
    return [
        f"boards.{name}: {', '.join(sorted(keys & written))} not used by a thermodaq: {instead}"
        for instead, keys in _OWN.items()
        if keys & written
    ]


class WiredBoard:
    """A simulated board between a tank's sensor and its heater.

    Parameters
    ----------
    board : BoardInAProcess
        The board.
    tank : Tank
        The tank; its power stage is to be linear in the share of time the pin is high.
    wiring : Wiring
        Noise and pickup.
    """

    def __init__(self, board: BoardInAProcess, tank: Tank, wiring: Wiring | None = None) -> None:
        self.board, self.tank = board, tank
        self._wiring = wiring or Wiring()
        self._lived_s, self._on_s = board.t_s, board.on_s
        self._due_s = COUPLING_S
        self._put_voltage()

    @property
    def t_s(self) -> float:
        """Time since power-on."""
        return self.board.t_s

    def send(self, data: bytes) -> None:
        """Put bytes on the line to the board."""
        self.board.send(data)

    def receive(self) -> bytes:
        """Return what the board has sent."""
        return self.board.receive()

    def advance(self, seconds: float) -> None:
        """Let time pass for both."""
        while seconds > 0.0:
            step_s = min(seconds, self._due_s)
            self.board.advance(step_s)
            seconds -= step_s
            self._due_s -= step_s
            if self._due_s <= 0.0:
                self._due_s = COUPLING_S
                self._exchange()

    def _exchange(self) -> None:
        """Give the tank the power of the time just lived, and the board the new voltage."""
        now_s, on_s = self.board.t_s, self.board.on_s
        lived_s = now_s - self._lived_s
        if lived_s <= 0.0:
            return
        self.tank.advance(lived_s, clamp((on_s - self._on_s) / lived_s, 0.0, 1.0))
        self._lived_s, self._on_s = now_s, on_s
        self._put_voltage()

    def _put_voltage(self) -> None:
        volts = self.tank.probe.volts()  # infinite when open, NaN when the wire is off
        millivolts = 1000.0 * volts if volts < SUPPLY_V else 1000.0 * SUPPLY_V
        wiring = self._wiring
        self.board.analog(millivolts, wiring.noise_mv, wiring.pickup_mv, wiring.mains_hz)


def wired(
    board: BoardInAProcess,
    parameters: TankParameters | None = None,
    seed: int = 1,
    wiring: Wiring | None = None,
) -> WiredBoard:
    """Return `board` wired to a new tank, that of O21 without `parameters`."""
    tank = Tank(parameters or TankParameters(), np.random.default_rng(seed), Linear())
    return WiredBoard(board, tank, wiring)


@contextlib.contextmanager
def terminal(link: Path) -> Iterator[int]:
    """Yield the descriptor behind a new pseudo terminal that `link` leads to.

    Raises
    ------
    FileExistsError
        When `link` exists and is no symbolic link.
    """
    ours, theirs = os.openpty()
    try:
        tty.setraw(theirs)
        os.set_blocking(ours, False)
        if link.is_symlink():
            link.unlink()  # left behind by an earlier run
        elif link.exists():
            text = "expected a path that is free, got one where something is"
            raise FileExistsError(errno.EEXIST, text, str(link))
        try:
            link.symlink_to(os.ttyname(theirs))
        except OSError as error:  # it names the terminal, which nobody asked for
            raise type(error)(error.errno, error.strerror, str(link)) from error
        try:
            yield ours
        finally:
            link.unlink(missing_ok=True)
    finally:
        os.close(ours)
        os.close(theirs)  # held open so that a client may come and go


def serve(
    device: WiredBoard, descriptor: int, stop: Callable[[], bool], duration_s: float = math.inf
) -> None:
    """Let `device` live in real time and pass bytes on, until `stop`.

    A machine that is too slow loses simulated time rather than answering late for ever.
    """
    began_s = time.monotonic()
    anchor_s = began_s - device.t_s
    while not stop() and time.monotonic() - began_s < duration_s:
        readable, _, _ = select.select([descriptor], [], [], _TURN_S)
        if readable:
            with contextlib.suppress(BlockingIOError):
                device.send(os.read(descriptor, _READ_SIZE))
        behind_s = time.monotonic() - anchor_s - device.t_s
        if behind_s > _LONGEST_LAG_S:
            anchor_s += behind_s
            behind_s = _TURN_S
        device.advance(behind_s)
        if answer := device.receive():
            with contextlib.suppress(BlockingIOError):  # nobody reads: lost, as on a wire
                os.write(descriptor, answer)


def simulate_thermodaq(
    link: Path,
    *,
    parameters: TankParameters | None = None,
    wiring: Wiring | None = None,
    seed: int = 1,
    firmware: Firmware = "auto",
    stop: Callable[[], bool] = lambda: False,
    duration_s: float = math.inf,
    report: Report = lambda text: None,
) -> None:
    """Run a simulated thermodaq board and tank behind a pseudo terminal.

    Parameters
    ----------
    link : Path
        Where a symbolic link to the terminal is made; removed at the end.
    parameters : TankParameters, optional
        The tank; the rig of O21 if not given.
    wiring : Wiring, optional
        Noise and pickup on the analog input.
    seed : int
        Of all randomness.
    firmware : {"auto", "simavr", "python"}
        The real firmware on a simulated chip, the board in Python, or the first that is there.
    stop : callable
        Asked every few milliseconds; true ends the simulation.
    duration_s : float
        Ends the simulation too.
    report : callable
        Called with a line of text for the operator.

    Raises
    ------
    Unavailable
        When ``simavr`` was asked for and is not there.
    OSError
        When the terminal or the link cannot be made.
    """
    with (
        terminal(link) as descriptor,
        contextlib.closing(board_for(firmware, seed, report)) as board,
    ):
        device = wired(board, parameters, seed, wiring)
        report(f"{link} is the board; set port to it")
        serve(device, descriptor, stop, duration_s)
