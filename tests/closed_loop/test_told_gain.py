"""The gain that is told contains the true one, on plants that no bank has a law for."""

import math

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.insight import Insights
from thermoctl.signals import Measurement

pytestmark = pytest.mark.slow

STEFAN_BOLTZMANN = 5.67e-8
PARTS = 4


class Watched:
    """A loop with a watch beside it, and a plant that says how it moves."""

    heater_w = sensor_s = noise_k = setpoint_c = 0.0

    def __init__(self, first_c, seed=1):
        self.inside_c = self.sensor_c = first_c
        self.rng, self.t_s, self.power = np.random.default_rng(seed), 0.0, 0.0
        loop = {"setpoint_c": self.setpoint_c, "trip_above_c": self.setpoint_c + 45.0,
                "mode": "auto", "heater_w": self.heater_w}  # fmt: skip
        self.regulator = regulator_for(load({"loops": {"loop": loop}}))
        self.watch = Insights(1.0, self.heater_w)

    def run(self, seconds):
        """Return the row of the gain after every minute."""
        gains = []
        for second in range(seconds):
            for _ in range(PARTS):
                self.advance(1.0 / PARTS)
                self.sensor_c += (self.inside_c - self.sensor_c) / self.sensor_s / PARTS
            self.t_s += 1.0
            reading_c = self.sensor_c + self.noise_k * self.rng.standard_normal()
            step = self.regulator.step(Measurement(self.t_s, reading_c))
            self.power = step.command.power
            self.regulator.applied(self.power)
            self.watch.after(step, self.power)
            if second % 60 == 59:
                gains.append({row.name: row for row in self.watch.now.rows}["gain"])
        return gains


class Aquarium(Watched):
    """195 l of water with its glass and an element, in a room whose temperature swings."""

    heater_w, sensor_s, noise_k, setpoint_c = 220.0, 28.0, 0.01, 25.5
    water_j_per_k, glass_j_per_k = 7.88e5, 4.07e4

    def __init__(self, phase):
        self.element_c = self.glass_c = 24.0
        self.phase = phase
        super().__init__(24.0)

    def advance(self, span_s):
        room_c = 20.0 + 4.0 * math.sin(2.0 * math.pi * self.t_s / 43_200.0 + self.phase)
        given_w = 5.9 * (self.element_c - self.inside_c)
        to_glass_w = 62.0 * (self.inside_c - self.glass_c)
        self.element_c += span_s * (self.heater_w * self.power - given_w) / 108.0
        self.inside_c += span_s * (given_w - to_glass_w) / self.water_j_per_k
        lost_w = 7.9 * (self.glass_c - room_c)
        self.glass_c += span_s * (to_glass_w - lost_w) / self.glass_j_per_k


class Block(Watched):
    """A transistor of two grams, which loses a quarter of what full power gives, and its sensor."""

    heater_w, sensor_s, noise_k, setpoint_c = 1.14, 22.0, 0.05, 40.0
    j_per_k, room_c = 1.81, 23.5

    def __init__(self):
        super().__init__(self.room_c)

    def advance(self, span_s):
        here_k, room_k = self.inside_c + 273.15, self.room_c + 273.15
        lost_w = 0.0123 * (here_k - room_k)
        lost_w += 1.08e-3 * STEFAN_BOLTZMANN * (here_k**4 - room_k**4)
        self.inside_c += span_s * (self.heater_w * self.power - lost_w) / self.j_per_k


@pytest.mark.parametrize("phase", [0.0, 1.5, 3.9])
def test_of_an_aquarium_no_gain_is_told_that_is_not_so(phase):
    loop = Aquarium(phase)
    most = 60.0 * loop.heater_w / loop.water_j_per_k
    least = 60.0 * loop.heater_w / (loop.water_j_per_k + loop.glass_j_per_k)
    for row in loop.run(9000)[20:]:
        if row.value is not None:
            assert row.value - row.error <= most, row.text
            assert row.value + row.error >= least, row.text


def test_of_a_block_behind_a_slow_sensor_the_true_gain_is_within_the_error():
    loop = Block()
    true = 60.0 * loop.heater_w / loop.j_per_k
    for row in loop.run(900)[5:]:
        assert row.value == pytest.approx(true, abs=row.error), row.text
