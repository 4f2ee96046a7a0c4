"""The firmware on a simulated ATmega328P, in lock step with the tests."""

from __future__ import annotations

import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.app.simulate import WiredBoard, wired
from thermoctl.model.sensor import LM335, Sensor
from thermoctl.plant.parameters import TankParameters
from thermoctl.signals import Quality
from thermoctl.testing import LockStepLink, ManualClock
from thermoctl_drivers import thermodaq_frames as frames
from thermoctl_drivers.thermodaq import ThermoDaq, ThermoDaqSettings
from thermoctl_drivers.thermodaq_chip import Chip

pytestmark = pytest.mark.hil

TCCR0B, TCCR1B = 0x45, 0x81
WATCHDOG_CAUSE = 8


def rig(device: Chip | WiredBoard, **settings: object) -> tuple[ThermoDaq, ManualClock]:
    """Return an opened driver on a lock-step line."""
    clock = ManualClock()
    chosen = ThermoDaqSettings.model_validate({"port": "lock-step", **settings})
    board = ThermoDaq(chosen, LockStepLink(device, clock), clock)
    board.open(clock.now_s() + 5.0)
    return board, clock


def write(board: ThermoDaq, clock: ManualClock, power: float) -> float:
    return board.write({"heater": power}, 10.0, clock.now_s() + 0.2)["heater"]


def on_time(chip: Chip, seconds: float) -> float:
    """Return the share of `seconds` during which the heater pin is high."""
    before_s = chip.on_s
    chip.advance(seconds)
    return (chip.on_s - before_s) / seconds


def command(chip: Chip, letter: str, *arguments: int) -> frames.Reply:
    chip.send(frames.request(0, letter, *arguments))
    chip.advance(0.02)
    return frames.decode(chip.receive())


def configure(chip: Chip, mode: int, power: int) -> None:
    command(chip, "C", mode, 50, 2, 10_000, 10_000)
    chip.advance(0.4)  # so that zero crossings, where there are any, are believed
    command(chip, "W", power, 10_000)
    chip.advance(0.1)


def test_the_dead_man_cuts_within_its_time_in_chip_time(
    chip: Chip, capsys: pytest.CaptureFixture[str]
) -> None:
    board, clock = rig(chip)
    sent_s = chip.t_s
    write(board, clock, 1.0)
    chip.advance(3.0)
    cut_after_s = chip.off_since_s - sent_s
    with capsys.disabled():
        print(
            f"\nthermodaq dead-man of 2.5 s: heater off {cut_after_s:.4f} s after the last command"
        )
    assert cut_after_s == pytest.approx(2.5, abs=0.005)
    assert not chip.level


@pytest.mark.parametrize("timer", [TCCR0B, TCCR1B])
def test_a_dead_timer_ends_in_a_watchdog_reset_with_the_heater_off(chip: Chip, timer: int) -> None:
    configure(chip, mode=0, power=10_000)
    assert on_time(chip, 0.1) > 0.999
    stopped_s = chip.t_s
    chip.poke(timer, 0)
    chip.advance(0.5)
    assert not chip.level
    assert chip.off_since_s - stopped_s < 0.3
    assert frames.hello(command(chip, "H")).reset_cause == WATCHDOG_CAUSE


def test_a_board_that_resets_itself_is_initialised_again_at_power_zero(chip: Chip) -> None:
    board, clock = rig(chip)
    write(board, clock, 1.0)
    chip.reset()
    clock.advance(0.5)
    assert "temperature" in board.read(clock.now_s() + 0.2)
    assert board.health().counters["resets"] == 1
    assert on_time(chip, 0.2) == 0.0
    assert write(board, clock, 0.5) == 0.5


def test_a_reset_met_by_a_write_leaves_power_zero_until_the_next(chip: Chip) -> None:
    board, clock = rig(chip)
    chip.reset()
    clock.advance(0.5)
    assert write(board, clock, 1.0) == 0.0
    assert on_time(chip, 0.2) == 0.0
    assert write(board, clock, 1.0) == 1.0


def test_bursts_follow_the_zero_crossings_in_whole_cycles(chip: Chip) -> None:
    chip.crossings(48.0)  # off the nominal 50 Hz, so that the two time bases can be told apart
    configure(chip, mode=0, power=5_000)
    before_s, edges = chip.on_s, chip.edges
    chip.advance(4.0)
    cycles = (chip.on_s - before_s) * 48.0
    assert cycles == pytest.approx(96, abs=1.1)
    assert (chip.on_s - before_s) / (chip.edges - edges) == pytest.approx(1 / 48.0, rel=0.02)


@pytest.mark.parametrize(
    ("power", "angle"), [(10_000, 0.05), (7_500, 0.3678), (5_000, 0.5), (2_500, 0.6322)]
)
def test_phase_angle_opens_the_gate_behind_each_crossing(
    chip: Chip, power: int, angle: float
) -> None:
    chip.crossings(50.0)
    configure(chip, mode=1, power=power)
    edges = chip.edges
    assert on_time(chip, 1.0) == pytest.approx(0.95 - angle, abs=0.006)
    assert chip.edges - edges == 100


def test_phase_angle_without_crossings_gives_bursts_of_the_same_power(chip: Chip) -> None:
    chip.crossings(50.0)
    configure(chip, mode=1, power=2_500)
    chip.crossings(0.0)
    chip.advance(0.2)
    assert on_time(chip, 2.0) == pytest.approx(0.25, abs=0.011)
    assert frames.Flag.SYNCHRONOUS not in frames.reading(command(chip, "R")).flags


def test_the_driver_says_when_phase_angle_has_no_crossings(chip: Chip) -> None:
    board, clock = rig(chip, output_mode="phase-angle")
    clock.advance(1.0)
    board.read(clock.now_s() + 0.2)
    assert board.health().status == "degraded"
    chip.crossings(50.0)
    clock.advance(1.0)
    board.read(clock.now_s() + 0.2)
    assert board.health().status == "ok"


def test_the_sample_is_dated_to_the_middle_of_its_burst(chip: Chip) -> None:
    board, clock = rig(chip, average_periods=50)
    for _ in range(4):
        chip.analog(2000.0)
        clock.advance(1.0)
        sample = board.read(clock.now_s() + 0.2)["temperature"]
        age_s = clock.now_s() - sample.t_s
        assert 0.5 <= age_s <= 1.51
        assert sample.full_scale == 1600 * 1024


PAPER = {
    "controller": {"kind": "self-tuning-mv", "reference_time_s": 60.0},
    "model": {"structure": "known-gain", "gain_k_per_s": 0.0449},
    "estimator": {"kind": "ckf", "R2": 0.01},
}


def closed_loop(
    seconds: int, chip: Chip, initial_c: float = 35.5, law: dict[str, object] = PAPER
) -> list[float]:
    """Return the true temperatures of the rig held at 37.5 degC by the daemon's own regulator."""
    tank = TankParameters(initial_c=initial_c)
    device = wired(chip, tank, seed=3)
    board, clock = rig(device)
    configuration = {
        "boards": {"daq": {"kind": "thermodaq", "port": "lock-step"}},
        "loops": {
            "tank": {
                "setpoint_c": 37.5,
                "trip_above_c": 60.0,
                "mode": "auto",
                "sensor": {"board": "daq", "input": "temperature"},
                "actuator": {"board": "daq", "output": "heater"},
                **law,
            }
        },
    }
    regulator = regulator_for(load(configuration))
    sensor = Sensor(LM335, 5.0)
    trajectory = []
    for second in range(1, seconds + 1):
        clock.sleep_until(float(second))
        raw = board.read(clock.now_s() + 0.2).get("temperature")
        measurement = sensor.measure(raw, clock.now_s())
        assert second < 3 or measurement.quality is Quality.GOOD
        step = regulator.step(measurement)
        taken = board.write({"heater": step.command.power}, 2.5, clock.now_s() + 0.2)
        regulator.applied(taken["heater"])
        trajectory.append(device.tank.temperature_c)
    assert board.health().status == "ok"
    return trajectory


@pytest.mark.slow
def test_the_driver_holds_a_tank_through_the_firmware(
    chip: Chip, capsys: pytest.CaptureFixture[str]
) -> None:
    trajectory = closed_loop(300, chip)
    last = trajectory[-60:]
    with capsys.disabled():
        print(
            f"\nclosed loop through the firmware, 300 s: highest {max(trajectory):.2f} degC, "
            f"last minute {min(last):.2f} to {max(last):.2f} degC around 37.5"
        )
    assert max(trajectory) < 38.3
    assert abs(sum(last) / len(last) - 37.5) < 0.4


@pytest.mark.slow
def test_the_default_law_warms_a_tank_up_through_the_firmware(
    chip: Chip, capsys: pytest.CaptureFixture[str]
) -> None:
    trajectory = closed_loop(600, chip, initial_c=25.0, law={})
    rest_c = sum(trajectory[-60:]) / 60
    late = [second for second, c in enumerate(trajectory, 1) if abs(c - rest_c) > 0.1]
    with capsys.disabled():
        print(
            f"\nwarm-up through the firmware from 25 degC: within 0.1 K of {rest_c:.2f} degC after "
            f"{late[-1] + 1} s, {max(trajectory) - rest_c:.3f} K past it"
        )
    assert abs(rest_c - 37.5) < 0.4  # what the sensor is off
    assert max(trajectory) < rest_c + 0.1
    assert late[-1] < 450


@pytest.mark.slow
def test_two_runs_in_lock_step_are_identical(chip: Chip) -> None:
    assert closed_loop(30, Chip(seed=5)) == closed_loop(30, Chip(seed=5))


def test_the_gate_closes_before_every_crossing_whatever_is_commanded_meanwhile(chip: Chip) -> None:
    chip.crossings(50.0)
    configure(chip, mode=1, power=5_000)
    closed_at_s = set()
    for turn in range(300):
        power = 1_000 if turn % 2 else 9_900
        chip.send(frames.request(turn & 0xFF, "W", power, 10_000))
        chip.advance(0.0073)
        closed_at_s.add(round(chip.off_since_s % 0.01, 4))
    assert chip.on_s > 0.2
    assert max(closed_at_s) - min(closed_at_s) <= 0.0001


@pytest.mark.parametrize("letter", ["H", "R"])
def test_a_reply_begins_within_two_milliseconds_of_chip_time(chip: Chip, letter: str) -> None:
    request = frames.request(1, letter)
    chip.send(request)
    chip.advance(len(request) * 10 / 115_200)
    arrived_s = chip.t_s
    while not chip.receive():
        chip.advance(0.0001)
        assert chip.t_s - arrived_s < 0.002


def test_a_flood_of_requests_starves_neither_the_watchdog_nor_the_dead_man(chip: Chip) -> None:
    configure(chip, mode=0, power=10_000)
    command(chip, "H")
    command(chip, "W", 10_000, 1000)
    sent_s = chip.t_s
    while chip.t_s < sent_s + 2.0:
        chip.send(b">00 R*0000\n" + b"\xff" * 1000)
        chip.advance(0.08)
    assert chip.off_since_s - sent_s == pytest.approx(1.0, abs=0.03)
    chip.advance(0.5)
    chip.receive()
    state = frames.reading(command(chip, "R"))
    assert frames.Flag.RESET not in state.flags
    assert state.cut == frames.Cut.DEAD_MAN
