"""A tank measured at the end of a long pipe: heat that arrives after the power was cut.

A heater that nobody knows has shown nothing after a minute. The reading rises only when it is
asked, as that of an output does which is on at power 0. So the longer first heat is a setting.
Nothing is told to the regulator but readings.
"""

from collections import deque

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.signals import Measurement, State

ROOM_C, HELD_C = 18.0, 60.0
NOISE_K, QUANTUM_K = 0.01, 0.012
MIXED_J_PER_K, LOST_W_PER_K = 4186.0 * 16.0, 4.0
ELEMENT_S, SENSOR_S = 12.0, 6.0


class PipedTank:
    """16 l whose water takes some time to the sensor; power heats by `heats`, or cools below 0.

    An output that is inverted gives what is left of full power.
    """

    def __init__(self, pipe_s, seed, heats=1.0, *, inverted=False, first_heat_s=60.0):
        self.rng = np.random.default_rng(seed)
        rated_w = self.rng.uniform(1200.0, 2000.0)
        self.heater_w, self.inverted = heats * rated_w, inverted
        self.water_c = self.sensor_c = ROOM_C
        self.pipe = deque([ROOM_C] * pipe_s)
        loop = {"setpoint_c": HELD_C, "trip_above_c": 80.0, "mode": "auto"}
        loop["heater_w"] = rated_w
        loop["heater_check"] = {"first_heat_s": first_heat_s}
        self.regulator = regulator_for(load({"loops": {"tank": loop}}))
        self.given_w = self.power = self.t_s = self.heat_s = 0.0
        self.unheated_s, self.events, self.state = 0, [], State.RUN

    def live(self, seconds, moved_k=lambda t_s: 0.0):
        """Let time pass, in which the surroundings move the sensor."""
        for _ in range(seconds):
            drive = 1.0 - self.power if self.inverted else self.power
            self.given_w += (drive * self.heater_w - self.given_w) / ELEMENT_S
            lost_w = LOST_W_PER_K * (self.water_c - ROOM_C)
            self.water_c += (self.given_w - lost_w) / MIXED_J_PER_K
            self.pipe.append(self.water_c)
            self.sensor_c += (self.pipe.popleft() - self.sensor_c) / SENSOR_S
            self.t_s += 1.0
            noisy_c = self.sensor_c + moved_k(self.t_s) + NOISE_K * self.rng.standard_normal()
            reading_c = QUANTUM_K * round(noisy_c / QUANTUM_K)
            told = self.regulator.step(Measurement(t_s=self.t_s, temperature_c=reading_c))
            self.power, self.state = told.command.power, told.state
            self.regulator.applied(self.power)
            self.events += [event.name for event in told.events]
            self.heat_s += self.power
            self.unheated_s += self.power == 0.0


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("pipe_s", [60, 100, 130])
def test_with_a_first_heat_of_twice_the_time_no_pipe_looks_like_a_heater_that_cools(pipe_s, seed):
    tank = PipedTank(pipe_s, seed, first_heat_s=2.0 * pipe_s)
    tank.live(900)
    assert not tank.events
    assert tank.state is State.RUN
    assert tank.unheated_s == 0


@pytest.mark.parametrize("seed", range(3))
def test_a_heater_that_cools_is_still_told_behind_a_pipe(seed):
    tank = PipedTank(20, seed, heats=-0.5)
    tank.live(600)
    assert tank.state is State.LATCHED
    assert "heater.reversed" in tank.events


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("pipe_s", [5, 20])
def test_an_output_that_is_on_at_power_0_is_told_while_the_water_is_cold(pipe_s, seed):
    tank = PipedTank(pipe_s, seed, inverted=True)
    tank.live(800)
    assert "heater.reversed" in tank.events
    assert tank.state is State.LATCHED
    assert tank.regulator.setpoint_c - tank.water_c > 20.0


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("drift", [1e-4, 1e-3])
def test_a_reading_that_drifts_hides_no_dead_heater(drift, seed):
    tank = PipedTank(20, seed, heats=0.0)
    tank.live(1800, lambda t_s: drift * t_s)
    assert tank.state is State.LATCHED
    assert tank.heat_s < 300
