"""Sensors that fall out of small vessels over strong heaters: how hot these get meanwhile.

Every test prints how far the water rose, above its set point at most, and how many seconds of full
power it was given after the fault.
"""

from pathlib import Path

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.signals import State
from thermoctl.testing import ManualClock

pytestmark = pytest.mark.slow

CONFIG = Path(__file__).parents[2] / "config" / "aquarium.toml"
VESSELS = {
    "half a litre over 1.2 kW": (
        80.0,
        {"volume_l": 0.55, "heater_w": 1200.0, "element_lag_s": 14.0, "sensor_lag_s": 2.0},
    ),
    "a litre over 2 kW": (
        75.0,
        {"volume_l": 1.0, "heater_w": 2000.0, "element_lag_s": 8.0, "sensor_lag_s": 2.0},
    ),
}
WARM_UP = {"in regulation": None, "at .4 of the warm-up": 0.4, "at .8 of the warm-up": 0.8}


HALF, LITRE = VESSELS
REST, EARLY, LATE = WARM_UP
BOUNDS = {
    (HALF, REST): (18.0, 55.0),
    (HALF, EARLY): (0.0, 60.0),
    (HALF, LATE): (15.0, 60.0),
    (LITRE, REST): (12.5, 36.0),
    (LITRE, EARLY): (-10.0, 45.0),
    (LITRE, LATE): (5.0, 34.0),
}
"""How many K above the set point, where water boils 20 and 25 K above it, and how many seconds of
full power after the fault."""
LAST_S = 150
"""Most seconds from the fault to the last power."""


class Vessel:
    """A vessel under the default controller; a second is a cycle."""

    def __init__(self, name: str, seed: int) -> None:
        settings = load(CONFIG)
        self.setpoint_c, made = VESSELS[name]
        table = settings.loops["tank"].model_dump(exclude_unset=True, exclude={"shadow"})
        table |= {"setpoint_c": self.setpoint_c, "setpoint_max_c": 90.0, "trip_above_c": 95.0}
        table |= {"trip_below_c": -5.0, "controller": "adaptive", "heater_w": made["heater_w"]}
        board = {"initial_c": 22.0, "seed": seed, "ice_kg": 0.0, **made}
        boards = {"daq": settings.boards["daq"].model_dump(exclude_unset=True) | board}
        settings = load({"boards": boards, "loops": {"tank": table}})
        self.clock, self.cycles = ManualClock(), []
        self.loop = loop_for(settings, self.clock, self.cycles.append, beside=False)

    def run(self, seconds: int) -> None:
        for _ in range(seconds):
            self.clock.advance(1.0)
            self.loop.cycle(self.clock.now_s())

    @property
    def water_c(self) -> float:
        return self.cycles[-1].truth["true_temperature_c"]

    def warm_up(self, share: float | None) -> None:
        """Heat to a `share` of the way to the set point, or until it is at rest there."""
        self.run(1)
        began_c = self.water_c
        while share is not None and self.water_c < began_c + share * (self.setpoint_c - began_c):
            self.run(1)
        if share is None:
            self.run(900)

    def until_latched(self) -> None:
        for _ in range(600):
            self.run(2)
            if self.cycles[-1].step.state is State.LATCHED:
                return
        raise AssertionError(self.cycles[-1].step.alarms)

    def names(self) -> list[str]:
        return [event.name for cycle in self.cycles for event in cycle.step.events]


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.parametrize("when", WARM_UP)
@pytest.mark.parametrize("vessel", VESSELS)
def test_a_sensor_that_falls_out_costs_some_seconds_of_power(
    vessel: str, when: str, seed: int
) -> None:
    sound = Vessel(vessel, seed)
    sound.warm_up(WARM_UP[when])
    assert "heater.questioned" not in sound.names()
    fault = len(sound.cycles)
    sound.loop.boards[0].board.disturb("sensor-out", None)
    sound.until_latched()
    after = sound.cycles[fault:]
    above_k = max(each.truth["true_temperature_c"] for each in after) - sound.setpoint_c
    full_s = sum(each.accepted_power for each in after)
    last_s = max((n for n, each in enumerate(after, 1) if each.accepted_power > 0.0), default=0)
    print(
        f"{vessel}, {when}: {above_k:+.1f} K above the set point, {full_s:.0f} s of full power, "
        f"the last after {last_s} s, latched after {len(after)} s"
    )
    most_k, most_s = BOUNDS[vessel, when]
    assert above_k < most_k
    assert full_s < most_s
    assert last_s < LAST_S
