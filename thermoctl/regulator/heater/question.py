r"""The question to a heater in doubt: what the reading does without power.

To cut the power is always safe, and it tells what watching cannot: whatever cools or warms the
reading besides goes on as before, and only the heater's part ends. The answer is the gain beta in

.. math:: y = a + b\,t + c\,t^2 + \beta H_j(t)

over some time with power and some without, for every lag j of `response`. The parabola takes
up a plant that cools towards its surroundings. What it cannot take up leaves remainders that
resemble their neighbours, and the error of beta is enlarged for that.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from thermoctl.quantities import Array
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen

ROWS_LEAST = 6
SURE = 4.0
"""Standard deviations from 0 beyond which a gain differs from nothing."""
ANSWERS, NOTHING = 0.35, 0.3
"""Shares of the known gain. A gain above ANSWERS is an answer, of whatever sign; one below NOTHING
is none."""
WANDERS = 0.5
"""Remainders that resemble their neighbours are worth few readings, and the error is known from
these alone. An unknown heater has to answer by up to this share more clearly for it. With four
deviations throughout, the air around a sensor beside its tank passed for an answer."""
RULED_OUT = 2.0
"""Standard deviations beyond which a gain is ruled out. It is tested a hundred times, and once is
enough: at 1.6 three of 20 heaters were condemned that were as weak as any may be."""
USELESS = 0.1
"""Least effect of a heater, as a share of the loss; one that makes up for less counts as none."""
WORTH_MOST = 0.95
CAUTION = 1.5
LATE = 0.5
"""Share of the squared remainders below which a longer lag explains the readings. A lag may grow
unnoticed, at rest; under the learnt one, heat that arrives after the cut is that of a heater that
cools."""
BEFORE_LAGS, BEFORE_S = 1.5, 16.0
"""Time before the cut that is looked at, in lags and in s, the longer of the two."""
CREPT_LAGS = 4.5
"""BEFORE_LAGS of a reading that has stood still: less would leave nothing to compare."""
LONGEST_S, LONGEST_LAGS, LONGEST_SDS = 240.0, 12.0, 20.0
"""Longest wait for the answer of a known heater: in s, in lags, and in standard deviations of a
reading over the gain, the longest of the three."""
SLOPE_BLOCKS = 3.0
"""A slope takes so many blocks at least, however long they are."""
ROUTINE_S = 1200.0
"""The same where nothing is in doubt: what is sound answers sooner."""
LIKELY = 1.0
"""Standard deviations after that wait above which a gain clears the heater: noise hides the answer,
and the likelier of the two is taken."""
_NOT_SEEN = Gain(math.nan, math.nan, 0)


class Answer(Enum):
    """What the reading said."""

    OPEN = "open"
    HEATS = "heats"
    NOTHING = "nothing"
    COOLS = "cools"
    HIDDEN = "hidden"
    LATE = "late"


class Contrast(NamedTuple):
    """Gain in K/s for each lag, its sd, what is left over, how alike neighbours are."""

    mean: Array
    sd: Array
    left: Array
    alike: Array

    def best(self, places: Iterable[int]) -> Gain:
        """Return the gain under that lag of `places` which leaves the least over."""
        place = min(places, key=lambda each: float(self.left[each]))
        return Gain(float(self.mean[place]), float(self.sd[place]), place)


def contrast(rows: Sequence[Seen], sd_k: float) -> Contrast | None:
    """Return the gain that `rows` show, by least squares; None for too few of them."""
    n = len(rows)
    if n < ROWS_LEAST:
        return None
    t = np.array([row.t_s for row in rows])
    t = t - t.mean()
    free = np.linalg.qr(np.column_stack((np.ones(n), t, t * t)))[0]
    y = np.array([row.reading_c for row in rows])
    heat = np.array([row.heat_s for row in rows])
    y, heat = y - free @ (free.T @ y), heat - free @ (free.T @ heat)
    heats = np.maximum((heat * heat).sum(axis=0), 1e-12)
    mean = y @ heat / heats
    rest = y[:, None] - heat * mean
    squares = np.maximum((rest * rest).sum(axis=0), 1e-30)
    alike = np.clip((rest[1:] * rest[:-1]).sum(axis=0) / squares, 0.0, WORTH_MOST)
    left = squares / max(n - 4, 1)
    variance = np.maximum(left * (1.0 + alike) / (1.0 - alike), sd_k * sd_k)
    return Contrast(mean, CAUTION * np.sqrt(variance / heats), left, alike)


def near(known: Gain) -> range:
    """Return the places of the lags that a heater which is `known` may have."""
    return range(max(known.place - 1, 0), min(known.place + 2, len(LAGS_S)))


def or_longer(known: Gain) -> range:
    """Return the places of the lags that it may have if answers have become late."""
    return range(near(known).start, len(LAGS_S))


def of_known(found: Contrast, known: Gain, sure: float = SURE) -> tuple[Answer, Gain]:
    """Return what `found` says of a known heater, and the gain it shows.

    An answer has to differ from nothing by `sure` standard deviations.
    """
    places = near(known)
    shown = found.best(places)
    if abs(shown.mean) > max(ANSWERS * known.mean, sure * shown.sd):
        if shown.mean > 0.0:
            return Answer.HEATS, shown
        answer = Answer.COOLS
    else:
        answer = Answer.NOTHING if is_nothing(found, known, places) else Answer.OPEN
    return (Answer.LATE if _is_late(found, known, shown) else answer), shown


def _is_late(found: Contrast, known: Gain, shown: Gain) -> bool:
    """Return whether a longer lag explains far better what is no answer under those `near`."""
    later = found.best(or_longer(known))
    explains = found.left[later.place] < LATE * found.left[shown.place]
    return explains and later.mean > max(ANSWERS * known.mean, SURE * later.sd)


def is_nothing(found: Contrast, known: Gain, places: Iterable[int]) -> bool:
    """Return whether all that `found` shows under these lags is surely little."""
    small = [abs(found.mean[place]) < NOTHING * known.mean for place in places]
    seen = [SURE * found.sd[place] < known.mean for place in places]
    return all(small) and all(seen)


def of_unknown(found: Contrast, weakest: float, slope: float) -> tuple[Answer, Gain]:
    """Return what `found` says of an unknown heater, and the gain it shows.

    Parameters
    ----------
    found : Contrast
        What was seen.
    weakest : float
        Least gain a healthy plant can have, in K/s.
    slope : float
        How fast the reading drifts by itself, in K/s.
    """
    shown = found.best(range(len(LAGS_S)))
    useless = USELESS * abs(slope)
    sure = SURE * (1.0 + WANDERS * float(found.alike[shown.place]))
    too_weak = shown.mean + RULED_OUT * shown.sd < weakest
    if shown.mean > sure * shown.sd and not too_weak:
        return Answer.HEATS, shown
    if shown.mean < -max(SURE * shown.sd, useless):
        return Answer.COOLS, shown
    most = float((np.abs(found.mean) + RULED_OUT * found.sd).max())
    return (Answer.NOTHING if most < max(weakest, useless) else Answer.OPEN), shown


def of_known_rows(
    rows: Iterable[Seen], from_s: float, cut_s: float, known: Gain, sd_k: float, sure: float
) -> tuple[Answer, Gain]:
    """Return what `rows` since `from_s` say of a known heater.

    Too few of them say nothing yet. An answer counts only if the reading turned the same way when
    the power was cut, at `cut_s`.
    """
    meant = [row for row in rows if row.t_s >= from_s]
    found = contrast(meant, sd_k)
    if found is None:
        return Answer.OPEN, _NOT_SEEN
    answer, shown = of_known(found, known, sure)
    less_sd_k = sd_k if sure < SURE else 0.0
    recent_s = max(known.lag_s, BEFORE_S)
    turns = turned(answer, meant, cut_s, recent_s, less_sd_k=less_sd_k)
    return (answer if turns else Answer.OPEN), shown


def of_unknown_rows(
    rows: Iterable[Seen], froms_s: Iterable[float], cut_s: float, weakest: float, sd_k: float
) -> tuple[Answer, Gain]:
    """Return what `rows` say of an unknown heater, from the first time that tells.

    The times `froms_s` are tried in turn.

    An answer counts only if the reading turned the same way when the power was cut, at `cut_s`.
    """
    seen = list(rows)
    recent, *_ = parts = [[row for row in seen if row.t_s >= from_s] for from_s in froms_s]
    drift, shown = slope(recent, -math.inf), _NOT_SEEN
    for part in parts:
        found = contrast(part, sd_k)
        if found is None:
            break
        answer, shown = of_unknown(found, weakest, drift)
        if answer is not Answer.OPEN:
            recent_s = max(2.0 * BEFORE_S, SLOPE_BLOCKS * (seen[-1].t_s - seen[-2].t_s))
            turns = turned(answer, recent, cut_s, recent_s)
            return (answer if turns else Answer.OPEN), shown
    return Answer.OPEN, shown


def turned(
    answer: Answer, rows: Iterable[Seen], cut_s: float, recent_s: float, *, less_sd_k: float = 0.0
) -> bool:
    """Return whether the reading turned the way of `answer` when the power was cut.

    Parameters
    ----------
    answer : Answer
        What is to be confirmed; what says nothing of a heater needs no turn.
    rows : iterable of Seen
        What was seen around the cut.
    cut_s, recent_s : float
        When it was, and how long before it, and before the end, is looked at, in s.
    less_sd_k : float
        Standard deviation of a reading: with it, the reading after the cut is judged by the least
        slope that is still sure.
    """
    if answer not in (Answer.HEATS, Answer.COOLS):
        return True
    seen = list(rows)
    before = slope(seen, cut_s - recent_s, cut_s)
    after = slope(seen, max(seen[-1].t_s - recent_s, cut_s), less_sd_k=less_sd_k)
    return after < before if answer is Answer.HEATS else after > before


def slope(
    rows: Iterable[Seen], from_s: float, to_s: float = math.inf, *, less_sd_k: float = 0.0
) -> float:
    """Return how fast the reading moved, in K/s; NaN for less than 3 rows.

    Parameters
    ----------
    rows : iterable of Seen
        Readings; those between `from_s` and `to_s` are meant.
    from_s, to_s : float
        Times in s.
    less_sd_k : float
        Standard deviation of a reading: with it, the least slope that is still sure.
    """
    meant = [row for row in rows if from_s <= row.t_s <= to_s]
    if len(meant) < 3:
        return math.nan
    t = np.array([row.t_s for row in meant])
    t = t - t.mean()
    y = np.array([row.reading_c for row in meant])
    squares = float(t @ t)
    return float(t @ y) / squares - SURE * less_sd_k / math.sqrt(squares)


def told_of(rate: float) -> str:
    """Return what is to be said of a reading that rises by `rate` in K/s."""
    return f"expected no rise without power, got {60.0 * rate:+.2f} K a minute"


def longest_s(known: Gain, sd_k: float) -> float:
    """Return how long the answer of a known heater is waited for."""
    return max(LONGEST_S, LONGEST_LAGS * known.lag_s, LONGEST_SDS * sd_k / known.mean)
