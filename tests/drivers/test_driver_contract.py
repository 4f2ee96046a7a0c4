"""Every driver keeps the contract, each with a rig of its own."""

from __future__ import annotations

import pytest

from thermoctl.testing import Device, DriverContract, FaultyLink, LockStepLink, ManualClock, Rig
from thermoctl_drivers.null import NullBoard, NullSettings
from thermoctl_drivers.simulated import SimulatedBoard, SimulatedSettings
from thermoctl_drivers.thermodaq import ThermoDaq, ThermoDaqSettings
from thermoctl_drivers.thermodaq_board import BoardModel
from thermoctl_drivers.thermodaq_chip import Chip, missing

LM335_AT_37_5_C_MV = 3106.5
OBSERVED_S = 0.04


def thermodaq_rig(device: BoardModel | Chip) -> Rig:
    """Return the driver on a line to `device`, whose heater pin can be looked at."""
    clock = ManualClock()
    device.analog(LM335_AT_37_5_C_MV, noise_mv=5.0)
    lock_step = LockStepLink(device, clock)
    line = FaultyLink(lock_step, clock)
    settings = ThermoDaqSettings(port="lock-step", average_periods=2)

    def power() -> float:
        lock_step.catch_up()
        before_s = device.on_s
        clock.advance(OBSERVED_S)
        lock_step.catch_up()
        return (device.on_s - before_s) / OBSERVED_S

    return Rig(ThermoDaq(settings, line, clock), clock, line, power)


class TestThermoDaqOnThePythonBoard(DriverContract):
    def rig(self) -> Rig:
        return thermodaq_rig(BoardModel())


@pytest.mark.hil
class TestThermoDaqOnTheChip(DriverContract):
    def rig(self) -> Rig:
        if why := missing():
            pytest.skip(why)
        return thermodaq_rig(Chip())


class TestSimulated(DriverContract):
    def rig(self) -> Rig:
        clock = ManualClock()
        board = SimulatedBoard(SimulatedSettings(power_stage="linear"), None, clock)

        def power() -> float:
            """Return what the heater gave over the next instant."""
            clock.advance(OBSERVED_S)
            board.open(clock.now_s())
            return board.truth()["heater_w"] / 1500.0

        return Rig(board, clock, power=power)


class TestNull(DriverContract):
    def rig(self) -> Rig:
        clock = ManualClock()
        return Rig(NullBoard(NullSettings(), None, clock), clock, output_name="")


@pytest.mark.parametrize(
    "settings",
    [
        NullSettings(),
        SimulatedSettings(),
        SimulatedSettings(second_sensor=True, element_sensor=True, cooler_w=300.0),
    ],
)
def test_a_board_reads_and_takes_what_its_settings_name(
    settings: NullSettings | SimulatedSettings,
) -> None:
    clock = ManualClock()
    kind = NullBoard if isinstance(settings, NullSettings) else SimulatedBoard
    rig = Rig(kind(settings, None, clock), clock).opened()  # type: ignore[arg-type]
    assert set(rig.read()) == set(settings.inputs)
    taken = rig.board.write(dict.fromkeys(settings.outputs, 0.0), 2.0, clock.now_s() + 1.0)
    assert set(taken) == set(settings.outputs)


def test_the_board_on_a_port_reads_what_its_settings_name() -> None:
    settings = ThermoDaqSettings(port="lock-step")
    rig = thermodaq_rig(BoardModel()).opened()
    assert set(rig.read()) == set(settings.inputs)
    assert settings.outputs == (rig.output_name,)


def test_a_device_satisfies_the_port_of_a_lock_step_line() -> None:
    device: Device = BoardModel()
    device.advance(0.1)
    assert device.receive() == b""
