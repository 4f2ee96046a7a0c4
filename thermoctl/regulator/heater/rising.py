"""Which rises of a reading without power prove that a heater is stuck on.

None does that a load explains. A door lets the air of an oven out in seconds. Once it is shut,
walls and racks warm what came in, with or without power: as long as the reading is below where it
fell from, such a rise says nothing of the heater. Beyond that, or minutes later, it does. One that
is stuck on meanwhile makes nothing hotter than it was a few minutes ago.

Nor does a rise that heat under way explains. The lag of a plant with walls becomes shorter while it
is held, but not the time its element takes to give its heat away. So until the lag is over that was
told most surely nothing is proven, and for as long again only by a rise that does not slow down.
"""

from __future__ import annotations

import math
from collections.abc import Collection

from thermoctl.regulator.heater.known import OFF_LAGS, KnownHeater
from thermoctl.regulator.heater.question import BEFORE_S, slope
from thermoctl.regulator.heater.response import Seen

RISES = 0.3
"""If, at power 0, the reading rises at more than this share of the full-power rate, the heater is
stuck on."""
FADES = 0.85
"""A rise slows down when its later half is less steep than the earlier one, by this factor. That of
a heater stuck on goes on as it was."""
LATELY_S = 300.0
"""Time in s for which a fall is remembered."""
FELL_K, FELL_SDS = 0.3, 8.0
"""A fall that is meant, in K and in standard deviations of a reading, the larger of the two."""


def rising(
    rows: Collection[Seen], heater: KnownHeater, now: Seen, off_s: float, sd_k: float, loss: float
) -> float:
    """Return how fast the reading has surely risen without power or cause, in K/s.

    NaN where too few readings show a slope, 0 where something else explains it.

    Parameters
    ----------
    rows : collection of Seen
        Readings so far.
    heater : KnownHeater
        What it did when it was sound.
    now : Seen
        The last reading.
    off_s : float
        For how long there has been no power, in s.
    sd_k : float
        Standard deviation of a reading, in K.
    loss : float
        How fast the reading falls without power or load, in K/s.
    """
    known = heater.gain
    if known is None:
        return math.nan
    span_s = min(max(OFF_LAGS * known.lag_s, BEFORE_S), off_s)
    rate = slope(rows, now.t_s - span_s, less_sd_k=sd_k)
    if not rate > 0.0:
        return rate
    surest_s = heater.surest_lag_s
    under_way = known.lag_s < surest_s and (
        off_s < surest_s or (off_s < (1.0 + OFF_LAGS) * surest_s and _fades(rows, now.t_s, span_s))
    )
    return 0.0 if under_way or _comes_back(rows, now, sd_k, max(loss, 0.0)) else rate


def _fades(rows: Collection[Seen], now_s: float, span_s: float) -> bool:
    """Return whether the rise of the last `span_s` slows down, as that by heat under way does."""
    halfway_s = now_s - 0.5 * span_s
    early = slope(rows, now_s - span_s, halfway_s)
    return not slope(rows, halfway_s) > FADES * early


def _comes_back(rows: Collection[Seen], now: Seen, sd_k: float, loss: float) -> bool:
    """Return whether the reading is still below where a load took it from."""
    least_k, from_c = max(FELL_K, FELL_SDS * sd_k), -math.inf
    highest_k, high_c = -math.inf, math.nan
    for row in rows:
        if row.t_s < now.t_s - LATELY_S:
            continue
        held_k = row.reading_c + loss * row.t_s  # without a load it never falls
        if held_k > highest_k:
            highest_k, high_c = held_k, row.reading_c
        elif highest_k - held_k > least_k:
            from_c = max(from_c, high_c)
    return now.reading_c < from_c
