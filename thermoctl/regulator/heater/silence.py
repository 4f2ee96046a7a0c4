r"""Heat of a strong heater that the reading does not show at all.

What `doubt` expects may be wrong by half, and by heat of a lag that is still under way. In a vessel
that full power warms by half a kelvin a second that is a minute, and 40 K. Two things can be known
sooner there.

A reading that stands as still under nearly full power as before is no weak heater, no loss that
has grown, and no lag of twice the length: any of them would show a part of what is expected. So it
is a doubt as soon as some kelvin should have come. A plant that rose and then stands has found its
limit, as a kettle that boils; so the reading must have been at rest before the power came, or have
fallen since.

After a bad answer no more is needed than heat that can be seen. The power is cut for the second
question once that has been given, for what arrives of it shows after the cut as well as before.
"""

from __future__ import annotations

import math

from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.cut import Cut
from thermoctl.regulator.heater.question import BEFORE_LAGS, BEFORE_S
from thermoctl.regulator.heater.response import Gain, Seen
from thermoctl.regulator.heater.standing import Standing
from thermoctl.regulator.heater.unbroken import Unbroken

STRONG_K_PER_S = 0.1
"""Least gain in K/s of a heater that is meant: weaker ones are asked in time by `doubt`."""
SILENT_K, SILENT_SDS, SILENT_LAGS = 3.0, 20.0, 0.35
"""What has to be expected without any rise: in K, in standard deviations of a reading, and in rises
of one lag at full power; all three must be exceeded. Heat of a pipe without any other lag, as long
as the lag that was learnt, comes sooner than the last."""
FLAT = 0.15
"""Largest rise or fall of a reading that stands still, as a share of the heat."""
FALLS = 0.3
"""The same, besides, of a fall that is coming to rest."""
NOISE_SDS = 4.0
"""The same in standard deviations of a reading: of a difference of two at three of its own."""
HIGH = 0.6
"""Least share of full power under which a reading is expected to rise. What makes up for a load of
which a plant stands still is less, or it dips first."""
RESTED = 0.3
"""Most heat that arrives, as a share of full power, in a reading that stood before the power."""
LOSSES, LEFT_SHARE = 2.0, 0.15
"""What is left of the heat by twice the loss, and by this share of full power, is expected."""
STEEP, FELL_S = 1.3, 100.0
"""A fall in a block by more than STEEP times the gain and its loss is none that any heater makes,
nor a load that full power could hold. It is forgotten with a time constant of FELL_S seconds."""
MUCH_K = 6.0
"""Heat in K that may be given while the reading goes on falling faster than any heater makes it."""
TELLS_K, TELLS_SDS = 3.0, 30.0
"""Heat that is given after a bad answer, in K and in standard deviations of a reading, the larger
of the two."""
RESTED_LAGS = 0.5
"""How long before that heat the reading counts as having stood still too, in lags."""
ANSWERS = 0.35
"""Least share of the heat that pays for it."""


class Silence:
    """Adds up heat that nothing follows.

    Parameters
    ----------
    power_max : float
        Most power the loop gives: what counts as full.

    Attributes
    ----------
    since : Seen or None
        Since when the reading has stood still.
    """

    def __init__(self, power_max: float = 1.0) -> None:
        self._fell_k, self._high = 0.0, HIGH * power_max
        self._standing, self._unbroken = Standing(power_max), Unbroken(power_max)
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self.since: Seen | None = None
        self._base_c = math.nan
        self._rested = False
        self._expected_k = self._unpaid_k = 0.0
        self._paid_s = -math.inf
        self._falls: Seen | None = None
        self._given_k = 0.0
        self._standing.clear()
        self._unbroken.clear()

    def add(
        self,
        gain: Gain,
        block: Block,
        before: Seen,
        now: Seen,
        loss_k: float,
        *,
        proven: bool = True,
    ) -> None:
        """Take in a block, from `before` to `now`, in which the plant loses `loss_k`.

        A heater that is `proven` was seen to obey less power.
        """
        span_s, rise_k = now.t_s - before.t_s, now.reading_c - before.reading_c
        heat_k = gain.mean * (now.heat_s[gain.place] - before.heat_s[gain.place])
        full_k = gain.mean * span_s
        self._standing.add(block, before)
        self._unbroken.add(block, before, proven=proven)
        self._unpaid_k += full_k * block.power - max(rise_k, 0.0) / ANSWERS
        if self._unpaid_k <= 0.0:
            self._unpaid_k, self._paid_s = 0.0, now.t_s
        elif self._paid_s < 0.0:
            self._paid_s = before.t_s
        most_k, loss_k = FLAT * heat_k + NOISE_SDS * block.sd_k, max(loss_k, 0.0)
        self._fell_k = max(self._fell_k * math.exp(-span_s / FELL_S) - max(rise_k, 0.0), 0.0)
        if -rise_k > STEEP * full_k + loss_k:
            self._fell_k -= rise_k
        if -rise_k > full_k + loss_k:
            self._falls = self._falls or before
            self._given_k += full_k * block.power
        else:
            self._falls, self._given_k = None, 0.0
        if not -FALLS * heat_k - most_k <= rise_k <= most_k:
            self.since, self._rested = now, False
            self._base_c, self._expected_k = now.reading_c, 0.0
            return
        if self.since is None or block.power < self._high:
            self.since = self.since or before
            self._rested = heat_k < RESTED * full_k
            self._base_c, self._expected_k = now.reading_c, 0.0
            return
        self._expected_k += max(heat_k - LOSSES * loss_k - LEFT_SHARE * full_k, 0.0)

    def question(
        self, gain: Gain, weakest: float, now: Seen, sd_k: float, *, again: bool, answered: bool
    ) -> Cut | None:
        """Return why to cut the power now, if there is a reason.

        Sooner `again`, after a bad answer. What has `answered` well may stand under full power for
        the reason it was asked for, unless it has fallen since.
        """
        stands = None
        if not again:
            stands = self._standing.question(gain, weakest, now, sd_k, answered=answered)
        stands = stands or self._unbroken.question(gain, now, sd_k)
        if stands is not None:
            return stands
        if gain.mean < STRONG_K_PER_S:
            return None
        since, falls, moved = self.since, self._falls, not self._rested
        if since is None:
            return None
        from_s = now.t_s - max(BEFORE_LAGS * gain.lag_s, BEFORE_S)
        tells = self._unpaid_k > max(TELLS_K, TELLS_SDS * sd_k)
        if again and tells and since.t_s <= self._paid_s:
            why = f"expected a rise by {self._unpaid_k:.1f} K of heat"
            from_s = max(from_s, since.t_s - RESTED_LAGS * gain.lag_s)
            return Cut(now.t_s, from_s, why, portion=True, quiet=True)
        if not again and falls is not None and falls.t_s <= from_s and self._given_k > MUCH_K:
            why = f"expected {self._given_k:+.1f} K, got {now.reading_c - falls.reading_c:+.1f} K"
            return Cut(now.t_s, from_s, why, wild=True)
        if (answered and not moved) or not self._lasts(gain, now, sd_k):
            return None
        why = f"expected {self._expected_k:+.2f} K, got {now.reading_c - self._base_c:+.2f} K"
        began_s = None if moved else since.t_s
        return Cut(now.t_s, max(from_s, since.t_s), why, moved and not again, began_s)

    def distrust(self) -> None:
        """Go on after a bad answer."""
        self._unbroken.distrust()

    def fell(self, gain: Gain, sd_k: float) -> bool:
        """Return whether the reading fell as no heater makes it, and has not come back."""
        return gain.mean >= STRONG_K_PER_S and self._fell_k > _least_k(gain, sd_k)

    def _lasts(self, gain: Gain, now: Seen, sd_k: float) -> bool:
        """Return whether nothing came of more heat than can be under way."""
        if self._expected_k <= _least_k(gain, sd_k):  # nearly always
            return False
        rise_k, moved = now.reading_c - self._base_c, not self._rested
        if not -(FLAT + FALLS * moved) * self._expected_k <= rise_k <= FLAT * self._expected_k:
            return False
        return self._rested or self.fell(gain, sd_k)


def _least_k(gain: Gain, sd_k: float) -> float:
    """Return how many K are more than a doubt of lag, gain or noise."""
    return max(SILENT_K, SILENT_SDS * sd_k, SILENT_LAGS * gain.stored_k)
