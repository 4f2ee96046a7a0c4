r"""A relay that makes the plant swing, and what the swing says.

Under a relay a plant swings by itself near its ultimate period. Where power and temperature are
both known over whole cycles, their first harmonics give the plant's response at that frequency,
however lopsided the relay is:

.. math:: G(i\omega) = \frac{\int y\,e^{-i\omega t}\,dt}{\int u\,e^{-i\omega t}\,dt}

A plant that integrates behind dead time and has this response is taken for the plant, and its
limit for the ultimate one. The usual :math:`4d/(\pi a)` takes the swing for a sine; that of an
integrating plant is a triangle, and the gain then 19 % too small. Implements section 6 of
``docs/theory.md``.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field, replace

import numpy as np

from thermoctl.control.simc import Limit, Process, tyreus_luyben
from thermoctl.control.step_test import Found, GivenUp
from thermoctl.control.stretch import Piece, Stretch
from thermoctl.ports import Situation
from thermoctl.quantities import Array, clamp

HYSTERESIS_K = 0.05
"""Half the band in which the relay keeps its side: ten times the noise of a good sensor."""
BAND_K = 5.0
"""Once at the set point, a test that is further from it than this is given up."""
JUDGED = 2
"""Cycles that are judged."""
ALIKE = 0.1
"""They are when their lengths differ by at most this share."""


def harmonic_point(stretch: Stretch, first_c: float, cycles: int) -> tuple[float, complex] | None:
    """Return the frequency in rad/s of a swing and the plant's response to it, in K.

    Parameters
    ----------
    stretch : Stretch
        So many whole cycles, each reading valid.
    first_c : float
        The reading at its beginning.
    cycles : int
        How many.

    Returns
    -------
    tuple of float and complex, or None
        None where power does not swing, or a reading is missing.
    """
    t_s = stretch.times_s()
    y = np.concatenate(((first_c,), stretch.readings_c()))
    if not (np.isfinite(y).all() and t_s[-1] > 0.0):
        return None
    omega = 2.0 * math.pi * cycles / float(t_s[-1])
    y = y - y[0] - (y[-1] - y[0]) * t_s / t_s[-1]  # what drifts is no part of the swing
    power = np.array([piece.power for piece in stretch.pieces])
    given = _of_steps(t_s, power, omega)
    if abs(given) <= 1e-9 * t_s[-1]:
        return None
    return omega, _of_lines(t_s, y, omega) / given


def _of_steps(t_s: Array, levels: Array, omega: float) -> complex:
    """Return the harmonic of a function that is constant from one time to the next."""
    turns = np.exp(-1j * omega * t_s)
    return complex(levels @ np.diff(turns)) / (-1j * omega)


def _of_lines(t_s: Array, y: Array, omega: float) -> complex:
    """Return the harmonic of straight lines from 0 to 0, by parts from that of their slopes."""
    return _of_steps(t_s, np.diff(y) / np.diff(t_s), omega) / (1j * omega)


def integrating_plant(omega: float, response: complex) -> Process | None:
    """Return the integrating plant with dead time of this response; None where none has it."""
    dead_s = (-cmath.phase(response) % (2.0 * math.pi) - 0.5 * math.pi) / omega
    slope = abs(response) * omega
    return Process(slope, dead_s) if slope > 0.0 and dead_s > 0.0 else None


def limit_of(process: Process) -> Limit:
    """Return where an integrating plant with dead time begins to swing."""
    return Limit(0.5 * math.pi / (process.slope_k_per_s * process.dead_s), 4.0 * process.dead_s)


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
    cycle : Stretch
        Since then.
    before : tuple of (float, Stretch)
        Whole cycles before, each with the temperature it began at.
    """

    begun_c: float
    centre: float
    on: bool = True
    arrived: bool = False
    switched_c: float = math.nan
    cycle: Stretch = field(default_factory=Stretch)
    before: tuple[tuple[float, Stretch], ...] = ()


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
    """

    derivative: bool
    amplitude: float

    def begin(self, situation: Situation) -> RelayRun | None:
        """Return the test, begun at this sample."""
        centre = clamp(situation.applied, self.amplitude, 1.0 - self.amplitude)
        return RelayRun(situation.temperature_c, centre)

    def observe(self, run: RelayRun, situation: Situation) -> RelayRun:
        """Return the test after one more sample, whoever steered."""
        piece = Piece(situation.interval_s, situation.applied, situation.measured_c)
        return replace(run, cycle=run.cycle.after(piece))

    def decide(
        self, run: RelayRun, situation: Situation
    ) -> tuple[RelayRun, float] | Found | GivenUp:
        """Return the test and the power it asks for, or what it has come to."""
        error_k = situation.setpoint_c - situation.temperature_c
        if run.arrived and abs(error_k) > BAND_K:
            return GivenUp(f"{abs(error_k):.1f} K from the set point, expected {BAND_K:g} at most")
        on = error_k > 0.0 if abs(error_k) > HYSTERESIS_K else run.on
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
        points = [harmonic_point(cycle, first_c, 1) for first_c, cycle in run.before]
        plants = [integrating_plant(*point) for point in points if point is not None]
        known = [plant for plant in plants if plant is not None]
        if len(known) < JUDGED:
            return None
        slope = sum(each.slope_k_per_s for each in known) / len(known)
        dead_s = sum(each.dead_s for each in known) / len(known)
        limit = limit_of(Process(slope, dead_s))
        gains = tyreus_luyben(limit, derivative=self.derivative)
        text = f"ultimate gain {limit.gain_per_k:.3g} per K, period {limit.period_s:.3g} s"
        return Found(gains, text, slope, run.centre)
