"""What a plant loses under a load, and whether its heater has made up for that.

A fan that is switched on looks at first as if the heater had failed. The controller gives more
power, and the reading comes back: that is an answer, though nobody has asked. How much the plant
loses now follows from what was given and what came of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from thermoctl.regulator.heater.question import slope
from thermoctl.regulator.heater.response import Gain, Heat, Seen

ROWS_LEAST = 4
BACK, BACK_K, BACK_SDS = 0.5, 0.1, 8.0
"""A reading was brought back when it has risen by this share of what it fell before, by so many K,
and by so many of its standard deviations. One in the air only falls, and flattens just when there
is more power."""


class Balance(NamedTuple):
    """What came and what was lost over some time.

    Parameters
    ----------
    rates : tuple of float
        Mean heat under every lag, as a fraction of full power.
    loss : float
        How fast the reading would have fallen without it, in K/s.
    level_c : float
        Mean reading.
    """

    rates: Heat
    loss: float
    level_c: float


def balance(rows: Iterable[Seen], from_s: float, known: Gain) -> Balance | None:
    """Return the balance of `rows` since `from_s`; None for too few of them.

    What the heat brought is taken from the readings. What is left falls by the loss alone, and all
    of the readings tell how fast.
    """
    meant = [row for row in rows if row.t_s >= from_s]
    if len(meant) < ROWS_LEAST:
        return None
    first, last = meant[0], meant[-1]
    span_s = last.t_s - first.t_s
    heats_s = zip(last.heat_s, first.heat_s, strict=True)
    rates = tuple([(after - before) / span_s for after, before in heats_s])
    alone = [
        row._replace(reading_c=row.reading_c - known.mean * row.heat_s[known.place])
        for row in meant
    ]
    level_c = sum(row.reading_c for row in meant) / len(meant)
    return Balance(rates, -slope(alone, -math.inf), level_c)


def brought_back(rows: Iterable[Seen], from_s: float, sd_k: float) -> bool:
    """Return whether the reading fell since `from_s`, and has come back since."""
    readings_c = [row.reading_c for row in rows if row.t_s >= from_s]
    if not readings_c:
        return False
    lowest_c = min(readings_c)
    fell_k = max(readings_c[: readings_c.index(lowest_c) + 1]) - lowest_c
    return readings_c[-1] - lowest_c > max(BACK * fell_k, BACK_K, BACK_SDS * sd_k)
