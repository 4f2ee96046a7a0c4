r"""How fast power made the reading rise, and whether it still does.

What `doubt` expects rests on a gain, a lag and a loss, and in a first warm-up none of them is
known: a reading that stops makes a heater with a longer lag and with as much loss as gain. That it
has stopped needs none of them. As much power as before has to raise the reading as fast as before,
less what a hotter plant loses more:

.. math:: \dot y \ge r - (y - y_r)\,k

A climb is taken for one from the second stretch on that is about as steep as the one before it. A
sensor that comes to the temperature of its water slows down from the first moment, and so does what
is under way when a heater dies. A climb that flattens slowly is followed: the plant comes near what
it can reach.

What made a climb is what was given during it, or what arrived of before, whichever is more: behind
a lag the pulse that brings a plant back to its set point shows once the power is down to what holds
it, and as much as that would be expected of the holding power ever after.

It is remembered while there is less power, so that a plant which failed on its way to the set point
is told as well, once as much power as before has been given for long and does nothing.
"""

from __future__ import annotations

import math

from thermoctl.quantities import clamp
from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.cut import Cut
from thermoctl.regulator.heater.doubt import (
    CALM,
    CALM_SDS,
    COOLS_WITHIN_S,
    DOUBT_K,
    DOUBT_SDS,
    HALF,
    SURE_SHARE,
)
from thermoctl.regulator.heater.question import BEFORE_LAGS
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen

STRETCH_S, STRETCH_K, STRETCH_SDS = 8.0, 0.1, 6.0
"""Least length of a stretch in s, and its least rise in K and in standard deviations of a reading;
all three must be met."""
STEEP = 0.9
"""Least rate of a stretch, as a share of that before it, for a climb to go on: what settles within
76 s slows down by more."""
KEEPS = 0.9
"""Share of the power of a climb below which no rise is expected."""
AGAIN_S, AGAIN_LAGS = 180.0, 6.0
"""After less power a rise is expected again once as much has been back for both, in s and in lags.
A jug of cold water or a stopped stirrer is over by then, and the heat under way has arrived."""
MEMORY_S = 1800.0
"""Time in s after which a climb is forgotten: the weather may have changed."""
LEAST_SHARE = 0.2
"""Least rate of a climb, as a share of what full power does, or has done at best. A slower rise may
be the weather."""
STALLS_S = 30.0
"""Time in s for which a whole climb may be missing before the heater is questioned."""
STALLED_S = 32.0
"""Least time in s before the question that is looked at, of a climb that has stalled."""
SHOWS = 0.3
"""Least gain of the heater, as a share of the gain that a climb has shown."""


class Climb:
    """Watches a reading that rises under power that is not reduced.

    Attributes
    ----------
    shown : float
        Gain in K/s that the last climb has shown at least; 0 before any, and once it is `clear`.
    since : Seen or None
        Where what is missing began to add up.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget every climb."""
        self.shown = self._rate = self._level_c = self._power = self._steepest = 0.0
        self._seen_s = -math.inf
        self.pause()

    def pause(self) -> None:
        """Expect nothing until there is as much power again, and for long enough."""
        self._wait_s = AGAIN_S
        self._steep = self._given_s = 0.0
        self._missing_k = self._expected_k = 0.0
        self._from: Seen | None = None
        self.since: Seen | None = None

    def observe(
        self, known: Gain | None, block: Block, before: Seen, now: Seen, *, jumped: bool
    ) -> None:
        """Take in what happened from `before` to `now`.

        Parameters
        ----------
        known : Gain or None
            What is known of the heater.
        block : Block
            The power and the noise of the time between.
        before, now : Seen
            Readings, one `block` apart.
        jumped : bool
            Whether the reading moved as no heater and no loss can move it.
        """
        if now.t_s - self._seen_s > MEMORY_S:
            self._rate = self._power = 0.0
        if block.power < self._least_power(known):
            self._missing_k, self._wait_s = 0.0, AGAIN_S
            if known is not None:
                self._wait_s = max(AGAIN_S, AGAIN_LAGS * known.lag_s)
        elif self._wait_s > 0.0:
            self._wait_s -= block.span_s
        elif not jumped and self._rate > 0.0:  # of a climb that is forgotten nothing is expected
            self._compare(known, block, before, now)
        start = self._from
        if start is None or jumped or now.reading_c < start.reading_c or block.power <= 0.0:
            self._from, self._given_s = now, 0.0
            return
        self._given_s += block.power * block.span_s
        span_s, rise_k = now.t_s - start.t_s, now.reading_c - start.reading_c
        if span_s >= STRETCH_S and rise_k > max(STRETCH_K, STRETCH_SDS * block.sd_k):
            power = max(self._given_s / span_s, _arrived(known, start, now))
            self._end_stretch(known, now, rise_k / span_s, power)

    def calm(self, sd_k: float) -> bool:
        """Return whether nothing is missing, so that gain and loss may be learnt."""
        if self._missing_k <= CALM * DOUBT_K:  # nearly always
            return True
        return self._missing_k <= max(CALM * self._limit_k(sd_k), CALM_SDS * sd_k)

    def stalled(self, sd_k: float) -> bool:
        """Return whether the reading does not rise as it did under the same power."""
        return self._missing_k > DOUBT_K and self._missing_k > self._limit_k(sd_k)

    def question(self, known: Gain | None, now: Seen) -> Cut:
        """Return the question why it has stalled."""
        lag_s = 0.0 if known is None else known.lag_s
        return Cut(now.t_s, now.t_s - max(BEFORE_LAGS * lag_s, STALLED_S), self._told(now))

    def _told(self, now: Seen) -> str:
        """Return what was expected since the climb began to be missing, and what came."""
        since = self.since
        if since is None or not now.t_s > since.t_s:
            return "expected a reading that goes on rising"
        span_s = now.t_s - since.t_s
        return (
            f"expected {self._expected_k:+.2f} K in {span_s:.0f} s, as the same power did before, "
            f"got {now.reading_c - since.reading_c:+.2f} K"
        )

    def _limit_k(self, sd_k: float) -> float:
        """Return the sum in K from which on it is a doubt."""
        return max(DOUBT_K, DOUBT_SDS * sd_k, STALLS_S * self._rate)

    def _expected(self, known: Gain | None, reading_c: float, power: float) -> float:
        """Return how fast the reading should rise under `power`, in K/s."""
        above_k = reading_c - self._level_c
        gain, cools_per_s = (0.0, 0.0) if known is None else (known.mean, known.cools_per_s)
        if above_k > 0.0:
            loss = above_k * max(cools_per_s, 1.0 / COOLS_WITHIN_S)
        else:
            loss = above_k * SURE_SHARE * cools_per_s
        return max(self._rate - loss - gain * max(self._power - power, 0.0), 0.0)

    def _least_power(self, known: Gain | None) -> float:
        """Return the power that should bring half of the climb at least."""
        least = KEEPS * self._power
        return least if known is None else max(least, self._power - HALF * self._rate / known.mean)

    def _compare(self, known: Gain | None, block: Block, before: Seen, now: Seen) -> None:
        """Add what is missing beyond half; no more than the climb could be, so dips are repaid."""
        span_s, rise_k = now.t_s - before.t_s, now.reading_c - before.reading_c
        expected_k = self._expected(known, now.reading_c, block.power) * span_s
        self._expected_k += expected_k
        missing_k = clamp(expected_k - rise_k, -2.0 * expected_k, expected_k) - HALF * expected_k
        if self._missing_k == 0.0:
            self.since, self._expected_k = before, expected_k
        self._missing_k = max(0.0, self._missing_k + missing_k)

    def _end_stretch(self, known: Gain | None, now: Seen, rate: float, power: float) -> None:
        """Take it for a climb that goes on, if it was as steep before; begin the next stretch."""
        steady = rate >= STEEP * self._steep > 0.0
        self._steepest = max(self._steepest, rate / power)
        strong = rate >= LEAST_SHARE * (self._steepest if known is None else known.mean)
        goes_on = now.t_s - self._seen_s > MEMORY_S or rate >= HALF * self._rate
        if steady and strong and goes_on and power >= KEEPS * self._power:
            self._missing_k = 0.0  # what was missing is over: ice that has melted
            self._rate, self._level_c = min(rate, self._steep), now.reading_c
            self._power, self._seen_s, self._wait_s = power, now.t_s, 0.0
            self.shown = self._rate / power
        self._steep = rate
        self._from, self._given_s = now, 0.0


def _arrived(known: Gain | None, start: Seen, now: Seen) -> float:
    """Return the power that arrived from `start` to `now`; of an unknown lag the most."""
    places = range(len(LAGS_S)) if known is None else (known.place,)
    heat_s = max(now.heat_s[place] - start.heat_s[place] for place in places)
    return heat_s / (now.t_s - start.t_s)
