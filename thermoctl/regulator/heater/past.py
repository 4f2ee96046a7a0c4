"""What the first readings after a start say of what was before it.

Nobody knows what was applied before a start. From cold, heat takes a lag to arrive: the reading
bends upwards, little at first and more later. After a restart in the middle of a warm-up it rises
from the first second on, at the rate it keeps, with heat from before. Put down to the heater that
is switched on now, that heat has come without any lag, and once the power ends, what still arrives
of it comes without any power.

A heater that is quick looks like that from cold as well. So what the first readings teach is good
enough while the power stays, and is thrown away when it moves: that tells the lag of either.
"""

from __future__ import annotations

import math
from collections import deque
from enum import Enum

from thermoctl.regulator.heater.blocks import Block

LEAST = 5
"""Least number of blocks before anything is said."""
CLEAR_SDS = 10.0
"""Standard deviations of a reading beyond which a rise is clear."""
BENT = 0.7
"""From cold the first rise is below this share of the latest: 0.57 of it with a lag of a single
block, less with a longer one. Heat from before raises both ends alike."""
MOVES = 0.05
"""Largest change of power that counts as none, and teaches nothing."""
BEGINS = 15
"""Number of blocks that a rise may take to be clear, whatever the power does: a law that sees
earlier heat brakes at once."""
SOON_S = 6.0
"""Longest block in s of which that is true. A reading that has bent after five longer ones may have
done so because the power has moved, as it does in any warm-up of a small plant."""
LONGEST = 75
"""Number of blocks without a clear rise after which it makes no difference."""


class Past(Enum):
    """What was before a start."""

    OPEN = "open"
    NOTHING = "nothing"
    HEAT = "heat"


class FirstReadings:
    """Tells a start from cold from a restart that finds heat on its way.

    Attributes
    ----------
    power : float
        What was applied since a restart that found heat on its way; NaN at any other start.
    """

    def __init__(self, past: Past = Past.OPEN) -> None:
        self._past = past
        self._readings_c: deque[float] = deque(maxlen=LONGEST)
        self._power = self.power = math.nan

    @property
    def told(self) -> bool:
        """Whether what was before has been told."""
        return self._past is not Past.OPEN

    @property
    def rate(self) -> float:
        """How far the reading has risen in each of the last few blocks, in K."""
        return (self._readings_c[-1] - self._readings_c[-LEAST]) / (LEAST - 1)

    def observe(self, block: Block) -> None:
        """Take in one more block; a reading bends with a power that has moved."""
        span_s, power, reading_c, sd_k = block
        if self._past is Past.NOTHING or math.isnan(reading_c):
            return
        readings_c = self._readings_c
        readings_c.append(reading_c)
        n, k = len(readings_c), len(readings_c) // LEAST
        if n == 2:
            self._power = power  # the first block began before the first command
        soon = n <= BEGINS and span_s <= SOON_S
        if self._past is Past.OPEN and not soon and abs(power - self._power) > MOVES:
            self._past = Past.NOTHING
        if self._past is Past.HEAT or n < LEAST:
            return
        first_k, last_k = readings_c[k] - readings_c[0], reading_c - readings_c[-1 - k]
        if max(abs(first_k), abs(last_k)) > CLEAR_SDS * sd_k:
            went_on = first_k > 0.0 and first_k > BENT * last_k
            self._past = Past.HEAT if went_on else Past.NOTHING
        elif n == LONGEST:
            self._past = Past.NOTHING
        if self._past is Past.HEAT:
            self.power = self._power
