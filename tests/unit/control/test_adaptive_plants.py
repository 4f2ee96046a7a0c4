"""The bank on plants at the ends of what it believes in: a pipe, and blocks that are quick."""

import math
from collections import deque

import numpy as np
import pytest

from thermoctl.control.adaptive import Adaptive
from thermoctl.estimation import start
from thermoctl.ports import Situation

NOTHING, EMPTY = start(1), np.empty(0)


class Chain:
    """Heater, water that loses heat to a room, a pipe, a sensor; seen with noise every second."""

    def __init__(self, gain, fade, heater_s, pipe_s, sensor_s, noise_k=0.01, seed=1):
        self.gain, self.fade, self.water_c, self.noise_k = gain, fade, 25.0, noise_k
        self.heat, self.sensor_c = 0.0, 25.0
        self.shares = tuple(-math.expm1(-1.0 / late_s) for late_s in (heater_s, sensor_s))
        self.pipe = deque([25.0] * pipe_s)
        self.rng = np.random.default_rng(seed)

    def reading(self, power):
        """Return what is read a second later."""
        self.heat += self.shares[0] * (power - self.heat)
        self.water_c += self.gain * self.heat - self.fade * (self.water_c - 20.0)
        self.pipe.append(self.water_c)
        self.sensor_c += self.shares[1] * (self.pipe.popleft() - self.sensor_c)
        return self.sensor_c + self.noise_k * self.rng.standard_normal()


def led(law, chain, belief, power, r, samples):
    """Return belief and power after a loop to `r`, and every temperature of the water."""
    waters, y = [], chain.sensor_c
    for _ in range(samples):
        now = Situation(0.0, 1.0, y, r, power, NOTHING, EMPTY, EMPTY, y)
        belief, power = law.decide(law.observe(belief, now), now)
        y = chain.reading(power)
        waters.append(chain.water_c)
    return belief, power, np.array(waters)


def stepped(chain, r, step_k, warm_s, step_s):
    """Return law and belief after a warm-up, then a step, and the errors of both."""
    law = Adaptive()
    belief, power, first = led(law, chain, law.start(), 0.0, r, warm_s)
    belief, _, second = led(law, chain, belief, power, r + step_k, step_s)
    return law, belief, first - r, second - r - step_k


def settled_s(errors, band_k=0.1):
    """Return after how many seconds the water is within the band for good."""
    outside = np.flatnonzero(np.abs(errors) > band_k)
    return 0 if outside.size == 0 else int(outside[-1]) + 1


@pytest.mark.slow
@pytest.mark.parametrize("pipe_s", [20, 40, 60])
def test_water_that_comes_through_a_pipe_is_neither_overheated_nor_waited_for(pipe_s):
    chain = Chain(0.094, 0.0006, heater_s=16.0, pipe_s=pipe_s, sensor_s=4.0)
    law, belief, first, second = stepped(chain, 37.5, 2.5, 1500, 900)
    assert law.plant(belief).gain_k_per_s == pytest.approx(0.094, rel=0.1)
    assert first.max() < 0.1
    assert second.max() < 0.1
    assert settled_s(second) < 7 * (pipe_s + 20)


@pytest.mark.slow
@pytest.mark.parametrize("gain", [0.7, 1.3, 2.0, 4.0])
def test_a_block_is_believed_to_be_as_quick_as_it_is(gain):
    chain = Chain(gain, 0.004, heater_s=4.0, pipe_s=1, sensor_s=2.0, noise_k=0.05)
    law, belief, first, second = stepped(chain, 60.0, 5.0, 600, 300)
    assert law.plant(belief).gain_k_per_s == pytest.approx(gain, rel=0.15)
    assert not law.remarks(belief)
    assert np.abs(first[400:]).max() < 0.2
    assert settled_s(second, 0.2) < 60
