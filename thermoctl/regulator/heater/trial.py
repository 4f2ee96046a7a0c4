"""The heat that a heater nobody has seen to heat is given to show that it does.

It is asked when it had that and showed no rise. An answer that is still open may be that of a plant
so weak that its rise is lost in the noise, or that of a reading which has stopped while a vessel
gets hot. Only what is learnt can part the two: from more heat, or from listening for longer. More
heat is what does harm in the one, and a weak plant, which takes hours for a kelvin, loses nothing
by twenty minutes. So where the noise allows it, it is rather listened to.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from thermoctl.regulator.heater.account import Account
from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.check import HeaterCheck
from thermoctl.regulator.heater.cut import Cut
from thermoctl.regulator.heater.question import LIKELY
from thermoctl.regulator.heater.response import LAGS_S, RISE_K, Gain, Seen, clear_k

LISTENS_S, LISTENS_LAGS = 1200.0, 3.0
"""Longest wait for an answer: in s where listening tells, otherwise in longest lags."""
TELLS = 0.4
"""Listening tells where the first heat of the weakest heater moves the reading by more than this
many standard deviations: 150 readings before and after it show a step to 0.2 of them."""
MORE, TWICE = 1.5, 2.0
"""Factor of the next heat, where listening tells and where it does not."""
IN_ALL = 15.0
"""Most heat in all, in first heats (15 minutes), unless it is likely to heat, or the reading gets
hotter than it has ever been: a converter that stands still, noise, or the air around a sensor would
hide the answer of any plant until the water boils."""


class Trial:
    """How much heat there may be without a rise, and how long to wait for an answer.

    Parameters
    ----------
    check : HeaterCheck
        What is admissible.

    Attributes
    ----------
    weakest : float
        Least gain of a sound heater in K/s.
    account : Account
        All the heat since it began, and what it has moved.
    from_s : float
        When this trial began.
    since_s : float
        When the first one began that no rise has followed.
    refused_c : float
        Readings above it teach a gain.
    refused : bool
        Whether there was a bad answer, and no rise or good one since.
    """

    def __init__(self, check: HeaterCheck) -> None:
        self._first_s, self.weakest = check.first_heat_s, check.weakest_k_per_s
        self._heat_s = self._patience_s = self._first_s
        self.account = Account(self.weakest, check.power_max)
        self.begin(0.0)

    def begin(self, t_s: float) -> None:
        """Begin anew: what was before says nothing of this heater."""
        self._total_s, self._highest_c, self.refused_c = 0.0, math.nan, -math.inf
        self.account.clear()
        self.settle(t_s)

    def settle(self, t_s: float) -> None:
        """Begin with the first heat again; all the heat there was still counts."""
        self.since_s, self._patience_s = t_s, self._first_s
        self.refused = False
        self.resume(t_s)

    def refuse(self, t_s: float, rows: Iterable[Seen], from_s: float = -math.inf) -> None:
        """Begin with the first heat again, but go by all that was seen without a rise.

        Nothing is learnt of readings such as there were since `from_s`: one that falls bends like
        a lag.
        """
        self.refused_c = max(row.reading_c for row in rows if row.t_s >= from_s) + RISE_K
        self._patience_s, self.refused = self._first_s, True
        self.resume(t_s)

    def resume(self, t_s: float) -> None:
        """Give the heat once more that there may be now."""
        self._unasked_s = 0.0
        self._wait(t_s)

    def pause(self) -> None:
        """Go on later with the heat that is left, from another reading."""
        self._lowest_c = math.inf

    def question(self, power: float, block: Block, now: Seen) -> Cut | None:
        """Take in a block that counts as `power`; return what to ask, if anything.

        After a bad answer all the power there is counts: what explains it will not last.
        """
        least_k = clear_k(block.sd_k)
        power = block.power if self.refused else power
        self._count(power * block.span_s, now.reading_c, least_k)
        if self._unasked_s >= self._first_s and self._goes_nowhere(block.sd_k):
            return Cut(now.t_s, self.from_s, self.account.told())
        rise_k, span_s = now.reading_c - self._lowest_c, now.t_s - self.from_s
        if rise_k > least_k:
            self.since_s, self._patience_s = now.t_s, self._first_s
            self.refused = False
            self._wait(now.t_s)
        elif self._heat_s >= self._patience_s:
            rise = f"a rise by {block.power:.0%} power in {span_s:.0f} s, got {rise_k:.2f} K"
            return Cut(now.t_s, self.from_s, f"expected {rise}")
        return None

    def _count(self, heat_s: float, reading_c: float, least_k: float) -> None:
        """Count `heat_s` more; only one that gets hotter than ever has paid for all before."""
        self._lowest_c = min(self._lowest_c, reading_c)
        self._heat_s += heat_s
        self._unasked_s += heat_s
        self._total_s += heat_s
        if not reading_c - self._highest_c <= least_k:
            self._total_s, self._highest_c = 0.0, reading_c

    def again(self, now: Seen, rows: Iterable[Seen]) -> Cut:
        """Refuse what has seemed to heat; return the question to it."""
        cut = Cut(now.t_s, self.from_s, self.account.told())
        self.refuse(now.t_s, rows)
        return cut

    def listens_s(self, sd_k: float) -> float:
        """Return how long to wait for an answer."""
        return LISTENS_S if self._tells(sd_k) else LISTENS_LAGS * LAGS_S[-1]

    def over(self, shown: Gain, sd_k: float) -> bool:
        """Return whether nothing is left to be tried, as what was `shown` is no answer."""
        if self.account.denies_any(sd_k):
            return True
        return self._exhausted and not shown.mean > LIKELY * shown.sd

    @property
    def _exhausted(self) -> bool:
        """Whether there was all the heat that may be given."""
        return self._total_s >= IN_ALL * self._first_s

    def _goes_nowhere(self, sd_k: float) -> bool:
        """Return whether all rises so far were of the air, rather than of this heater."""
        return self.account.denies_any(sd_k) or (self._exhausted and self.account.open)

    def _wait(self, t_s: float) -> None:
        self.from_s, self._heat_s, self._lowest_c = t_s, 0.0, math.inf

    def enlarge(self, sd_k: float) -> None:
        """Allow for more heat the next time."""
        self._patience_s *= MORE if self._tells(sd_k) else TWICE

    def _tells(self, sd_k: float) -> bool:
        """Return whether listening tells what the weakest heater does."""
        return self.weakest * self._first_s > TELLS * sd_k
