r"""How far the reading is from what the power should have done to it.

The model is what was known some minutes ago: it must not follow a fault at once, or it would
explain everything away. With the mean rate of heat and reading in quiet times the loss is

.. math:: d = \beta \bar q - \bar{\dot y}

whatever the gain is believed to be. In each block the rise that is missing is what the heat brought
less what the reading rose, less the loss. Two sums are kept as in a CUSUM test, one of what is
missing beyond half of the heat, one of what came beyond two and a half times the heat. Both count
no more in a block than a heater could do, so that a litre of cold water is soon paid back.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

from thermoctl.quantities import clamp
from thermoctl.regulator.heater import fall
from thermoctl.regulator.heater.balance import balance
from thermoctl.regulator.heater.blocks import Block
from thermoctl.regulator.heater.cut import Cut
from thermoctl.regulator.heater.question import BEFORE_LAGS, BEFORE_S, CREPT_LAGS
from thermoctl.regulator.heater.response import LAGS_S, Gain, Heat, Seen
from thermoctl.regulator.heater.silence import Silence

DOUBT_K, DOUBT_SDS, DOUBT_LAGS = 0.3, 5.0, 1.0
"""A sum is a doubt when it exceeds all three: DOUBT_K in K, DOUBT_SDS standard deviations of a
reading, and DOUBT_LAGS times the rise of one lag at full power."""
DOUBT_LAGS_AGAIN = 0.4
"""DOUBT_LAGS after a bad answer. The second question comes sooner: it does no harm to a mended
heater, and another one goes on heating unseen."""
EXTRA_LAGS = 0.6
CALM, CALM_SDS = 0.1, 2.0
"""A sum counts as nothing below CALM of its limit or CALM_SDS standard deviations of a reading, and
the model may follow. With less it would follow the quiet half of the noise only, and drift."""
HALF = 0.5
"""Share of the heat that may be missing: the gain of a tank whose water was doubled."""
MUCH_SHARE, GROWS_SHARE = 0.4, 0.15
"""Where the loss exceeds MUCH_SHARE of full power, HALF of the heat would leave too little to be
missed. There half of what the loss leaves may be missing, and GROWS_SHARE of full power at least,
for a loss that grows at once is no fault. A fall of the reading does not count: ice in the water
says nothing of the heater."""
ANSWERED_S = 1800.0
"""Time in s after a good answer in which HALF holds whatever the loss. Otherwise an element of
which half has burnt out would be questioned again and again."""
FULL_SHARE = 0.02
"""Share of full power that may be missing besides, since the loss wanders."""
EXTRA_GAINS, EXTRA_SHARE = 2.5, 0.3
"""A rise of up to EXTRA_GAINS times the known gain and EXTRA_SHARE of full power besides is no
stuck output; only what exceeds their sum is added up."""
SURE_SHARE = 0.7
"""Least cooling of a plant, as a share of the estimated one."""
COOLED_S = 100.0
"""Time in s for which the cooling is remembered. A stuck output teaches a gain without cooling, by
which its rise would look normal."""
MEMORY_S, MEMORY_LAGS = 300.0, 10.0
"""Time constant of the quiet rates: in s and in lags, the longer of the two."""
SHOWS_SDS = 6.0
"""Blocks are taken together until full power would move the reading by this many standard
deviations. What a block may count is bounded by its heat; where a weak cooler moves the reading by
less than the noise, cutting off the noise on that side alone would hide for ever that a reading has
stopped."""
FOLLOWS_SDS = 4.0
"""Standard deviations of a reading by which a rise may exceed that at full power for the quiet
rates to follow all of it. Cut off sooner, the noise would not average out."""
CREPT, CREPT_LEAST, CREPT_S = 0.12, 0.04, 100.0
"""A reading that stands still is a doubt when the power it needs has grown for CREPT_S seconds by
more than it was before; by CREPT_LEAST of full power at least, and CREPT is always enough. Under a
sensor that shows the same for ever a controller adds power little by little."""
NEEDED_S = 150.0
"""Time constant in s of the power that the reading needs."""
CREPT_K = 0.3
"""Least rise in K that the added power must stand for; less could not be seen."""
STANDS_K = 0.3
"""Distance in K from where it was within which a reading has stood still."""
COMPARED_FROM_S, COMPARED_S = 600.0, 21600.0
"""The power that a standing reading needs is learnt for COMPARED_FROM_S seconds; from then on it
follows a larger one with a time constant of COMPARED_S seconds."""
KEPT_K, KEPT_FROM_S = 1.5, 300.0
"""After a move of less than KEPT_K kelvin that power is kept, and compared again after KEPT_FROM_S
seconds: the loss depends on the temperature."""
SETTLE_S = 300.0
"""Time in s after a jump in which no rise counts as extra."""
COOLS_WITHIN_S = 1000.0
"""For every kelvin above where the loss was learnt it may have grown by 1 K in this time in s, as
that of half a litre in a draught; by more on a plant that was seen to cool faster. That much more
power is no doubt."""


class HeatDoubt:
    """Compares readings with what they should be.

    Attributes
    ----------
    since : Seen or None
        Where what is missing began to add up.
    """

    def __init__(self, power_max: float = 1.0) -> None:
        self._rates: Heat = (0.0,) * len(LAGS_S)
        self._rise_rate = 0.0
        self._known_s = 0.0
        self._level_c, self._coldest_c = math.nan, math.inf
        self._stood_c = self._proven_c = math.nan
        self._stood_s = self._stood_power = self._proven_power = 0.0
        self._settle_s = self._needed = self._needed_s = 0.0
        self._answered_s = 0.0
        self._cools_per_s = self._cools_loss = self._cools_s = 0.0
        self.since: Seen | None = None
        self._begun: tuple[Seen, Block, bool] | None = None  # of what is taken together
        self._silence = Silence(power_max)
        self.clear()

    def clear(self) -> None:
        """Begin the sums anew; what is known of the quiet plant stays."""
        self._missing_k = self._extra_k = self._crept_s = 0.0
        self.since = self._begun = None
        self._silence.clear()

    def trust(self) -> None:
        """Take the power for what holds the plant: the heater was asked, and answers.

        The loss is left as it is. Answers of a sensor in the air may look like good ones, and under
        a loss that explains all of its heat nothing would ever be asked again.
        """
        self.stand_by()
        self._answered_s = ANSWERED_S

    def acquit(self, gain: Gain, rows: Iterable[Seen], since_s: float) -> None:
        """Take the loss for what it was since `since_s`, if it has grown."""
        seen = balance(rows, since_s, gain)
        if seen is not None and seen.loss > self.loss(gain):
            self._rates, self._level_c = seen.rates, seen.level_c
            self._rise_rate = gain.mean * seen.rates[gain.place] - seen.loss
        self.stand_by()
        self.clear()

    def stand_by(self) -> None:
        """Take the power that is needed now for what holds the reading."""
        self._stood_power = self._proven_power = self._needed
        self._crept_s = 0.0

    def distrust(self, gain: Gain, fell: float) -> None:
        """Take for the loss no more than the reading `fell` without power, in K/s.

        Of too few readings that is NaN, and says nothing.
        """
        self._silence.distrust()
        if not math.isnan(fell):
            self._rise_rate += max(self.loss(gain) - max(fell, 0.0), 0.0)

    def begin(self, before: Seen, now: Seen) -> None:
        """Learn the rates of a plant whose gain is not known yet.

        Were the first that are taken those of the minute in which it became known, a heater that
        had died by then would be one whose gain is all lost.
        """
        self._follow(before, now, now.reading_c - before.reading_c, 0.0)

    def loss(self, gain: Gain) -> float:
        """Return how fast the reading should fall without power, in K/s."""
        return gain.mean * self._rates[gain.place] - self._rise_rate

    def calm(self, gain: Gain, sd_k: float) -> bool:
        """Return whether nothing is in doubt, so that gain and loss may be learnt."""
        worst_k = max(self._missing_k, self._extra_k)
        if worst_k < CALM * DOUBT_K:  # nearly always
            return True
        return worst_k < max(CALM * _limit_k(gain, sd_k, DOUBT_LAGS), CALM_SDS * sd_k)

    def cold(self, gain: Gain, sd_k: float, *, again: bool = False) -> bool:
        """Return whether the reading fails to answer; sooner `again`, after a bad answer."""
        return self.crept or self.short(gain, sd_k, again=again)

    def creeps(self, gain: Gain, sd_k: float, *, again: bool) -> bool:
        """Return whether nothing is in doubt but why the power has grown."""
        return self.crept and not self.short(gain, sd_k, again=again)

    def short(self, gain: Gain, sd_k: float, *, again: bool) -> bool:
        """Return whether the reading has not risen as the heat should have made it."""
        if self._missing_k <= DOUBT_K:  # nearly always
            return False
        return self._missing_k > _limit_k(gain, sd_k, DOUBT_LAGS_AGAIN if again else DOUBT_LAGS)

    def silent(
        self, gain: Gain, weakest: float, now: Seen, sd_k: float, *, again: bool
    ) -> Cut | None:
        """Return why to ask a heater of which the reading shows nothing."""
        if again and self.short(gain, sd_k, again=True):
            return None  # what is missing is reason enough, and says more
        answered = self._answered_s > 0.0
        return self._silence.question(gain, weakest, now, sd_k, again=again, answered=answered)

    def question(
        self, rows: Collection[Seen], gain: Gain, now: Seen, sd_k: float, *, hot: bool, again: bool
    ) -> Cut | None:
        """Return why to cut the power now: for what is missing, or for being `hot`."""
        lags = CREPT_LAGS if self.crept else BEFORE_LAGS
        from_s = now.t_s - max(lags * gain.lag_s, BEFORE_S)
        since_s = from_s if self.since is None else min(self.since.t_s, from_s)
        wild = not again and fall.wild(rows, (since_s, from_s), gain, self.loss(gain))
        lasts = wild and now.t_s - since_s >= max(BEFORE_LAGS * gain.lag_s, fall.WILD_S)
        if not (hot or lasts or self.cold(gain, sd_k, again=again)):
            return None
        wild = wild or (not again and self._silence.fell(gain, sd_k))
        began_s = None if hot or wild else since_s
        return Cut(now.t_s, from_s, self.told(gain, now), wild, began_s)

    @property
    def crept_s(self) -> float:
        """How long the loss has been larger while the reading stood still, in s."""
        return self._crept_s

    @property
    def crept(self) -> bool:
        """Whether the loss has grown for long while the reading stood still."""
        return self._crept_s > CREPT_S

    def hot(self, gain: Gain, sd_k: float) -> bool:
        """Return whether the reading rises beyond what any power explains."""
        return self._extra_k > DOUBT_K and self._extra_k > _limit_k(gain, sd_k, EXTRA_LAGS)

    def compare(
        self,
        gain: Gain,
        block: Block,
        before: Seen,
        now: Seen,
        *,
        jumped: bool,
        follow: bool,
        again: bool = False,
        proven: bool = True,
    ) -> None:
        """Add what happened from `before` to `now`; quiet rates `follow` if they may.

        After a bad answer, `again`, no loss has to be forgiven that has not been seen yet: of the
        rise that is left by the loss, not of the heat, half may be missing. So it is where the loss
        is large, of a heater that is `proven` to obey less power.
        """
        before, block, jumped = self._together(before, block, jumped=jumped)
        if gain.mean * (now.t_s - before.t_s) < SHOWS_SDS * block.sd_k:
            self._begun = before, block, jumped
            return
        span_s, rise_k = now.t_s - before.t_s, now.reading_c - before.reading_c
        heat_k = gain.mean * (now.heat_s[gain.place] - before.heat_s[gain.place])
        full_k = gain.mean * span_s
        self._cool(gain, span_s, now.reading_c)
        loss_k = (self.loss(gain) + self._unseen(gain, now.reading_c)) * span_s
        self._silence.add(gain, block, before, now, loss_k * self._lost_at(now), proven=proven)
        self._answered_s -= span_s
        large = proven and self._answered_s <= 0.0 and loss_k > MUCH_SHARE * full_k
        missing_k = self._missing_k - FULL_SHARE * full_k
        missing_k += _missing_k(heat_k, loss_k, rise_k, full_k, again=again, large=large)
        if self._missing_k == 0.0:
            self.since = before
        self._missing_k = max(0.0, missing_k)
        self._settle_s = SETTLE_S if jumped else self._settle_s - span_s
        if self._settle_s <= 0.0:
            extra_k = rise_k + self._sure_loss(now.reading_c) * span_s - EXTRA_GAINS * heat_k
            extra_k = clamp(extra_k, -full_k, full_k) - EXTRA_SHARE * full_k
            self._extra_k = max(0.0, self._extra_k + extra_k)
        if follow and not jumped and self.calm(gain, block.sd_k):
            most_k = full_k + FOLLOWS_SDS * block.sd_k
            self._follow(before, now, clamp(rise_k, -most_k, most_k), gain.lag_s)
        if not again:  # what it needed is what it was asked about
            self._need(gain, before, now)
        self._creep(gain, now.reading_c, span_s, block.sd_k)

    def _together(self, before: Seen, block: Block, *, jumped: bool) -> tuple[Seen, Block, bool]:
        """Return where what is taken together begins, its block, whether it jumped; forget it."""
        if self._begun is not None:
            before, earlier, had_jumped = self._begun
            jumped = jumped or had_jumped
            span_s = earlier.span_s + block.span_s
            given_s = earlier.span_s * earlier.power + block.span_s * block.power
            block = block._replace(span_s=span_s, power=given_s / span_s)
        self._begun = None
        return before, block, jumped

    def _unseen(self, gain: Gain, reading_c: float) -> float:
        """Return what a loss may have grown, or has surely shrunk, by since it was learnt."""
        above_k = reading_c - self._level_c
        if above_k > 0.0:
            return above_k * max(gain.cools_per_s, 1.0 / COOLS_WITHIN_S)
        return above_k * SURE_SHARE * gain.cools_per_s

    def _lost_at(self, now: Seen) -> float:
        """Return the share of the loss that there is at a reading: none where it was coldest."""
        above_k, here_k = self._level_c - self._coldest_c, now.reading_c - self._coldest_c
        return clamp(here_k / above_k, 0.0, 1.0) if above_k > 0.0 else 1.0

    def _cool(self, gain: Gain, span_s: float, reading_c: float) -> None:
        """Remember how fast the plant surely cooled a while ago."""
        self._coldest_c = min(self._coldest_c, reading_c)
        self._cools_s -= span_s
        if gain.cools_per_s > 0.0:
            self._cools_s = COOLED_S
        elif self._cools_s > 0.0:
            return
        self._cools_per_s, self._cools_loss = gain.cools_per_s, self.loss(gain)

    def _sure_loss(self, reading_c: float) -> float:
        """Return how fast a reading surely falls without power, in K/s.

        A plant that cools faster the hotter it is lost nothing at least where it was coldest.
        """
        cools = SURE_SHARE * self._cools_per_s * (reading_c - self._coldest_c)
        return min(self._cools_loss, max(cools, 0.0))

    def _follow(self, before: Seen, now: Seen, rise_k: float, lag_s: float) -> None:
        """Let the quiet rates follow those of a block."""
        span_s = now.t_s - before.t_s
        self._known_s += span_s
        share = span_s / min(self._known_s, max(MEMORY_S, MEMORY_LAGS * lag_s))
        self._rates = tuple(
            [
                mean + share * ((after - was) / span_s - mean)
                for mean, after, was in zip(self._rates, now.heat_s, before.heat_s, strict=True)
            ]
        )
        self._rise_rate += share * (rise_k / span_s - self._rise_rate)
        if math.isnan(self._level_c):
            self._level_c = now.reading_c
        self._level_c += share * (now.reading_c - self._level_c)

    def _need(self, gain: Gain, before: Seen, now: Seen) -> None:
        """Learn which power the reading needs to stand still."""
        span_s = now.t_s - before.t_s
        heat_s = now.heat_s[gain.place] - before.heat_s[gain.place]
        needed = (heat_s - (now.reading_c - before.reading_c) / gain.mean) / span_s
        self._needed_s = min(self._needed_s + span_s, NEEDED_S)
        self._needed += min(span_s / self._needed_s, 1.0) * (needed - self._needed)

    def _creep(self, gain: Gain, reading_c: float, span_s: float, sd_k: float) -> None:
        """Notice a loss that grows while the reading stands still."""
        power = self._needed
        if not abs(reading_c - self._stood_c) < max(STANDS_K, DOUBT_SDS * sd_k):
            self._stand(gain, reading_c)
        self._stood_s += span_s
        proven = self._stood_s > COMPARED_FROM_S
        slowly = proven and power > self._stood_power
        memory_s = COMPARED_S if slowly else MEMORY_S
        self._stood_power += min(span_s / memory_s, 1.0) * (power - self._stood_power)
        if proven:
            self._proven_c, self._proven_power = self._stood_c, self._stood_power
        grown = power - self._stood_power
        least_k = max(CREPT_K, DOUBT_SDS * sd_k)
        seen = proven and grown * gain.mean * MEMORY_S > least_k
        crept = seen and grown > clamp(self._stood_power, CREPT_LEAST, CREPT)
        self._crept_s = self._crept_s + span_s if crept else 0.0

    def _stand(self, gain: Gain, reading_c: float) -> None:
        """Begin to stand at another reading, with the loss of the last one if it was near."""
        above_k = reading_c - self._proven_c
        self._stood_c, self._stood_s, self._stood_power = reading_c, 0.0, self._needed
        if abs(above_k) < KEPT_K:
            more = max(above_k, 0.0) * max(gain.cools_per_s, 1.0 / COOLS_WITHIN_S) / gain.mean
            self._stood_s = COMPARED_FROM_S - KEPT_FROM_S
            self._stood_power = self._proven_power + more

    def told(self, gain: Gain, now: Seen) -> str:
        """Return what was expected since the doubt began, and what came."""
        since, loss = self.since, self.loss(gain)
        if self.crept:
            return (
                f"expected about {self._stood_power:.0%} power to hold the reading, "
                f"it took {self._needed:.0%}"
            )
        if since is None or not now.t_s > since.t_s:
            return "expected a reading that answers to the power"
        span_s = now.t_s - since.t_s
        heat_s = now.heat_s[gain.place] - since.heat_s[gain.place]
        expected_k = gain.mean * heat_s - loss * span_s
        sd_k = math.hypot((gain.sd + 0.1 * gain.mean) * heat_s, 0.1 * gain.stored_k)
        return (
            f"expected {expected_k:+.2f} +-{sd_k:.2f} K in {span_s:.0f} s at "
            f"{heat_s / span_s:.0%} power, got {now.reading_c - since.reading_c:+.2f} K"
        )


def _missing_k(
    heat_k: float, loss_k: float, rise_k: float, full_k: float, *, again: bool, large: bool
) -> float:
    """Return what is missing in a block beyond what may be, in K; see `MUCH_SHARE` for `large`."""
    left_k = max(heat_k - loss_k, 0.0)
    missing_k = clamp(heat_k - loss_k - rise_k, -2.0 * full_k, heat_k)
    missing_k -= HALF * (left_k if again else heat_k)
    if not large:
        return missing_k
    spared_k = max(HALF * left_k, min(HALF * heat_k, GROWS_SHARE * full_k))
    return max(missing_k, left_k - max(rise_k, 0.0) - spared_k)


def _limit_k(gain: Gain, sd_k: float, lags: float) -> float:
    """Return the sum in K from which on it is a doubt."""
    return max(DOUBT_K, DOUBT_SDS * sd_k, lags * gain.stored_k)
