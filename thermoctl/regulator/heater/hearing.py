"""Which answers of a heater count, and how soon they are believed.

`question` reads it off the readings around the cut alone. Where a load may have given it,
`evidence` weighs in all that was seen since the doubt began.
"""

from __future__ import annotations

from collections.abc import Collection

from thermoctl.quantities import clamp
from thermoctl.regulator.heater import evidence, question
from thermoctl.regulator.heater.balance import brought_back
from thermoctl.regulator.heater.cut import Cut
from thermoctl.regulator.heater.known import OFF_LAGS
from thermoctl.regulator.heater.question import Answer
from thermoctl.regulator.heater.response import Gain, Seen
from thermoctl.regulator.heater.rising import RISES

HEARD_S, HEARD_LAGS = 20.0, 0.5
"""Time after the cut from which on a good answer is believed: in s of an unknown heater, in lags of
a known one."""
BAD_S, BAD_LAGS = 60.0, 2.0
"""The same for a bad answer."""
QUIET_LAGS = 3.0
"""Time in lags after which a heater that has given a little heat is late with its answer."""
LEFT, LEFT_SURE = 0.15, 2.0
"""Share of its gain that is left to a heater at what its plant can reach: a jacket, a PTC element
or a compressor gives less the nearer it comes, and without it a plant that is well insulated cools
by as little. And the least number of standard deviations by which so little is an answer."""
GOES_ON = 0.5
"""Share of the rate at full power by which a reading that rises after a long cut goes on as before:
a wall has given off most of its heat by then."""
RECENT_S = 60.0
"""Time before a cut that nothing gave rise to, in s, in which there is seldom a load."""
RISES_SDS = 5.0
"""Standard deviations of a reading by which it has risen."""
SHOWS = "{:.0f} s without power show a gain of {:.2g} K/s"
LIKELY = "{:.0f} s without power do not show it surely, but a gain of {:.2g} K/s is likely"
LOAD = "after {:.0f} s without power a load explains why more was needed, a dead heater does not"
HIDDEN = "{:.0f} s without power show less than a load that comes and goes may hide"


def told(shown: Gain, asked_s: float, *, known: Gain | None) -> str:
    """Return what a good answer says; one that is what was `known` owes it to a load."""
    if shown is known:
        return LOAD.format(asked_s)
    return SHOWS.format(asked_s, shown.mean)


def refused(shown: Gain, asked_s: float, *, known: Gain | None) -> str:
    """Return what a bad answer says, next to what is `known`."""
    instead = "" if known is None else f" instead of {known.mean:.3g}"
    return SHOWS.format(asked_s, shown.mean) + instead


def believed_s(known: Gain | None, lag_s: float) -> tuple[float, float]:
    """Return from when on a good answer is believed, and a bad one."""
    if known is None:
        return HEARD_S, BAD_S
    return HEARD_LAGS * lag_s, BAD_LAGS * lag_s


def tells(answer: Answer, asked_s: float, lag_s: float) -> bool:
    """Return whether to tell of a quiet question: its answer is late, or bad."""
    if asked_s >= QUIET_LAGS * lag_s:
        return answer is not Answer.HEATS
    return asked_s >= BAD_LAGS * lag_s and answer in (Answer.NOTHING, Answer.COOLS)


def longest_s(cut: Cut, known: Gain, sd_k: float) -> float:
    """Return how long the answer of a known heater is waited for."""
    return question.longest_s(known, sd_k) if cut.rose is None else question.ROUTINE_S


def answer(
    rows: Collection[Seen], cut: Cut, known: Gain, sd_k: float, sure: float = question.SURE
) -> tuple[Answer, Gain]:
    """Return what the readings say so far, and the gain they show.

    Parameters
    ----------
    rows : collection of Seen
        Readings around the cut.
    cut : Cut
        When the power was cut, and why.
    known : Gain
        What the heater did when it was sound.
    sd_k : float
        Standard deviation of a reading, in K.
    sure : float
        Standard deviations by which an answer has to differ from nothing.
    """
    if cut.rose is not None:
        return _of_routine(rows, cut, known, sd_k, late=sure < question.SURE)
    least = known
    if cut.stands:
        least, sure = known._replace(mean=LEFT * known.mean), max(sure, LEFT_SURE)
    found, shown = question.of_known_rows(rows, cut.from_s, cut.at_s, least, sd_k, sure)
    if found is Answer.COOLS and shown.mean > -question.ANSWERS * known.mean:
        found = Answer.OPEN  # so little is left of a load or of the weather
    late = sure < question.SURE
    if cut.began_s is None:
        unsure = cut.portion and found in (Answer.OPEN, Answer.LATE)
        if unsure and _nothing_came(rows, cut, known, sd_k):
            found = Answer.NOTHING
        if found is Answer.HEATS and _still_rises(rows, cut, known, sd_k):
            found = Answer.OPEN
        return (Answer.OPEN if found is Answer.LATE else found), shown
    if found is Answer.HEATS and not late:
        return found, shown
    odds = evidence.odds(rows, cut.began_s, known, sd_k, late=found is Answer.LATE)
    weighed = evidence.weigh(found, odds, crept=cut.crept, late=late)
    return weighed, known if odds > evidence.SOUND or found is Answer.LATE else shown


def unasked(rows: Collection[Seen], since_s: float, known: Gain, sd_k: float) -> bool:
    """Return whether more power brought a reading back that fell at `since_s`."""
    from_s = since_s - evidence.BEFORE_LAGS * known.lag_s
    back = brought_back(rows, from_s, sd_k)
    return back and evidence.odds(rows, from_s, known, sd_k) > evidence.SOUND


def _still_rises(
    rows: Collection[Seen], cut: Cut, known: Gain, sd_k: float, share: float = RISES
) -> bool:
    """Return whether the reading goes on rising, which no cut of a sound heater lets it do."""
    last_s, most = max(row.t_s for row in rows), known.mean
    from_s = max(cut.at_s, last_s - max(OFF_LAGS * known.lag_s, question.BEFORE_S))
    if cut.rose is not None:  # the gain may be overstated, and a few readings of a weak one no sign
        from_s, most = min(from_s, 0.5 * (cut.at_s + last_s)), clamp(cut.rose, 0.0, most)
    return question.slope(rows, from_s, less_sd_k=sd_k) > share * most


def _of_routine(
    rows: Collection[Seen], cut: Cut, known: Gain, sd_k: float, *, late: bool
) -> tuple[Answer, Gain]:
    """Return the answer where nothing is in doubt; what stays open is left open in the end.

    What is known was told under full power alone, and may be far off, lag and all. A good answer
    may be one by readings around the cut: some minutes before it cold water may have come.
    """
    weakest, recent_s = LEFT * question.ANSWERS * known.mean, cut.at_s - RECENT_S
    for from_s in (recent_s, cut.from_s):
        found, shown = question.of_unknown_rows(rows, (from_s,), cut.at_s, weakest, sd_k)
        if found is Answer.HEATS and not _still_rises(rows, cut, known, sd_k):
            return found, shown
    if found is Answer.COOLS and shown.mean < -question.ANSWERS * known.mean:
        return found, shown
    if not late:
        return Answer.OPEN, shown
    weakest = question.ANSWERS * known.mean
    found, shown = question.of_unknown_rows(rows, (cut.from_s,), cut.at_s, weakest, sd_k)
    goes_on = shown.mean < weakest and _still_rises(rows, cut, known, sd_k, GOES_ON)
    return Answer.NOTHING if found is Answer.NOTHING or goes_on else Answer.HIDDEN, shown


def _nothing_came(rows: Collection[Seen], cut: Cut, known: Gain, sd_k: float) -> bool:
    """Return whether a portion of heat has left a reading where it stood.

    A longer lag is not asked for: it would bend, but also lift, a reading that comes to rest.
    """
    meant = [row for row in rows if row.t_s >= cut.from_s]
    found = question.contrast(meant, sd_k)
    if found is None or meant[-1].reading_c - meant[0].reading_c > RISES_SDS * sd_k:
        return False
    return question.is_nothing(found, known, range(max(known.place - 1, 0), known.place + 1))
