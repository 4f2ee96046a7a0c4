r"""A relay that makes the plant swing, and what the swing says.

Under a relay a plant swings by itself near its ultimate period. Where power and temperature are
both known over whole cycles, their first harmonics give the plant's response at that frequency,
however lopsided the relay is:

.. math:: G(i\omega) = \frac{\int y\,e^{-i\omega t}\,dt}{\int u\,e^{-i\omega t}\,dt}

A plant that integrates behind dead time and a lag and has this response is taken for the plant, and
its limit for the ultimate one. The usual :math:`4d/(\pi a)` takes the swing for a sine; that of an
integrating plant is a triangle, and the gain then 19 % too small. Implements section 6 of
``docs/theory.md``.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from thermoctl.control.adaptive.evidence import Noise
from thermoctl.control.pid.autotune import Found, GivenUp
from thermoctl.control.pid.simc import Limit, Process, tyreus_luyben
from thermoctl.control.pid.stretch import Piece, Stretch
from thermoctl.ports import Situation
from thermoctl.quantities import Array, clamp

HYSTERESIS_SD, HYSTERESIS_MIN_K = 4.0, 0.01
"""Half the band in which the relay keeps its side, in deviations of the noise, and at least.

A wide band makes the swing slower than the plant's own, and its limit a matter of extrapolation.
"""
BAND_K = 5.0
"""Largest distance in K from the set point, once there; a test that is farther away is given up."""
JUDGED = 2
"""Number of cycles that are judged."""
ALIKE = 0.1
"""Largest difference between their lengths, as a share, for which they count."""
_HALVINGS = 50
_LAG_SHARE = 0.5
SWING_SHARE = 0.25
"""Least swing of the power, as a share of what the relay asks for; a smaller one is not the
relay's."""


def harmonic_point(
    stretch: Stretch, first_c: float, swing_min: float
) -> tuple[float, complex] | None:
    """Return the frequency in rad/s of a cycle and the plant's response to it, in K.

    Parameters
    ----------
    stretch : Stretch
        One whole cycle.
    first_c : float
        The reading at its beginning.
    swing_min : float
        Least amplitude of the power's first harmonic.

    Returns
    -------
    tuple of float and complex, or None
        None where power swings less, or a reading is missing.
    """
    t_s = stretch.times_s()
    y = np.concatenate(((first_c,), stretch.readings_c()))
    if not (np.isfinite(y).all() and t_s[-1] > 0.0):
        return None
    omega = 2.0 * math.pi / float(t_s[-1])
    given = _of_steps(t_s, np.array([piece.power for piece in stretch.pieces]), omega)
    if not 2.0 * abs(given) / t_s[-1] >= swing_min:
        return None
    return omega, _of_lines(t_s, y, omega) / given


def _of_steps(t_s: Array, levels: Array, omega: float) -> complex:
    """Return the harmonic of a function that is constant from one time to the next."""
    turns = np.exp(-1j * omega * t_s)
    return complex(levels @ np.diff(turns)) / (-1j * omega)


def _of_lines(t_s: Array, y: Array, omega: float) -> complex:
    """Return the harmonic of straight lines over a cycle, by parts from that of their slopes.

    A drift is the same slope all the time, and drops out.
    """
    return _of_steps(t_s, np.diff(y) / np.diff(t_s), omega) / (1j * omega)


def integrating_plant(omega: float, response: complex) -> Process | None:
    """Return the integrating plant of this response; None where none has it.

    One point of a response gives two numbers, so its lag is taken to be half its dead time. The
    limit beside that point is then right within some 10 %, whether there is only dead time or there
    are mainly lags. A response ahead of an integrator is that of no such plant.
    """
    behind = -cmath.phase(response) % (2.0 * math.pi) - 0.5 * math.pi
    if not 0.0 < behind <= math.pi:
        return None
    turn = _crossing(lambda x: x + math.atan(_LAG_SHARE * x) - behind, behind)
    slope = abs(response) * omega * math.hypot(1.0, _LAG_SHARE * turn)
    dead_s = turn / omega
    return Process(slope, dead_s, (math.inf, _LAG_SHARE * dead_s)) if slope > 0.0 else None


def limit_of(process: Process) -> Limit:
    """Return where an integrating plant begins to swing under proportional control."""
    _, *lags_s = process.lags_s

    def behind(omega: float) -> float:
        turned = sum(math.atan(lag_s * omega) for lag_s in lags_s)
        return omega * process.dead_s + turned - 0.5 * math.pi

    omega = _crossing(behind, 0.5 * math.pi / process.dead_s)
    damped = math.prod(math.hypot(1.0, lag_s * omega) for lag_s in lags_s)
    return Limit(omega * damped / process.slope_k_per_s, 2.0 * math.pi / omega)


def _crossing(rising: Callable[[float], float], high: float) -> float:
    """Return where a function that rises from below 0 to above it in [0, high] crosses it."""
    low = 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rising(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


@dataclass(frozen=True, slots=True)
class RelayRun:
    """A relay test under way.

    Parameters
    ----------
    begun_c : float
        Where it began.
    centre : float
        Power about which it switches.
    on : bool
        Its side.
    arrived : bool
        Whether the set point was reached.
    switched_c : float
        Temperature where it last switched on.
    noise : Noise
        That of the readings.
    cycle : Stretch
        Since it last switched on.
    before : tuple of (float, Stretch)
        Whole cycles before, each with the temperature it began at.
    """

    begun_c: float
    centre: float
    on: bool = True
    arrived: bool = False
    switched_c: float = math.nan
    noise: Noise = field(default_factory=Noise)
    cycle: Stretch = field(default_factory=Stretch)
    before: tuple[tuple[float, Stretch], ...] = ()

    @property
    def hysteresis_k(self) -> float:
        """Half the band in which the relay keeps its side."""
        return max(HYSTERESIS_SD * math.sqrt(self.noise.variance), HYSTERESIS_MIN_K)


@dataclass(frozen=True, slots=True)
class RelayTest:
    """Swing about the set point until two cycles are alike, then Tyreus and Luyben.

    Half of a long way up goes at full power; the rest and the swing at that of the relay, whose
    middle follows the mean power of its cycles.

    Parameters
    ----------
    derivative : bool
        Whether the gains are to be those of a PID.
    amplitude : float
        How far the power goes from its middle, at most .5.
    period_s : float
        Time between two samples; half of it is dead time, which the plant alone does not have.
    """

    derivative: bool
    amplitude: float
    period_s: float

    def begin(self, situation: Situation) -> RelayRun | None:
        """Return the test, begun at this sample."""
        centre = clamp(situation.applied, self.amplitude, 1.0 - self.amplitude)
        return RelayRun(situation.temperature_c, centre)

    def observe(self, run: RelayRun, situation: Situation) -> RelayRun:
        """Return the test after one more sample, whoever steered."""
        piece = Piece(situation.interval_s, situation.applied, situation.measured_c)
        read = math.isfinite(situation.measured_c)
        noise = run.noise.after(situation.measured_c) if read else run.noise
        return replace(run, noise=noise, cycle=run.cycle.after(piece))

    def decide(
        self, run: RelayRun, situation: Situation
    ) -> tuple[RelayRun, float] | Found | GivenUp:
        """Return the test and the power it asks for, or what it has come to."""
        error_k = situation.setpoint_c - situation.temperature_c
        if run.arrived and abs(error_k) > BAND_K:
            return GivenUp(f"{abs(error_k):.1f} K from the set point, expected {BAND_K:g} at most")
        on = error_k > 0.0 if abs(error_k) > run.hysteresis_k else run.on
        if on and not run.on:
            run = self._after_cycle(run, situation)
            found = self._found(run)
            if found is not None:
                return found
        run = replace(run, on=on, arrived=run.arrived or not on)
        if not run.arrived and error_k > max(0.5 * (situation.setpoint_c - run.begun_c), BAND_K):
            return run, 1.0
        return run, run.centre + (self.amplitude if on else -self.amplitude)

    def _after_cycle(self, run: RelayRun, situation: Situation) -> RelayRun:
        """Return the test with the next cycle begun, about the power that the last one took."""
        before, centre = run.before, run.centre
        if math.isfinite(run.switched_c) and run.cycle.length_s > 0.0:
            before = (*before, (run.switched_c, run.cycle))[-JUDGED:]
            mean = float(run.cycle.given_s()[-1]) / run.cycle.length_s
            centre = clamp(mean, self.amplitude, 1.0 - self.amplitude)
        return replace(
            run,
            centre=centre,
            switched_c=situation.temperature_c,
            cycle=Stretch(),
            before=before,
        )

    def _found(self, run: RelayRun) -> Found | None:
        """Return the gains once the last cycles are alike."""
        lengths_s = [cycle.length_s for _, cycle in run.before]
        if len(lengths_s) < JUDGED or max(lengths_s) > (1.0 + ALIKE) * min(lengths_s):
            return None
        swing_min = SWING_SHARE * 4.0 * self.amplitude / math.pi
        points = [harmonic_point(cycle, first_c, swing_min) for first_c, cycle in run.before]
        plants = [integrating_plant(*point) for point in points if point is not None]
        known = [plant for plant in plants if plant is not None]
        if len(known) < JUDGED:
            return None
        slope = sum(each.slope_k_per_s for each in known) / len(known)
        dead_s = sum(each.dead_s for each in known) / len(known)
        lags_s = (math.inf, _LAG_SHARE * dead_s)
        limit = limit_of(Process(slope, dead_s + 0.5 * self.period_s, lags_s))
        gains = tyreus_luyben(limit, derivative=self.derivative)
        text = f"ultimate gain {limit.gain_per_k:.3g} per K, period {limit.period_s:.3g} s"
        return Found(gains, text, slope, run.centre)
