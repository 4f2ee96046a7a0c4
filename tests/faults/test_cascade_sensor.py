"""A bath whose sensor shows something else than the bath, while a block heats it."""

from pathlib import Path

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.signals import SetPoint, State
from thermoctl.testing import ManualClock

pytestmark = pytest.mark.slow

CONFIG = Path(__file__).parents[2] / "config"


class Bath:
    """The cascade of the profile; a second is a cycle."""

    def __init__(self, seed):
        settings = load(CONFIG / "cascade.toml")
        board = settings.boards["daq"].model_copy(update={"seed": seed})
        settings = settings.model_copy(update={"boards": {"daq": board}})
        self.clock, self.cycles = ManualClock(), []
        self.loop = loop_for(settings, self.clock, self.cycles.append, beside=False)

    def run(self, seconds):
        for _ in range(seconds):
            self.clock.advance(1.0)
            self.loop.cycle(self.clock.now_s())
        return self

    def of(self, name):
        return [cycle for cycle in self.cycles if cycle.loop == name]

    def events(self):
        return [event.name for cycle in self.cycles for event in cycle.step.events]


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("fault", ["sensor-out", "sensor-stuck"])
def test_a_bath_that_does_not_answer_to_its_block_ends_latched(fault, seed):
    bath = Bath(seed).run(1500)
    began_c = bath.of("bath")[-1].truth["true_temperature_c"]
    bath.loop.boards[0].board.disturb(fault, None)
    if fault == "sensor-stuck":
        bath.loop.ask(SetPoint(40.0), "bath")  # at rest it would be right for long
    for _ in range(60):
        if bath.run(60).of("bath")[-1].step.state is State.LATCHED:
            break
    latched = bath.of("bath")[-1].step
    hottest_c = max(cycle.truth["true_temperature_c"] for cycle in bath.of("bath"))
    codes = {alarm.code for alarm in latched.alarms if alarm.latched}
    print(f"{fault}, seed {seed}: {codes} at {latched.t_s:.0f} s, {hottest_c - began_c:+.1f} K")
    assert codes <= {"heater.no_response", "heater.reversed"}
    assert codes
    assert hottest_c - began_c < 12.0
    assert bath.run(60).of("block")[-1].accepted_power == 0.0


@pytest.mark.parametrize("seed", [1, 2])
def test_a_sound_cascade_is_asked_nothing_and_told_of_nothing(seed):
    bath = Bath(seed).run(1500)
    for setpoint_c in (42.0, 34.0, 37.0):  # on its way down the bath waits for the air
        bath.loop.ask(SetPoint(setpoint_c), "bath")
        bath.run(2400)
    of_bath = [event.name for cycle in bath.of("bath") for event in cycle.step.events]
    assert not [name for name in of_bath if name.startswith("heater.")]
    assert "plant.driven" not in bath.events()
    assert {cycle.step.state for cycle in bath.cycles} == {State.RUN}
