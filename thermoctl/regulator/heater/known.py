"""What is known of a heater, who has seen it, and whether its lag was seen.

A heater may be unknown, known of an earlier run, or seen to heat in this one. What an earlier run
knew may be of another plant: where that makes a difference, its lag is taken for the next longer
one, and what this run learns takes its place after ten minutes. At rest little is learnt: a
controller that makes up for whatever comes makes it look as if heat did nothing. So what does not
agree with what an earlier run knew has to have moved the reading before it takes its place.

A reading that full power raises by more than it can shows that the memory is of another plant, of
more water; one that rises so without power would be of a heater stuck on. Such a memory would make
a gain of the loss, and expect at rest what comes of nothing: it is forgotten, and the heater is one
that nobody knows. Only its lag is kept, for other water has the same sensor: a lag that an earlier
run has seen, and this one finds as well, is as good as one that is recalled.

What this run has learnt may be wrong as well: a heater that is hardly used, beside another one that
warms the same plant, looks weak and quick. Full power shows it, by a rise far beyond what is known,
and it is learnt anew. A reading that is held tells little of a lag, and that of a plant with walls
seems to become shorter and shorter; so the lag is never much shorter than it was when it was told
most surely.

Nor is anything taken for known while it is open what was before the start: heat of before that
still arrives makes a gain of twice the true one, behind no lag at all.

A first warm-up at full power shows a gain, but hardly how long heat is on its way: as long as the
power stays, a plant whose stirrer has stopped goes on as before, only later. It shows once there is
less power and the reading obeys. Until then heat may be under way for as long as in any plant.
"""

from __future__ import annotations

from thermoctl.regulator.heater.blocks import NEARLY_FULL
from thermoctl.regulator.heater.doubt import DOUBT_K, DOUBT_SDS, EXTRA_GAINS
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen, clear_k

SURE = 5.0
"""Standard deviations from 0 beyond which a gain is known."""
ARRIVED_LAGS, ARRIVED_S = 0.5, 10.0
"""Heat that must have arrived before a gain is known, in lags and in s at full power, the larger of
the two. A start in the middle of a warm-up finds a reading that rises by earlier heat, whatever
power there is now."""
RECALLED_S = 600.0
"""Time in s in which the memory of an earlier run prevails over what this one has learnt."""
OUTDONE = 1.1
"""Largest rise that a remembered heater explains, as a multiple of its rise at full power: the
mains may be high. A larger one is that of another plant, and ends the memory."""
CHANGED, AT_ONCE = 0.7, 3.0
"""A gain below CHANGED of the known one replaces it, and so does one as far above it, but by no
more than AT_ONCE times the known one at once."""
OFF_LAGS = 1.5
"""Time without power, in lags, after which no heat is under way."""
EASED, OBEYS_LAGS, RISES = 0.7, 5.0, 0.2
"""A lag has been seen when the power was below EASED of its maximum for OBEYS_LAGS lags, and the
reading rose beyond the heat that arrived by less than RISES of what full power does."""


class KnownHeater:
    """The gain and the lag of a heater, and how far they can be trusted.

    Parameters
    ----------
    power_max : float
        Most power the loop gives: what counts as full.

    Attributes
    ----------
    gain : Gain or None
        What is known.
    recalled : bool
        Whether it is of an earlier run, and not yet seen in this one.
    """

    def __init__(self, power_max: float = 1.0) -> None:
        self._power_max, self._full = power_max, NEARLY_FULL * power_max
        self.forget()

    def forget(self) -> None:
        """Begin with a heater that nobody knows."""
        self.gain: Gain | None = None
        self.recalled = self._obeys = False
        self._most = self._outdone_k = 0.0
        self._told_sure, self._told = 0.0, 0
        self._eased: Seen | None = None  # when less power began
        self._disowned: int | None = None  # place of the lag of a memory that is disowned
        self._lag_as_disowned = False  # whether this run finds the same

    def disown(self) -> None:
        """Forget what is not of this plant; of a memory of another one, all but its lag."""
        once = self.gain.place if self.gain is not None and self.recalled else None
        self.forget()
        self._disowned = once

    def recall(self, gain: Gain) -> None:
        """Begin with what an earlier run knew, by powers that moved."""
        self.gain, self.recalled, self._obeys = gain, True, True

    @property
    def seen(self) -> bool:
        """Whether this run has seen it heat."""
        return self.gain is not None and not self.recalled

    @property
    def proven(self) -> bool:
        """Whether this run has seen it heat, and obey less power."""
        return self.seen and self._obeys

    def retract(self) -> bool:
        """Forget what this run has learnt; return whether there is nothing left."""
        if not self.recalled:
            self.forget()
        return not self.recalled

    def learn(self, gain: Gain | None, now: Seen, moved_k: float, sd_k: float) -> None:
        """Take `gain` for known, once it is sure.

        Parameters
        ----------
        gain : Gain or None
            What was learnt.
        now : Seen
            Where the plant is.
        moved_k : float
            How far the heat has moved the reading by which it was learnt, in K.
        sd_k : float
            Standard deviation of a reading.
        """
        if gain is None or gain is self.gain or gain.mean <= SURE * gain.sd:
            return
        if not arrived(gain, now):
            return
        if self.recalled and self.gain is not None:
            moved = moved_k > clear_k(sd_k)
            if now.t_s < RECALLED_S or not (moved or _agree(gain, self.gain)):
                return
            self._obeys = gain.place == self.gain.place  # another lag has not been seen by any run
            self._told_sure, self._told = 0.0, 0
        self.gain, self.recalled = self._with_lag(gain), False

    def _with_lag(self, gain: Gain) -> Gain:
        """Return `gain` with a lag at most one place shorter than the one told most surely."""
        sure = gain.mean / gain.sd
        if sure > self._told_sure:
            self._told_sure, self._told = sure, gain.place
        known, least = self.gain, self._told - 1
        if gain.place >= least:
            return gain
        gain = gain._replace(place=least)
        return known if known is not None and known == gain else gain  # while nothing is news

    def outdone(self, power: float, before: Seen, now: Seen, sd_k: float) -> bool:
        """Return whether `power` does more than that of the heater that is known could."""
        gain = self.gain
        if gain is None or power <= self._full:
            self._outdone_k = 0.0
            return False
        most = OUTDONE if self.recalled else EXTRA_GAINS
        most_k = most * gain.mean * self._power_max * (now.t_s - before.t_s)
        self._outdone_k = max(0.0, self._outdone_k + now.reading_c - before.reading_c - most_k)
        return self._outdone_k > max(DOUBT_K, DOUBT_SDS * sd_k)

    def accept(self, shown: Gain, *, more: bool = True) -> None:
        """Take for known what an answer has `shown`, if that is news.

        Not `more` than is known where it was asked for want of heat: a heater of which more was
        needed has not become stronger, and a load that has just begun makes it look so.
        """
        known = self.gain
        if known is None or shown.mean < CHANGED * known.mean:
            cools_per_s = 0.0 if known is None else known.cools_per_s
            known = shown._replace(cools_per_s=cools_per_s)
        elif more and shown.mean > known.mean / CHANGED:
            known = known._replace(mean=min(shown.mean, AT_ONCE * known.mean))
        self._obeys = self._obeys and not self.recalled  # an answer does not show the lag
        self.gain, self.recalled = known, False

    def follow(self, power: float, now: Seen) -> None:
        """See whether the reading obeys less `power`, in a block without a doubt."""
        self._most = max(self._most, power)
        gain, start = self.gain, self._eased
        if gain is not None and power >= EASED * self._most:  # one stuck on teaches any lag later
            self._lag_as_disowned = gain.place == self._disowned
        if gain is None or self._obeys or power >= EASED * self._most:
            self._eased = None
        elif start is None:
            self._eased = now
        elif now.t_s - start.t_s >= OBEYS_LAGS * gain.lag_s:
            heat_s = now.heat_s[gain.place] - start.heat_s[gain.place]
            most_k = gain.mean * (heat_s + RISES * (now.t_s - start.t_s))
            self._obeys, self._eased = now.reading_c - start.reading_c < most_k, None

    def counts(self, power: float) -> float:
        """Return what `power` counts for while a heater has still to be seen.

        Where nothing is known, its cube: at a fifth of the power there are two hours. Not so long
        where the loop gives no more than that: such power is not what holds a plant.
        """
        known = self.gain is not None
        return float(power > self._full) if known else power**3 / self._power_max

    @property
    def longer_s(self) -> float:
        """The lag; the next longer one where it may have changed, the longest, unknown."""
        if self.gain is None:
            return LAGS_S[-1]
        return LAGS_S[min(self.gain.place + self.recalled, len(LAGS_S) - 1)]

    @property
    def under_way_s(self) -> float:
        """How long after the power heat of before may still arrive."""
        return OFF_LAGS * (
            self._lag_or_next_s if self._obeys or self._lag_as_disowned else LAGS_S[-1]
        )

    @property
    def over_s(self) -> float:
        """How long after the power a rise is none of its heat."""
        return self.under_way_s + self._lag_or_next_s

    @property
    def surest_lag_s(self) -> float:
        """The lag that was told most surely; the longest, unknown."""
        return LAGS_S[-1] if self.gain is None else LAGS_S[max(self.gain.place, self._told)]

    @property
    def _lag_or_next_s(self) -> float:
        """The lag; the next longer one where it is an earlier run that has seen it."""
        if self._lag_as_disowned and not self._obeys and self._disowned is not None:
            return LAGS_S[min(self._disowned + 1, len(LAGS_S) - 1)]
        return self.longer_s


def arrived(gain: Gain, now: Seen) -> bool:
    """Return whether enough heat has come by `now` to know a gain under such a lag."""
    return now.heat_s[gain.place] > max(ARRIVED_LAGS * gain.lag_s, ARRIVED_S)


def _agree(gain: Gain, other: Gain) -> bool:
    """Return whether both may be of one heater."""
    return CHANGED * other.mean < gain.mean < other.mean / CHANGED
