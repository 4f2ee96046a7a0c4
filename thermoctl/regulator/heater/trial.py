"""The heat that a heater nobody has seen to heat is given to show that it does.

It is asked when it had that and showed no rise. An answer that is still open may be that of a plant
so weak that its rise is lost in the noise, or that of a reading which has stopped while a vessel
gets hot. Only what is learnt can part the two: from more heat, or from listening for longer. More
heat is what does harm in the one, and a weak plant, which takes hours for a kelvin, loses nothing
by twenty minutes. So where the noise allows it, it is rather listened to.
"""

from __future__ import annotations

import math

from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.check import HeaterCheck
from thermoctl.regulator.heater.response import LAGS_S, Seen

RISE_K, RISE_SDS = 0.1, 6.0
"""A rise counts beyond both, in K and in standard deviations of a reading."""
LISTENS_S, LISTENS_LAGS = 1200.0, 3.0
"""Longest wait for an answer: in s where listening tells, otherwise in longest lags."""
TELLS = 0.4
"""Listening tells where the first heat of the weakest heater moves the reading by more than this
many standard deviations: 150 readings before and after it show a step to 0.2 of them."""
MORE, TWICE = 1.5, 2.0
"""Factor of the next heat, where listening tells and where it does not."""
IN_ALL = 15.0
"""Most heat in all, in first heats (15 minutes), unless it is likely to heat: a converter that
stands still, or noise, would hide the answer of any plant until the water boils."""


class Trial:
    """How much heat there may be without a rise, and how long to wait for an answer.

    Parameters
    ----------
    check : HeaterCheck
        What is admissible.

    Attributes
    ----------
    from_s : float
        When this trial began.
    since_s : float
        When the first one began that no rise has followed.
    """

    def __init__(self, check: HeaterCheck) -> None:
        self._first_s, self._weakest = check.first_heat_s, check.weakest_k_per_s
        self._heat_s = self._patience_s = self._first_s
        self.begin(0.0)

    def begin(self, t_s: float) -> None:
        """Begin anew: what was before says nothing of this heater."""
        self.since_s = t_s
        self.insist(t_s)

    def insist(self, t_s: float) -> None:
        """Begin with the first heat again, but go by all that was seen without a rise."""
        self._patience_s, self._total_s = self._first_s, 0.0
        self.resume(t_s)

    def resume(self, t_s: float) -> None:
        """Give the heat once more that there may be now."""
        self.from_s, self._heat_s, self._lowest_c = t_s, 0.0, math.inf

    def pause(self) -> None:
        """Go on later with the heat that is left, from another reading."""
        self._lowest_c = math.inf

    def fails(self, power: float, block: Block, now: Seen) -> str:
        """Take in a block that counts as `power`; return why to ask, or nothing."""
        self._lowest_c = min(self._lowest_c, now.reading_c)
        self._heat_s += power * block.span_s
        rise_k = now.reading_c - self._lowest_c
        if rise_k > max(RISE_K, RISE_SDS * block.sd_k):
            self.begin(now.t_s)
        elif self._heat_s >= self._patience_s:
            self._total_s += self._heat_s
            span_s = now.t_s - self.from_s
            return (
                f"expected a rise by {block.power:.0%} power in {span_s:.0f} s, got {rise_k:.2f} K"
            )
        return ""

    def listens_s(self, sd_k: float) -> float:
        """Return how long to wait for an answer."""
        return LISTENS_S if self._tells(sd_k) else LISTENS_LAGS * LAGS_S[-1]

    @property
    def exhausted(self) -> bool:
        """Whether there was all the heat that may be given."""
        return self._total_s >= IN_ALL * self._first_s

    def enlarge(self, sd_k: float) -> None:
        """Allow for more heat the next time."""
        self._patience_s *= MORE if self._tells(sd_k) else TWICE

    def _tells(self, sd_k: float) -> bool:
        """Return whether listening tells what the weakest heater does."""
        return self._weakest * self._first_s > TELLS * sd_k
