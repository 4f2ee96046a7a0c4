"""All the heat of a heater nobody knows, against how far the reading has moved.

The air around a sensor wanders. Now and then it rises while there is power, or turns just when the
power is cut, and either passes for a heater that heats. But it goes to and fro, and in an hour no
farther than in some minutes, while heat adds up. Somewhere a heater must have moved the reading by
a share of all its heat, upwards while it came or downwards once it was missed. So a gain that would
have moved it farther is not believed, nor kept; and where even the weakest one would have, none is
left that is sound.

Only nearly full power counts, for a plant that is held by less shows no rise. What has moved as no
air does needs no account, nor what answers so well that no walk of the air explains it, such as a
plant that gets hardly warmer than it was.
"""

from __future__ import annotations

import math
from collections.abc import Collection

from thermoctl.regulator.heater import evidence
from thermoctl.regulator.heater.blocks import NEARLY_FULL
from thermoctl.regulator.heater.known import arrived
from thermoctl.regulator.heater.question import Answer
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen, clear_k

SHOWN, WEAKEST = 0.2, 0.5
"""Least shares of its heat by which a heater moves the reading: of a gain that was shown, which may
be five times the true one in noise, and of the weakest one there may be, which a loss may halve."""
LASTS_LAGS = 2.0
"""How long after full power heat still counts, in lags."""
FAR_K = 5.0
"""Range in K that no air around a sensor has."""


class Account:
    """Adds up heat under every lag, and takes the range of the readings.

    Parameters
    ----------
    weakest : float
        Least gain of a sound heater in K/s.
    power_max : float
        Most power the loop gives: what counts as full.

    Attributes
    ----------
    open : bool
        Whether the reading has moved no farther than air does.
    """

    def __init__(self, weakest: float, power_max: float = 1.0) -> None:
        self._weakest, self._full = weakest, NEARLY_FULL * power_max
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self.open = True
        self._heats_s = [0.0] * len(LAGS_S)
        self._lowest_c, self._highest_c = math.inf, -math.inf
        self._full_s = -math.inf

    def add(self, power: float, before: Seen | None, now: Seen, *, there: bool = False) -> None:
        """Take in a block of `power`, from `before` to `now`; not `there`, at a ceiling."""
        if there or not self.open:
            return
        self._lowest_c = min(self._lowest_c, now.reading_c)
        self._highest_c = max(self._highest_c, now.reading_c)
        self.open = self._range_k < FAR_K
        if power > self._full:
            self._full_s = now.t_s
        if before is None:
            return
        for place, lag_s in enumerate(LAGS_S):
            if now.t_s - self._full_s <= LASTS_LAGS * lag_s:
                self._heats_s[place] += now.heat_s[place] - before.heat_s[place]

    def denies(self, shown: Gain, rows: Collection[Seen], sd_k: float) -> bool:
        """Return whether that gain would have moved the reading farther.

        Parameters
        ----------
        shown : Gain
            What a heater that nobody knew has shown.
        rows : collection of Seen
            All that was seen; where it answers well enough, nothing is denied any more.
        sd_k : float
            Standard deviation of a reading, in K.
        """
        too_far = self._misses(SHOWN * shown.mean * self._heats_s[shown.place], sd_k)
        if too_far or self.denies_any(sd_k):
            self.open = not _answers(shown, rows, sd_k)
            return self.open
        return False

    def revised(self, known: Gain, rows: Collection[Seen], sd_k: float) -> Gain | None:
        """Return `known`; where it is denied what came of the heat, or None for air."""
        if not self.denies(known, rows, sd_k):
            return known
        came = known._replace(mean=self._range_k / self._heats_s[known.place])
        sound = SHOWN * came.mean > self._weakest or _answers(came, rows, sd_k)
        return came if sound else None

    def denies_any(self, sd_k: float) -> bool:
        """Return whether the weakest one, behind the longest lag, would have."""
        return self._misses(WEAKEST * self._weakest * self._heats_s[-1], sd_k)

    def audited(self, answer: Answer, shown: Gain, rows: Collection[Seen], sd_k: float) -> Answer:
        """Return what is left of an `answer` of a heater nobody knows, told by `rows`."""
        if answer is not Answer.HEATS:
            return answer
        *_, now = rows
        if not arrived(shown, now):
            return Answer.OPEN  # what wanders in the air is as long as the longest lags
        return Answer.OPEN if self.denies(shown, rows, sd_k) else answer

    def told(self) -> str:
        """Return what was expected, and what came."""
        return f"expected a rise that goes on, got readings within {self._range_k:.2f} K"

    def _misses(self, moves_k: float, sd_k: float) -> bool:
        return self.open and moves_k - self._range_k > clear_k(sd_k)

    @property
    def _range_k(self) -> float:
        return self._highest_c - self._lowest_c


def _answers(gain: Gain, rows: Collection[Seen], sd_k: float) -> bool:
    """Return whether readings are those of about such a heater rather than of a dead one."""
    return evidence.odds(rows, -math.inf, gain, sd_k) > evidence.SOUND
