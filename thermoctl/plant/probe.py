"""The probe: late water, a sheath that follows, a wire that can fail."""

from __future__ import annotations

import math
from collections import deque
from enum import Enum

from numpy.random import Generator

from thermoctl.model.sensor import LM335
from thermoctl.plant.noise import Wander
from thermoctl.plant.parameters import Probe

IN_AIR = 8.0
"""A sheath in still air follows so many times more slowly than in stirred water."""


class Wiring(Enum):
    """How the sensor is connected just now."""

    SOUND = "sound"
    MISSING = "missing"
    OPEN = "open"
    SHORT = "short"


_UNSOUND_V = {Wiring.MISSING: math.nan, Wiring.OPEN: math.inf, Wiring.SHORT: 0.0}


class ProbeInTank:
    """An LM335 in a sheath, downstream of the heater.

    The water it meets left the heater a transport time ago; the sheath follows it with a
    first-order lag. A parcel never goes back: when the flow slows down the probe waits.

    Parameters
    ----------
    parameters : Probe
        Transport, lag, turbulence and error.
    initial_c : float
        Temperature of everything before the start, in degC.
    rng : Generator
        Source of the turbulence.
    """

    def __init__(self, parameters: Probe, initial_c: float, rng: Generator) -> None:
        self._parameters = parameters
        self._turbulence = Wander(rng, parameters.turbulence_k, parameters.turbulence_s)
        self._t_s = 0.0
        self._past: deque[tuple[float, float]] = deque([(-math.inf, initial_c), (0.0, initial_c)])
        self._met_c = initial_c
        self._sheath_c = initial_c
        self._step_s = 0.0
        self._follow = 0.0
        self._spike_k = 0.0
        self._drift_k, self._drift_k_per_s = 0.0, 0.0
        self._wiring = Wiring.SOUND
        self._wiring_until_s = 0.0
        self._away: float | None = None
        self._away_until_s = 0.0

    @property
    def sheath_c(self) -> float:
        """Temperature of the sensing element in degC, before any error of the sensor."""
        return self._sheath_c

    @property
    def wiring(self) -> Wiring:
        """How the sensor is connected at this time."""
        return self._wiring if self._t_s < self._wiring_until_s else Wiring.SOUND

    def advance(self, step_s: float, water_c: float, *, stirred: bool) -> None:
        """Let `step_s` pass, at the end of which the water at the heater has `water_c`."""
        probe = self._parameters
        self._t_s += step_s
        self._drift_k += step_s * self._drift_k_per_s
        self._past.append((self._t_s, water_c))
        delay_s = probe.transport_s * (1.0 if stirred else probe.still_transport_factor)
        met_c = self._arriving(self._t_s - delay_s) + self._turbulence.advance(step_s)
        if step_s != self._step_s:
            self._step_s, self._follow = step_s, -math.expm1(-step_s / probe.lag_s)
        if self._away is not None:
            self._rest_away(step_s, self._away)
            return
        # The exact answer of a first-order lag to the mean of both ends of the step.
        self._sheath_c += self._follow * (0.5 * (self._met_c + met_c) - self._sheath_c)
        self._met_c = met_c

    def _rest_away(self, step_s: float, there_c: float) -> None:
        """Follow what is around the sheath outside the tank, if anything is."""
        if math.isfinite(there_c):
            follow = -math.expm1(-step_s / (IN_AIR * self._parameters.lag_s))
            self._sheath_c += follow * (there_c - self._sheath_c)
        if self._t_s >= self._away_until_s:
            self._away, self._met_c = None, self._past[-1][1]

    def leave(self, there_c: float, duration_s: float) -> None:
        """Lie outside the tank, where it has `there_c`; NaN: stand still."""
        self._away, self._away_until_s = there_c, self._t_s + duration_s

    def _arriving(self, left_s: float) -> float:
        """Return the temperature of the water that left the heater at `left_s`."""
        past = self._past
        while past[1][0] <= left_s and len(past) > 2:
            past.popleft()
        (t0_s, first_c), (t1_s, second_c) = past[0], past[1]
        if left_s >= t1_s:
            return second_c
        if left_s <= t0_s or t0_s == -math.inf:
            return first_c
        return first_c + (second_c - first_c) * (left_s - t0_s) / (t1_s - t0_s)

    def spike(self, spike_k: float) -> None:
        """Add `spike_k` to the next voltage that is read, once."""
        self._spike_k = spike_k

    def drift(self, rate_k_per_s: float) -> None:
        """Let what is read move away from the sheath by `rate_k_per_s` from now on."""
        self._drift_k_per_s = rate_k_per_s

    def rewire(self, wiring: Wiring, duration_s: float) -> None:
        """Connect the sensor as `wiring` says for `duration_s`."""
        self._wiring = wiring
        self._wiring_until_s = self._t_s + duration_s

    def volts(self) -> float:
        """Return the voltage on the wire: infinite open, 0 short, NaN missing.

        A pending spike is used up.
        """
        spike_k, self._spike_k = self._spike_k, 0.0
        if self._t_s < self._wiring_until_s and self._wiring in _UNSOUND_V:
            return _UNSOUND_V[self._wiring]
        sound_v = LM335.volts(self._sheath_c + spike_k + self._drift_k)
        return sound_v * (1.0 + self._parameters.gain_error)
