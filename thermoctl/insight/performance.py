"""A loop against the steadiest that its delay allows, and why it is not.

Explained in ``docs/insight.md``.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from thermoctl.insight.harris import Harris, autocorrelation, harris
from thermoctl.insight.lagged_power import DEAD
from thermoctl.insight.swing import Swing, swing_of
from thermoctl.insight.values import Limit, Performance
from thermoctl.insight.wording import plain
from thermoctl.quantities import Array

SHORTEST_S, SHORTEST_LAGS = 1_800.0, 100.0
"""Least length of a stretch that is judged: in s and in lags, the longer of the two."""
LONGEST = 3_600
"""Largest number of samples that are judged: the newest ones."""
FEWEST = 600
"""Least number of samples that are judged."""
TURN_S = 60.0
"""Time from one judgement to the next."""
AT_BOUND = 0.05
"""Share of the time at a bound beyond which the power is what limits."""
NEAR = 1e-3
"""Largest distance from a bound at which a power is at it."""
STEPS = 1.5
"""Deviation, in steps of the sensor, below which these are what limits."""
NOISY = 0.5
"""Share of noise in the variance beyond which it is what limits."""
CLOSE = 1.25
"""Ratio of the deviation to the bound below which it is close to it."""


def delay_samples(lag_s: float, period_s: float) -> int:
    """Return d: whole periods of the dead time, and the one in which a power is held."""
    return math.floor(DEAD * lag_s / period_s) + 1


class PerformanceWatch:
    """Collects control errors, and judges them once a minute.

    Parameters
    ----------
    period_s : float
        Time between two samples.
    power_min, power_max : float
        Least and most power that is given.
    """

    def __init__(self, period_s: float, power_min: float = 0.0, power_max: float = 1.0) -> None:
        self._period_s = period_s
        self._powers = (power_min + NEAR, power_max - NEAR)
        self._error: deque[float] = deque(maxlen=LONGEST)
        self._reading: deque[float] = deque(maxlen=LONGEST)
        self._given: deque[float] = deque(maxlen=LONGEST)
        self._due_s = -math.inf
        self.now = Performance("collecting: not at rest in mode auto yet")

    def forget(self, why: str) -> None:
        """Begin anew, for a reason that the verdict tells."""
        for each in (self._error, self._reading, self._given):
            each.clear()
        self.now = Performance(why)
        self._due_s = -math.inf

    def after(
        self,
        t_s: float,
        reading_c: float,
        setpoint_c: float,
        power: float,
        lag_s: float,
        sd: float,
        gain_k_per_s: float = math.nan,
    ) -> Performance:
        """Take a sample at rest; return the judgement, at most a minute old.

        Parameters
        ----------
        t_s : float
            Its time.
        reading_c, setpoint_c : float
            What is read and what is wanted.
        power : float
            What is given now.
        lag_s : float
            Total lag of the plant.
        sd : float
            Standard deviation of a reading, in K.
        gain_k_per_s : float
            Heating rate at full power; NaN where nobody knows it.
        """
        self._error.append(reading_c - setpoint_c)
        self._reading.append(reading_c)
        self._given.append(power)
        if t_s >= self._due_s:
            self._due_s = t_s + TURN_S
            self.now = self._judged(lag_s, sd, gain_k_per_s)
        return self.now

    def _needed(self, lag_s: float) -> int:
        span = max(SHORTEST_S, SHORTEST_LAGS * lag_s) / self._period_s
        return min(LONGEST, max(FEWEST, math.ceil(span)))

    def _judged(self, lag_s: float, noise_sd_k: float, gain_k_per_s: float) -> Performance:
        needed, count = self._needed(lag_s), len(self._error)
        if count < needed:
            share = plain(100.0 * count / needed)
            return Performance(f"collecting: {share} % of what is needed")
        error = np.array(self._error)
        found = harris(error, delay_samples(lag_s, self._period_s))
        if found is None:
            return Performance("the readings do not move: nothing to judge")
        step_k = smallest_step(np.array(self._reading))
        given, (low, high) = np.array(self._given), self._powers
        limited = float(np.mean((given <= low) | (given >= high))) > AT_BOUND
        swing = swing_of(error, given, self._period_s, lag_s, gain_k_per_s)
        limit, why = reason(error, found, swing, self._period_s, lag_s, noise_sd_k, step_k, limited)
        return Performance(
            why,
            limit,
            found.index,
            2.0 * found.index_sd,
            found.deviation_k,
            found.bound_k,
            found.ratio,
        )


def smallest_step(reading: Array) -> float:
    """Return the least difference of two readings that differ, in K; 0 where none do."""
    values = np.unique(np.round(reading, 9))
    return float(np.diff(values).min()) if len(values) > 1 else 0.0


def reason(
    error: Array,
    found: Harris,
    swing: Swing | None,
    period_s: float,
    lag_s: float,
    noise_sd_k: float,
    step_k: float,
    limited: bool,
) -> tuple[Limit, str]:
    """Return what keeps a loop from being steadier, and the sentence that says so.

    Parameters
    ----------
    error : ndarray, shape (N,)
        Control errors in K.
    found : Harris
        Their index.
    swing : Swing or None
        Their cycle, if there is one.
    period_s, lag_s : float
        Time between two samples, total lag of the plant.
    noise_sd_k, step_k : float
        Standard deviation of a reading, and the sensor's smallest step.
    limited : bool
        Whether the power was at a bound for more than `AT_BOUND` of the time.
    """
    deviation_k, ratio = found.deviation_k, f"{plain(found.ratio, 2)} times the bound"
    if found.ratio < CLOSE:
        swing = None
    if swing is not None and swing.elsewhere:
        return Limit.ELSEWHERE, f"{ratio}: {swing.words}"
    if limited:
        return Limit.POWER, f"{ratio}: the power is at its limit, no law could give more"
    if deviation_k < STEPS * step_k:
        return Limit.STEP, f"{ratio}: the sensor's step of {plain(1e3 * step_k)} mK limits you"
    if swing is not None:
        return Limit.CYCLE, f"{ratio}: {swing.words}, the loop swings"
    if noise_sd_k**2 > NOISY * deviation_k**2:
        return Limit.NOISE, f"{ratio}: noise of {plain(1e3 * noise_sd_k)} mK a reading limits you"
    if found.ratio < CLOSE:
        return Limit.NONE, f"{ratio}: close to what this delay allows"
    if sluggish(error, period_s, lag_s):
        return (
            Limit.LAG,
            f"{ratio}: disturbances stay for long, the law could be brisker (less calmness)",
        )
    return Limit.LAG, f"{ratio}: the lag limits you; calmness trades travel for deviation"


def sluggish(error: Array, period_s: float, lag_s: float) -> bool:
    """Return whether errors stay on one side for longer than two lags."""
    e = error - error.mean()
    reach = min(len(e) // 4, math.ceil(2.0 * lag_s / period_s))
    return bool(reach > 0 and np.all(autocorrelation(e, reach) > 0.3))
