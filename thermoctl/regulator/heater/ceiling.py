"""What a plant can reach, and how it is told from a reading that has stopped.

A kettle that boils below its set point stands under full power, and goes on standing for a while
without any: what its element has stored boils on. To a question that looks like a sensor which
shows the same for ever, and the heater is condemned. Later the two part. Without power the kettle
falls, and when the power comes back it rises to where it stood and no further. A sensor that has
stopped does not fall, and under a dead heater nothing rises again.

So a reading that stood when it was asked is followed, whatever it answered. One that fell without
power and came back with it, and that a sound heater explains better than a dead one, has found the
ceiling of its plant. There no power has an effect that could be seen, and none is missed or learnt
from. Below it everything is expected as before, and above it there was none.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from thermoctl.regulator.heater import evidence
from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.climb import KEEPS, STALLED_S
from thermoctl.regulator.heater.doubt import DOUBT_SDS, STANDS_K
from thermoctl.regulator.heater.response import Gain, Seen

FELL_K, FELL_SDS = 0.2, 8.0
"""A fall counts beyond both, in K and in standard deviations of a reading. A sensor that wanders in
another vessel does not fall so far and come back in step with the power."""
THERE_SDS = 2.0
"""Standard deviations of a reading within which it is back where it stood."""
ROWS_LEAST = 3
FOLLOWED_S = 1800.0
"""Time in s after the cut in which a reading must be back; later it has another reason."""
TEXT = "without power the reading fell, with it it came back to {:.1f} degC and no further"


class Ceiling:
    """Where a reading stood when it was asked, and whether it gets no higher.

    Attributes
    ----------
    level_c : float
        Where it stood; NaN where nothing is followed.
    known : bool
        Whether that is the ceiling.
    """

    def __init__(self) -> None:
        self._most = 0.0
        self.clear()

    def clear(self) -> None:
        """Forget it."""
        self.level_c, self.known = math.nan, False
        self._power, self._from_s, self._lowest_c = math.inf, math.inf, math.inf

    def follow(self, rows: Iterable[Seen], known: Gain, cut_s: float) -> None:
        """Follow a reading that stood under full power until that was cut at `cut_s`."""
        if self.known:
            return
        self.clear()
        stood = [row for row in rows if cut_s - STALLED_S <= row.t_s <= cut_s]
        if len(stood) < ROWS_LEAST:
            return
        first, last = stood[0], stood[-1]
        heat_s = last.heat_s[known.place] - first.heat_s[known.place]
        self._power, self._from_s = heat_s / (last.t_s - first.t_s), cut_s
        if self._power >= KEEPS * self._most:
            self.level_c = sum(row.reading_c for row in stood) / len(stood)

    def found(self, rows: Iterable[Seen], known: Gain, now: Seen, sd_k: float) -> bool:
        """Return whether a sound heater has just brought the reading back."""
        self._lowest_c = min(self._lowest_c, now.reading_c)
        there_c = self.level_c - THERE_SDS * sd_k
        if self.known or not now.reading_c >= there_c:
            return False
        fell_k = self.level_c - self._lowest_c
        if not fell_k > max(FELL_K, FELL_SDS * sd_k) or now.t_s - self._from_s > FOLLOWED_S:
            return False
        dip = _dip([row for row in rows if row.t_s >= self._from_s], there_c)
        self.known = evidence.odds(dip, -math.inf, known, sd_k) > 0.0
        self._lowest_c = now.reading_c
        return self.known

    def holds(self, block: Block) -> bool:
        """Return whether the plant is there, where power shows nothing."""
        self._most = max(self._most, block.power)
        if not self.known:
            return False
        near_k = max(STANDS_K, DOUBT_SDS * block.sd_k)
        above_k = block.reading_c - self.level_c
        if above_k > near_k:
            self.clear()
        return abs(above_k) <= near_k and block.power >= KEEPS * self._power


def _dip(rows: Sequence[Seen], there_c: float) -> Sequence[Seen]:
    """Return what was seen of the fall and the rise; what stood before it says nothing."""
    lowest = min(range(len(rows)), key=lambda place: rows[place].reading_c)
    begin = max(
        place for place in range(lowest + 1) if rows[place].reading_c >= there_c or not place
    )
    return rows[begin:]
