"""A loop that is held, and never comes to rest.

It has no index, for that is of loops at rest. But who has such a loop will ask why.
"""

from __future__ import annotations

import math

from thermoctl.insight.samples import Samples
from thermoctl.insight.swing import swing_of
from thermoctl.insight.values import Limit, Performance
from thermoctl.insight.wording import plain

WAIT_S, WAIT_LAGS = 3_600.0, 100.0
"""Time at the set point after which a loop that is not at rest is restless: in s and in lags, the
longer of the two."""
JUDGED = 0.5
"""Share of that time that is judged, the later part."""
TURN_S = 60.0
"""Time from one judgement to the next."""


class Restless:
    """Waits for a loop to come to rest, and says what it does instead."""

    def __init__(self) -> None:
        self._begin_s = math.nan
        self._due_s = -math.inf

    def begin(self) -> None:
        """Begin anew, because somebody moved the loop."""
        self._begin_s, self._due_s = math.nan, -math.inf

    def after(
        self,
        t_s: float,
        samples: Samples,
        setpoint_c: float,
        lag_s: float,
        gain_k_per_s: float,
        *,
        near: bool,
    ) -> Performance | None:
        """Take a sample of a held loop; return the judgement when one is due.

        Parameters
        ----------
        t_s : float
            Its time.
        samples : Samples
            What was read and given lately.
        setpoint_c : float
            What is wanted.
        lag_s, gain_k_per_s : float
            Total lag of the plant, and its heating rate at full power, as they are believed.
        near : bool
            Whether the reading is at the set point now. Before it ever was, it is on its way.
        """
        if math.isnan(self._begin_s):
            self._begin_s = t_s if near else math.nan
        wait_s = max(WAIT_S, WAIT_LAGS * lag_s)
        if not t_s - self._begin_s >= wait_s or t_s < self._due_s:
            return None
        self._due_s = t_s + TURN_S
        seen = samples.between(t_s - JUDGED * wait_s, t_s, lag_s)
        if seen is None:
            return None
        error = seen.reading_c - setpoint_c
        deviation_k = float(error.std())
        words = f"never at rest: a deviation of {plain(deviation_k, 2)} K"
        if (mean_k := float(error.mean())) * mean_k > 0.25 * deviation_k**2:
            words += f", {plain(abs(mean_k), 2)} K too {'warm' if mean_k > 0.0 else 'cold'}"
        swing = swing_of(error, seen.applied, seen.period_s, lag_s, gain_k_per_s)
        if swing is None:
            return Performance(words, deviation_k=deviation_k)
        limit = Limit.ELSEWHERE if swing.elsewhere else Limit.CYCLE
        return Performance(f"{words}, {swing.words}", limit, deviation_k=deviation_k)
