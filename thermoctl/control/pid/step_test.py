"""The warm-up as the step from which a plant is learnt.

Implements section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from thermoctl.control.pid.autotune import Found, GivenUp
from thermoctl.control.pid.simc import Process, simc
from thermoctl.control.pid.step_fit import ANY, StepFit, step_fit
from thermoctl.control.pid.stretch import Piece, Stretch
from thermoctl.ports import Situation

BEGIN_BELOW_K = 3.0
"""Least warm-up in K that there is to learn from."""
SHARE = 0.5
"""Largest share of the way to the set point for which the power is on."""
RISE_MIN_K = 1.0
LAGS_RISING, LAGS_COASTING = 6.0, 4.0
"""Number of lags that have to be in sight, while power is on and after."""
FIRST_LOOK_PERIODS = 10.0
NEXT_LOOK = 1.2
RESTED_RISING, RESTED_COASTING = 0.5, 0.75
"""Least total lag of a plant taken to be at rest before, as a share of the one found where that is
not taken for granted, while power is on and after. What was warming up already seems to have hardly
any lag; readings from rest differ less, and the less once the power has gone."""
AROUND = 2.0
"""How much is looked at once the power has gone, in times without it. Over more, a loss that grows
as it warms takes the place of a lag."""
CUT = 0.5
"""Power below which a plant coasts, whoever steers."""
COAST_S, COAST_SHARE = 120.0, 2.0
"""Longest time without power in a test: COAST_S seconds, and COAST_SHARE times the time with it
besides."""


@dataclass(frozen=True, slots=True)
class StepRun:
    """A step test under way.

    Parameters
    ----------
    begun_c : float
        Where it began.
    stretch : Stretch
        What was seen since.
    look_s : float
        When to fit next.
    risen_s : float
        How long the power was on; NaN while it still is.
    doubted : bool
        Whether the plant seems to have been warming up before; then the end of power has to tell.
    """

    begun_c: float
    stretch: Stretch
    look_s: float
    risen_s: float = math.nan
    doubted: bool = False


@dataclass(frozen=True, slots=True)
class StepTest:
    """Full power for a part of the way up, then SIMC for what the rise shows.

    The test ends as soon as the rise tells lag and slope. Where half the way is too short for that,
    the power goes off and the coasting tells. So it does where the plant may have been warming up
    before, by a power that nobody saw: full power that goes on tells nothing of a lag, its end does
    (decision 38).

    Parameters
    ----------
    derivative : bool
        Whether the gains are to be those of a PID.
    period_s : float
        Time between two samples.
    """

    derivative: bool
    period_s: float

    def begin(self, situation: Situation) -> StepRun | None:
        """Return the test, begun at this sample; None where there is no way to go up."""
        below_k = situation.setpoint_c - situation.temperature_c
        if not below_k >= BEGIN_BELOW_K:
            return None
        return StepRun(situation.temperature_c, Stretch(), FIRST_LOOK_PERIODS * self.period_s)

    def observe(self, run: StepRun, situation: Situation) -> StepRun:
        """Return the test after one more sample, whoever steered."""
        piece = Piece(situation.interval_s, situation.applied, situation.measured_c)
        return replace(run, stretch=run.stretch.after(piece))

    def decide(self, run: StepRun, situation: Situation) -> tuple[StepRun, float] | Found | GivenUp:
        """Return the test and the power it asks for, or what it has come to."""
        seen_s = run.stretch.length_s
        rise_k = situation.temperature_c - run.begun_c
        rising = math.isnan(run.risen_s)
        if rising and rise_k >= SHARE * (situation.setpoint_c - run.begun_c):
            run, rising = replace(run, risen_s=seen_s, look_s=seen_s), False
        if seen_s >= run.look_s and rise_k >= RISE_MIN_K:
            fit, doubted = self._told(run, seen_s, rising)
            if fit is not None:
                return self._found(fit)
            heard_s = seen_s if rising else seen_s - run.risen_s
            next_s = seen_s + max((NEXT_LOOK - 1.0) * heard_s, self.period_s)
            run = replace(run, look_s=next_s, doubted=doubted)
        if not rising and seen_s - run.risen_s > COAST_S + COAST_SHARE * run.risen_s:
            return GivenUp(f"the lag did not show within {seen_s:.0f} s")
        return run, 1.0 if rising else 0.0

    def _told(self, run: StepRun, seen_s: float, rising: bool) -> tuple[StepFit | None, bool]:
        """Return the plant once enough was seen of it, and whether rest before is doubted."""
        stretch, coasting_s = run.stretch, run.stretch.since_s(CUT)
        cut = coasting_s > 0.0
        rested = None if run.doubted and not cut else self._rested(stretch, seen_s, rising)
        if rested is None and not cut:
            return None, run.doubted
        loose = step_fit(stretch.last(AROUND * coasting_s) if cut else stretch, ANY)
        if loose is None:
            return None, run.doubted
        if rested is not None:
            share = RESTED_COASTING if cut else RESTED_RISING
            if rested.total_s >= share * loose.total_s:
                return rested, False
        tells = not loose.longest and coasting_s >= LAGS_COASTING * loose.total_s
        return loose if tells else None, run.doubted or not cut

    def _rested(self, stretch: Stretch, seen_s: float, rising: bool) -> StepFit | None:
        """Return the plant, had it been at rest before; None until enough was seen for that."""
        fit = step_fit(stretch)
        lags = LAGS_RISING if rising else LAGS_COASTING
        return fit if fit and not fit.longest and seen_s >= lags * fit.total_s else None

    def _found(self, fit: StepFit) -> Found:
        """Return the gains for a plant, to which sampling adds half a period of dead time."""
        slope, (_, lag_s) = fit.process.slope_k_per_s, fit.process.lags_s
        dead_s = fit.process.dead_s + 0.5 * self.period_s
        gains = simc(Process(slope, dead_s, (math.inf, lag_s)), derivative=self.derivative)
        text = f"{slope:.3g} K/s at full power, dead time {dead_s:.3g} s, lag {lag_s:.3g} s"
        return Found(gains, text, slope)
