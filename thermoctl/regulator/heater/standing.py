"""A reading that stands under full power, of which nothing is missed any more.

What `doubt` expects is less by a loss that follows the plant, for what comes near its limit rises
slower and slower. Air that has warmed for an hour in step with the power, and then stands, is
followed just so, as is a heater that dies little by little; from then on all the heat counts as
lost. But a plant that loses as much as full power brings cools without it, and at once. So a
reading that has not risen for long is asked, and one that answers is left alone for longer.
"""

from __future__ import annotations

import math

from thermoctl.regulator.heater.blocks import NEARLY_FULL, Block
from thermoctl.regulator.heater.cut import Cut
from thermoctl.regulator.heater.question import BEFORE_S, CREPT_LAGS
from thermoctl.regulator.heater.response import Gain, Seen, clear_k

STANDS_S, ANSWERED_S = 900.0, 7200.0
"""Time in s under nearly full power without a rise: until it is asked, and until it is again."""
STILL_K, STILL_SDS = 0.5, 8.0
"""Range within which a reading stands, in K and in standard deviations, the larger of the two."""
STANDS_K, SHOWS = 1.5, 2.0
"""Least heat of that time: in K by the gain that is known, and in rises that could be seen by the
least gain of a sound heater. In a first warm-up a sensor that comes to its water passes for one of
many times its gain."""


class Standing:
    """Looks at stretches of full power, and whether each has raised the reading."""

    def __init__(self, power_max: float = 1.0) -> None:
        self._full = NEARLY_FULL * power_max
        self._least_s, self._answered_c = STANDS_S, -math.inf
        self.clear()

    def clear(self) -> None:
        """Begin a stretch anew."""
        self._from: Seen | None = None
        self._lowest_c, self._highest_c = math.inf, -math.inf

    def add(self, block: Block, before: Seen) -> None:
        """Take in a block that began with `before`."""
        if block.power <= self._full:
            self.clear()
            return
        self._from = self._from or before
        self._lowest_c = min(self._lowest_c, before.reading_c)
        self._highest_c = max(self._highest_c, before.reading_c)

    def question(
        self, gain: Gain, weakest: float, now: Seen, sd_k: float, *, answered: bool
    ) -> Cut | None:
        """Return why to cut the power now, at the end of a stretch in which nothing rose.

        What has `answered` lately, to whatever question, may stand there for a reason. `weakest` is
        the least gain of a sound heater, in K/s.
        """
        if answered:
            self._least_s = ANSWERED_S
            self._answered_c = max(self._answered_c, now.reading_c)
        start, least_k = self._from, clear_k(sd_k)
        if start is None or now.t_s - start.t_s < self._least_s:
            return None
        heat_s = now.heat_s[gain.place] - start.heat_s[gain.place]
        if gain.mean * heat_s < STANDS_K or weakest * heat_s < SHOWS * least_k:
            return None
        span_s, rise_k = now.t_s - start.t_s, now.reading_c - start.reading_c
        still = self._highest_c - self._lowest_c <= max(STILL_K, STILL_SDS * sd_k)
        self.clear()
        if still and rise_k <= least_k:
            why = f"expected a rise by full power in {span_s / 60.0:.0f} min, got {rise_k:+.2f} K"
            from_s = now.t_s - max(CREPT_LAGS * gain.lag_s, BEFORE_S)
            return Cut(now.t_s, from_s, why, stands=True)
        if now.reading_c > self._answered_c + least_k:
            self._least_s = STANDS_S
        return None
