"""The rig behind a relay controller that takes its duty once in ten seconds, and says so."""

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.app.sim import default_profile
from thermoctl.signals import State
from thermoctl.testing import ManualClock

pytestmark = pytest.mark.slow

WINDOW_S = 10
WARM_UP_S, SECONDS = 600, 1500


class Rig:
    """The simulated rig, whose heater takes a drive once in its window and reports that."""

    def __init__(self, window_s, seed=1):
        document = load(default_profile()).model_dump(exclude_none=True)
        document["loops"]["tank"]["actuator"]["window_s"] = window_s
        document["boards"]["daq"]["seed"] = seed
        self.clock, self.cycles = ManualClock(), []
        self.loop = loop_for(load(document), self.clock, self.cycles.append, beside=False)
        self.board = self.take = None
        self.stuck = False
        self.in_force = {}

    def run(self, seconds):
        for _ in range(seconds):
            self.clock.advance(1.0)
            self.loop.cycle(self.clock.now_s())
            if self.board is not self.loop.boards[0].board:
                self.board = self.loop.boards[0].board
                self.take, self.board.write = self.board.write, self.write

    def write(self, outputs, *how_long):
        """Give the board what is in force, whatever is asked for."""
        if not self.in_force or (not self.stuck and self.clock.now_s() % WINDOW_S == 0.0):
            self.in_force = dict(outputs)
        return self.take(self.in_force, *how_long)

    def told(self, name):
        return [e.t_s for c in self.cycles for e in c.step.events if e.name == name]


@pytest.mark.parametrize("seed", [1, 2])
def test_an_output_with_a_window_that_is_known_is_never_safe(seed):
    rig = Rig(WINDOW_S, seed)
    rig.run(SECONDS)
    assert {cycle.step.state for cycle in rig.cycles} == {State.RUN}
    off_k = [c.truth["true_temperature_c"] - c.step.setpoint_c for c in rig.cycles]
    print(
        f"overshoot {max(off_k):.2f} K, afterwards within {max(map(abs, off_k[WARM_UP_S:])):.2f} K"
    )
    assert max(off_k) < 0.3
    assert max(map(abs, off_k[WARM_UP_S:])) < 0.1


def test_one_that_is_not_known_is_told_at_the_end_of_the_warm_up_with_its_lateness():
    rig = Rig(0.0)
    rig.run(SECONDS)
    assert rig.told("output.readback")
    late_s = [e.fields["after_s"] for c in rig.cycles for e in c.step.events
              if e.name == "output.in_order"]  # fmt: skip
    print(f"late by {late_s} s")
    assert late_s
    assert max(late_s) <= WINDOW_S


def test_one_that_sticks_at_full_power_is_told_when_its_window_is_over():
    rig = Rig(WINDOW_S)
    rig.run(120)
    rig.stuck = True
    assert rig.in_force["heater"] > 0.9
    rig.run(SECONDS)
    commands = [(c.step.t_s, c.step.command.power) for c in rig.cycles]
    (first, *_), free_s = rig.told("output.readback"), next(t for t, p in commands[100:] if p < 0.5)
    print(f"told {first - free_s:.0f} s after the command fell")
    assert first - free_s <= 1.6 * WINDOW_S
