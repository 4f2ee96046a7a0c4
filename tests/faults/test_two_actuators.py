"""From a fault to power 0 where something cools: the real loop on a simulated tank.

Every test prints what it measured, in seconds from the fault to the moment from which neither
heater nor cooler is on.
"""

from pathlib import Path

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.signals import ManualPower, Mode, State
from thermoctl.testing import ManualClock

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

CONFIG = Path(__file__).parents[2] / "config"


class Tank:
    """A profile's tank at its set point, with its loop; a second is a cycle."""

    def __init__(self, profile, settled_s=150, **board):
        document = load(CONFIG / f"{profile}.toml").model_dump()
        loop = document["loops"]["tank"]
        document["boards"]["daq"] |= {"initial_c": loop["setpoint_c"], **board}
        self.clock, self.cycles = ManualClock(), []
        self.loop = loop_for(load(document), self.clock, self.cycles.append, beside=False)
        self.run(settled_s)
        assert self.last.step.state is State.RUN

    @property
    def board(self):
        return self.loop.boards[0].board

    @property
    def last(self):
        return self.cycles[-1]

    @property
    def outputs(self):
        """What the board has on its outputs now, asked without changing it."""
        return self.board.write({}, 1.0, self.clock.now_s())

    def run(self, seconds):
        for _ in range(seconds):
            self.clock.advance(1.0)
            self.loop.cycle(self.clock.now_s())

    def by_hand(self, power):
        self.loop.ask(Mode.MANUAL)
        self.loop.ask(ManualPower(power))
        self.run(70)  # it may have to wait until the other one was off for long enough
        assert self.last.accepted_power == pytest.approx(power, abs=1e-3)

    def seconds_to_all_off(self, at_most=100):
        began_s = self.clock.now_s()
        for _ in range(at_most):
            self.run(1)
            if self.last.accepted_power == 0.0 and not any(self.outputs.values()):
                return self.clock.now_s() - began_s
        raise AssertionError(f"still at {self.outputs} after {at_most} s")


@pytest.mark.parametrize("power", [0.4, -0.4])
@pytest.mark.parametrize(("fault", "name"), [(1, "open"), (2, "short")])
def test_a_broken_sensor_circuit_switches_off_whichever_is_on_in_two_seconds(fault, name, power):
    tank = Tank("heat-cool")
    tank.by_hand(power)
    tank.board.disturb(name, 20.0)
    seconds = tank.seconds_to_all_off()
    print(f"fault {fault}, sensor {name} at {power:+g}: all off after {seconds:.2f} s")
    assert seconds <= 2.0
    assert tank.last.step.state is State.SAFE


@pytest.mark.parametrize("profile", ["cool", "heat-cool"])
def test_so_it_does_in_auto(profile):
    tank = Tank(profile)
    tank.board.disturb("open", 20.0)
    seconds = tank.seconds_to_all_off()
    print(f"fault 1, sensor open, {profile} in auto: all off after {seconds:.2f} s")
    assert seconds <= 2.0


@pytest.mark.parametrize("profile", ["cool", "heat-cool"])
@pytest.mark.parametrize("spike_k", [60.0, -60.0])
def test_beyond_either_trip_it_latches_within_five_readings(profile, spike_k):
    tank = Tank(profile)
    began_s = tank.clock.now_s()
    while tank.last.step.state is not State.LATCHED:
        tank.board.disturb("spike", spike_k)
        tank.run(1)
        assert tank.clock.now_s() - began_s <= 5.0
    print(f"fault 9, {spike_k:+g} K, {profile}: latched after {tank.clock.now_s() - began_s:.2f} s")
    tank.run(60)
    assert not any(tank.outputs.values())


def test_no_trip_ever_switches_the_other_actuator_on_to_help():
    tank = Tank("heat-cool")
    tank.by_hand(0.4)
    began = len(tank.cycles)
    for _ in range(10):
        tank.board.disturb("spike", 60.0)
        tank.run(1)
    assert all(cycle.step.command.power == 0.0 for cycle in tank.cycles[began:])


def test_a_cooler_s_lost_sensor_is_ridden_with_at_most_the_holding_power_then_off():
    tank = Tank("cool", settled_s=1500)
    holding = tank.last.step.beliefs.holding_power
    tank.board.disturb("dropout", 200.0)
    began = len(tank.cycles)
    seconds = tank.seconds_to_all_off()
    ridden = [cycle for cycle in tank.cycles[began:] if cycle.step.state is State.RIDE]
    print(f"fault 16, a cooler without its sensor: off after {seconds:.0f} s")
    assert 0.0 < holding < 0.5
    assert len(ridden) > 10
    assert max(cycle.step.command.power for cycle in ridden) <= 1.3 * holding
    assert seconds <= 62.0


def test_a_daemon_that_hangs_is_cut_by_the_board_s_dead_man_on_both_sides():
    for power in (0.4, -0.4):
        tank = Tank("heat-cool")
        tank.by_hand(power)
        tank.clock.advance(2.6)
        tank.board.read(tank.clock.now_s())
        assert not any(tank.outputs.values())


def test_shutting_down_leaves_neither_on():
    tank = Tank("heat-cool")
    tank.by_hand(-0.4)
    board = tank.board
    assert tank.loop.shut_down()
    board.open(tank.clock.now_s() + 1.0)
    assert board.write({}, 1.0, 0.0) == {"heater": 0.0, "cooler": 0.0}
