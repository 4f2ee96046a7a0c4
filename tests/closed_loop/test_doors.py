"""An incubator whose door is opened: what comes back by itself proves nothing of the heater.

Air, walls and a finned element; the air falls by kelvins in seconds and is warmed by the walls once
the door is shut. Nothing is told to the regulator but readings.
"""

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.signals import Measurement, State

ROOM_C, HELD_C, DOOR_W_PER_K = 21.0, 37.0, 8.0
NOISE_K, QUANTUM_K = 0.02, 0.0125
SETTLED_S = 6000


class Incubator:
    """One specimen of many, 15 % of tolerance each."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        litres = self.rng.uniform(0.5, 2.0)  # of 60
        self.air_j = self._about(150.0 + 72.0 * litres)
        self.wall_j, self.to_wall = self._about(9000.0 * litres), self._about(9.0 * litres)
        self.to_room, self.leak = self._about(1.1 * litres**0.67), self._about(0.15)
        self.fins_j, self.to_air = self._about(250.0), self._about(6.0)
        self.heater_w, self.sensor_s = (
            self._about(90.0 * litres + 30.0),
            self.rng.uniform(8.0, 25.0),
        )
        self.fins_c = self.air_c = self.wall_c = self.sensor_c = ROOM_C
        self.door, self.stuck = 0.0, False
        loop = {"setpoint_c": HELD_C, "trip_above_c": 50.0, "mode": "auto"}
        loop["heater_w"] = self.heater_w
        self.regulator, self.t_s, self.power = (
            regulator_for(load({"loops": {"box": loop}})),
            0.0,
            0.0,
        )
        self.events, self.state, self.lowest_c = [], State.RUN, ROOM_C

    def _about(self, value):
        return float(value * np.exp(0.15 * self.rng.standard_normal()))

    def live(self, seconds, door=0.0):
        self.door, self.lowest_c = door, self.air_c
        for _ in range(seconds):
            for _ in range(4):
                self._warm(0.25)
            self.t_s += 1.0
            noisy_c = self.sensor_c + NOISE_K * self.rng.standard_normal()
            reading_c = QUANTUM_K * round(noisy_c / QUANTUM_K)
            told = self.regulator.step(Measurement(t_s=self.t_s, temperature_c=reading_c))
            self.power, self.state = told.command.power, told.state
            self.regulator.applied(self.power)
            self.events += [event.name for event in told.events]
            self.lowest_c = min(self.lowest_c, self.air_c)

    def _warm(self, step_s):
        power = 1.0 if self.stuck else self.power
        given = self.to_air * (self.fins_c - self.air_c)
        passed = self.to_wall * (self.air_c - self.wall_c)
        lost = (self.leak + self.door) * (self.air_c - ROOM_C)
        self.fins_c += step_s * (power * self.heater_w - given) / self.fins_j
        self.air_c += step_s * (given - passed - lost) / self.air_j
        self.wall_c += step_s * (passed - self.to_room * (self.wall_c - ROOM_C)) / self.wall_j
        self.sensor_c += step_s * (self.air_c - self.sensor_c) / self.sensor_s


def opened(seed, seconds, door=DOOR_W_PER_K):
    """Return an incubator ten minutes after its door was opened for some seconds."""
    box = Incubator(seed)
    box.live(SETTLED_S)
    box.events.clear()
    box.live(seconds, door)
    assert box.lowest_c < HELD_C - 2.5
    box.live(600)
    return box


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "seconds"), [(0, 60), (5, 60), (6, 30), (6, 60)])
def test_air_that_walls_warm_is_no_heater_stuck_on(seed, seconds):
    box = opened(seed, seconds)
    assert box.state is State.RUN
    assert abs(box.air_c - HELD_C) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("door_s", [0, 30])
@pytest.mark.parametrize("seed", [5, 6])
def test_a_heater_that_is_stuck_on_is_found_door_or_not(seed, door_s):
    box = Incubator(seed)
    box.live(SETTLED_S)
    box.live(door_s, DOOR_W_PER_K)
    box.stuck = True
    box.live(300)
    assert box.state is State.LATCHED
    assert "heater.stuck_on" in box.events
