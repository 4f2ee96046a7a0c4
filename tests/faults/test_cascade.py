"""From a fault in a cascade to power 0 at the heater, on simulated time."""

from pathlib import Path

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.signals import RawSample, State
from thermoctl.testing import ManualClock

CONFIG = Path(__file__).parents[2] / "config"


class Bath:
    """The cascade of the profile, warm and running; a second is a cycle."""

    def __init__(self, settled_s=150):
        settings = load(CONFIG / "cascade.toml")
        board = settings.boards["daq"].model_copy(update={"initial_c": 37.5})
        settings = settings.model_copy(update={"boards": {"daq": board}})
        self.clock, self.cycles = ManualClock(), []
        self.loop = loop_for(settings, self.clock, self.cycles.append, beside=False)
        self.run(settled_s)
        for _ in range(30):  # a block that has to cool down gets nothing for some seconds
            if self.board.truth()["heater_w"] == 0.0:
                self.run(1)
        assert self.board.truth()["heater_w"] > 0.0

    @property
    def board(self):
        return self.loop.boards[0].board

    def last(self, name):
        return next(cycle for cycle in reversed(self.cycles) if cycle.loop == name)

    def run(self, seconds):
        for _ in range(seconds):
            self.clock.advance(1.0)
            self.loop.cycle(self.clock.now_s())

    def seconds_to_heater_off(self, at_most=100):
        began_s = self.clock.now_s()
        for _ in range(at_most):
            self.run(1)
            if not any(self.board.write({}, 1.0, 0.0).values()):
                return self.clock.now_s() - began_s
        raise AssertionError(f"the heater is on after {at_most} s")


@pytest.mark.parametrize(("fault", "name"), [(1, "open"), (2, "short")])
def test_a_bath_without_a_sensor_takes_the_heater_off_in_the_same_cycle(fault, name):
    bath = Bath()
    bath.board.disturb(name, 20.0)
    seconds = bath.seconds_to_heater_off()
    print(f"fault {fault}, the bath's sensor {name}: heater off after {seconds:.2f} s")
    assert seconds <= 2.0
    assert bath.last("bath").step.state is State.SAFE
    assert bath.last("block").step.state is State.RUN


def test_a_bath_that_latches_keeps_the_heater_off_for_good():
    bath = Bath()
    bath.board.disturb("spike", 40.0)
    seconds = bath.seconds_to_heater_off()
    print(f"fault 9, the bath above its limit: heater off after {seconds:.2f} s")
    assert seconds == 1.0
    while bath.last("bath").step.state is not State.LATCHED:
        bath.board.disturb("spike", 40.0)
        bath.run(1)
    for _ in range(120):
        bath.run(1)
        assert bath.last("block").accepted_power == 0.0


@pytest.mark.parametrize(("counts", "name"), [(0.0, "short"), (1.0, "open")])
def test_a_block_without_a_sensor_is_off_at_once_whatever_the_bath_wants(counts, name):
    bath = Bath()
    read = bath.board.read

    def broken(deadline_s):
        samples = dict(read(deadline_s))
        sound = samples["element"]
        samples["element"] = RawSample(sound.t_s, counts * sound.full_scale, sound.full_scale)
        return samples

    bath.board.read = broken
    seconds = bath.seconds_to_heater_off()
    print(f"fault 1, the block's sensor {name}: heater off after {seconds:.2f} s")
    assert seconds <= 2.0
    assert bath.last("block").step.state is State.SAFE
    assert bath.last("bath").step.state is State.RUN


def test_a_law_that_fails_in_the_bath_takes_the_heater_off_in_the_same_cycle():
    bath = Bath()
    steering = next(w.regulator for w in bath.loop.wirings if w.name == "bath")._steering

    def fail(situation):
        raise RuntimeError("bug")

    steering.mind.decide = fail
    seconds = bath.seconds_to_heater_off()
    print(f"fault 58, the bath's law raises: heater off after {seconds:.2f} s")
    assert seconds == 1.0
