"""The acquisition: noise, aliased pickup, a burst, a quantiser.

Pickup is a sine whose phase runs on between conversions at a mains frequency that wanders a
little. Each conversion sees it at its own instant, so one conversion a second folds it to
0 to 0.02 Hz, where it looks like temperature, and a burst over whole mains periods adds it up
to nothing. `tests/unit/plant/test_acquisition.py` shows both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from thermoctl.plant.noise import Wander
from thermoctl.quantities import Array
from thermoctl.ranges import require

TWO_PI = 2.0 * math.pi
BLOCK_BURSTS = 64


@dataclass(frozen=True, slots=True)
class AcquisitionParameters:
    """The converter and what its input catches.

    Parameters
    ----------
    bits : int
        10 (ATmega328P), 12 or 16; any from 8 to 24.
    reference_v : float
        Voltage at full scale.
    conversions : int
        Conversions in a burst, 1 to 1,000.
    burst_s : float
        Time they are spread over; 40 ms are two periods of 50 Hz, 33.3 ms of 60 Hz.
    noise_v : float
        White noise of sensor and converter, rms per conversion; 1 mV is 0.1 K.
    pickup_v : float
        Amplitude of the mains pickup on an unscreened LM335 lead of a metre: 3 mV, 0.3 K.
    mains_hz, mains_spread_hz, mains_s : float
        Mains frequency, its standard deviation (the grid keeps 20 mHz) and correlation time.

    Raises
    ------
    ValueError
        When any number lies outside its range; the message names it.
    """

    bits: int = 10
    reference_v: float = 5.0
    conversions: int = 32
    burst_s: float = 0.040
    noise_v: float = 1e-3
    pickup_v: float = 3e-3
    mains_hz: float = 50.0
    mains_spread_hz: float = 0.02
    mains_s: float = 300.0

    def __post_init__(self) -> None:
        require("bits", self.bits, 8, 24)
        require("reference_v", self.reference_v, 0.1, 100.0)
        require("conversions", self.conversions, 1, 1000)
        require("burst_s", self.burst_s, 0.0, 1.0)
        require("noise_v", self.noise_v, 0.0, 1.0)
        require("pickup_v", self.pickup_v, 0.0, 1.0)
        require("mains_hz", self.mains_hz, 45.0, 65.0)
        require("mains_spread_hz", self.mains_spread_hz, 0.0, 0.5)
        require("mains_s", self.mains_s, 1.0, 1e5)

    @property
    def full_scale(self) -> int:
        """Counts of a whole burst at the reference voltage."""
        return int(self.conversions * 2**self.bits)


class Acquisition:
    """Turns a voltage into the sum of a burst of counts.

    Parameters
    ----------
    parameters : AcquisitionParameters
        The converter and what its input catches.
    rng : Generator
        Source of noise and of the mains' frequency.
    """

    def __init__(self, parameters: AcquisitionParameters, rng: Generator) -> None:
        self._parameters = parameters
        self._rng, frequency_rng = rng.spawn(2)
        self._frequency = Wander(frequency_rng, parameters.mains_spread_hz, parameters.mains_s)
        self._phase = TWO_PI * float(frequency_rng.random())
        self._offsets_s = (
            np.arange(parameters.conversions) * parameters.burst_s / parameters.conversions
        )
        self._top = 2.0**parameters.bits - 1.0
        self._counts_per_v = 2.0**parameters.bits / parameters.reference_v
        # An array, though of one number: a float would be made one anew at every burst.
        self._pickup = np.array(parameters.pickup_v * self._counts_per_v)
        self._ones = np.ones(parameters.conversions)
        self._noise: list[Array] = []  # of the next bursts
        self._reach = 0.0  # no conversion of this block lies farther from its voltage, in counts

    def advance(self, interval_s: float) -> None:
        """Let `interval_s` pass; the mains turn on."""
        hz = self._parameters.mains_hz + self._frequency.advance(interval_s)
        self._phase = math.fmod(self._phase + TWO_PI * hz * interval_s, TWO_PI)

    def convert(self, volts: float) -> int:
        """Return the sum of a burst at `volts`, which may be infinite; not NaN.

        A burst takes no time of the tank: its conversions lie `burst_s` / `conversions` apart,
        the first of them now.

        Raises
        ------
        ValueError
            When `volts` is NaN: nothing is connected, so nothing can be converted.
        """
        if math.isnan(volts):
            raise ValueError("volts must be a number or infinite, got nan")
        hz = self._parameters.mains_hz + self._frequency.value
        level, noise = volts * self._counts_per_v, self._next_noise()
        seen = TWO_PI * hz * self._offsets_s
        seen += self._phase
        np.sin(seen, out=seen)
        seen *= self._pickup
        seen += noise
        seen += level
        np.rint(seen, out=seen)
        if not self._reach < level < self._top - self._reach:  # else none meets an end of the scale
            np.maximum(seen, 0.0, out=seen)
            np.minimum(seen, self._top, out=seen)
        return int(seen.dot(self._ones))  # of whole numbers, so exact; `sum` takes longer

    def _next_noise(self) -> Array:
        """Return white noise in counts for one burst; in blocks, at less than half the price."""
        if not self._noise:
            shape = (BLOCK_BURSTS, self._parameters.conversions)
            deviation = self._parameters.noise_v * self._counts_per_v
            block = self._rng.standard_normal(shape) * deviation
            self._reach = float(self._pickup + np.abs(block).max()) + 1.0  # for rounding
            self._noise = list(block[::-1])
        return self._noise.pop()
