"""Whether the reading answers to the power, and what is done when it does not.

A heater that is known is watched by `HeatDoubt`. One that is not yet known has some seconds of full
power to show a rise (`Trial`). A heater in doubt is asked: the power is cut for some lags, and
`question` reads the answer. No answer, or the wrong one, is SAFE, and for the second time LATCHED;
a reading that goes on rising without power is LATCHED at once.
"""

from __future__ import annotations

import math
from collections import deque

from thermoctl.regulator.heater import ceiling, climb, evidence, fall, hearing, question
from thermoctl.regulator.heater.blocks import Block, Blocks
from thermoctl.regulator.heater.ceiling import Ceiling
from thermoctl.regulator.heater.check import HeaterCheck, Reacts
from thermoctl.regulator.heater.climb import Climb
from thermoctl.regulator.heater.cut import Cut
from thermoctl.regulator.heater.doubt import DOUBT_K, HeatDoubt
from thermoctl.regulator.heater.known import KnownHeater
from thermoctl.regulator.heater.question import BEFORE_S, CREPT_LAGS, Answer
from thermoctl.regulator.heater.response import Gain, HeatResponse, Seen
from thermoctl.regulator.heater.rising import RISES, rising
from thermoctl.regulator.heater.stuck_sensor import StuckSensor
from thermoctl.regulator.heater.trial import Trial
from thermoctl.regulator.heater.verdicts import Verdicts
from thermoctl.regulator.supervisor import Emit

OFF = 0.01  # power below which the output counts as off
ROWS = 450
"""Number of blocks that are remembered: half an hour at a period of 1 s."""


class HeaterWatch:
    """Watches one heater, and asks it; told of every sample, in every mode and state.

    Parameters
    ----------
    check : HeaterCheck
        What is admissible.
    period_s : float
        Nominal time between two samples.
    supervisor : Reacts
        Who is told of a fault.
    emit : callable
        Called as ``emit(name, **fields)`` when a question is put, and when it is answered well.
    """

    def __init__(self, check: HeaterCheck, period_s: float, supervisor: Reacts, emit: Emit) -> None:
        self._unknown_s = max(60.0, 10.0 * period_s)
        self._sign = 1.0 if check.action == "heat" else -1.0
        self._blocks = Blocks(period_s, self._sign)
        self._stuck = StuckSensor()
        self._power_max = most = check.power_max
        self._response, self._doubt, self._climb = HeatResponse(), HeatDoubt(most), Climb()
        self._supervisor, self._emit, self._verdicts = supervisor, emit, Verdicts(supervisor)
        self._heater, self._trial, self._ceiling = KnownHeater(most), Trial(check), Ceiling()
        self._settled_s = 0.0  # time at which all heat from before the start has arrived
        self._rows: deque[Seen] = deque(maxlen=ROWS)
        self._cut: Cut | None = None
        self._t_s = self._off_s = 0.0
        self._distrusted_k = 0.0  # heat that must be answered before anything is learnt again

    @property
    def asks(self) -> bool:
        """Whether power has to be 0 now, for the sake of a question."""
        return self._cut is not None

    @property
    def known(self) -> Gain | None:
        """What is known of the heater, once it is."""
        return self._heater.gain

    @property
    def ceiling_c(self) -> float:
        """Reading in degC that all the power does not pass; NaN before one was seen."""
        return self._sign * self._ceiling.level_c if self._ceiling.known else math.nan

    def recall(self, known: Gain) -> None:
        """Begin with what an earlier run knew; in the end this one learns it."""
        self._heater.recall(known)
        self._settled_s = self._heater.under_way_s

    def observe(self, t_s: float, interval_s: float, reading_c: float, applied: float) -> None:
        """Take in the `applied` power of the last interval and the reading at its end.

        Parameters
        ----------
        t_s, interval_s : float
            Time of the sample, and since the one before, in s.
        reading_c : float
            In degC; NaN where there is none to be believed.
        applied : float
            Power that the actuator took, as a fraction.
        """
        if interval_s > self._unknown_s:
            self._lose_track()
            self._trial.begin(self._t_s)
            return
        if self._stuck.observe(reading_c):
            self._supervisor.fail("sensor.stuck", 4, self._stuck.told(), t_s)
        block = self._blocks.add(interval_s, reading_c, applied)
        if block is not None:
            self._evaluate(block, t_s)

    @property
    def under_way_s(self) -> float:
        """How long after its power heat of this one may still arrive."""
        return self._heater.under_way_s

    def stand_aside(self, under_way_s: float) -> None:
        """Leave the reading to another actuator, whose heat lasts `under_way_s`."""
        self._lose_track()
        self._trial.pause()
        self._off_s, self._settled_s = 0.0, self._t_s + under_way_s

    def _lose_track(self) -> None:
        """After a long gap nobody knows what was applied."""
        self._ceiling.clear()
        self._climb.clear()
        self._blocks.clear()
        self._response.begin_again()
        self._doubt.clear()
        self._rows.clear()
        self._cut = None

    def _evaluate(self, block: Block, t_s: float) -> None:
        """Evaluate a complete block."""
        known, sd_k = self._heater.gain, block.sd_k
        self._t_s += block.span_s
        self._off_s = self._off_s + block.span_s if block.power < OFF else 0.0
        there = self._ceiling.holds(block)
        trusted = self._cut is None and self._distrusted_k <= 0.0 and self._climb.calm(sd_k)
        learns = trusted and not there and (known is None or self._doubt.calm(known, sd_k))
        self._response.observe(block, learn=learns)
        if self._response.retracted and self._heater.retract():
            self._trial.begin(self._t_s)
            self._resume()
        if math.isnan(block.reading_c):
            return
        before = self._rows[-1] if self._rows else None
        now = Seen(self._t_s, block.reading_c, self._response.heat_s)
        self._rows.append(now)
        if known is not None and self._ceiling.found(self._rows, known, now, sd_k):
            self._withdraw()
        self._trial.account.add(block.power, before, now, there=there)
        if self._cut is not None:
            self._look_for_answer(self._cut, sd_k, now, t_s)
            return
        if there:
            self._climb.pause()
            self._doubt.clear()
            return
        if learns and (self.known is not None or now.reading_c > self._trial.refused_c):
            if self._response.ripe:
                self._heater.learn(self._response.gain, now, self._response.moved_k, sd_k)
            self._heater.follow(block.power, now)
        if before is not None:
            self._follow_climb(block, before, now)
            outdone = self._heater.outdone(block.power, before, now, sd_k)
            if outdone and not self._response.jumped and (trusted or self._heater.recalled):
                self._disown(now)
        if self._cut is None and not self._heater.seen:
            self._ask(self._trial.question(self._heater.counts(block.power), block, now))
        known, settled = self._heater.gain, self._t_s >= self._settled_s
        if known is not None and settled and self._cut is None and before is not None:
            self._compare(known, block, before, now, t_s)

    def _withdraw(self) -> None:
        """Take a bad answer back, or a doubt: the plant gets no warmer."""
        if self._cut is not None or self._distrusted_k > 0.0:
            self._emit("heater.answered", text=ceiling.TEXT.format(self.ceiling_c))
        self._trial.settle(self._t_s)
        self._verdicts.take_back()
        self._distrusted_k = 0.0
        self._trust()

    def _disown(self, now: Seen, ask: Cut | None = None) -> None:
        """Go on with a heater that nobody knows: what was known is not of this plant."""
        if self._heater.seen:
            self._response.forget()
        self._heater.disown()
        self._ceiling.clear()
        self._doubt, self._distrusted_k = HeatDoubt(self._power_max), 0.0
        self._trial.settle(now.t_s)
        self._ask(ask)

    def _falls_short(self, known: Gain, now: Seen, sd_k: float) -> bool:
        """Return whether more heat has not borne out what is known, and ask again: it was air."""
        held = not (self._heater.recalled or self._distrusted_k > 0.0)
        revised = self._trial.account.revised(known, self._rows, sd_k) if held else known
        if revised is known:
            return False
        self._response.forget()
        if revised is None:
            self._disown(now, self._trial.again(now, self._rows))
        else:
            self._heater.accept(revised)
        return revised is None

    def _follow_climb(self, block: Block, before: Seen, now: Seen) -> None:
        """Follow a climb, of a heater that is known or not; ask it when it has stalled."""
        known, rising, jumped = self._heater.gain, self._climb, self._response.jumped
        rising.observe(known, block, before, now, jumped=jumped)
        if known is None and not jumped and rising.calm(block.sd_k):
            self._doubt.begin(before, now)
        stalled = rising.stalled(block.sd_k) and block.power >= OFF
        if stalled and (known is None or not self._acquits(known, rising, block.sd_k)):
            self._ask(rising.question(known, now))

    def _compare(self, known: Gain, block: Block, before: Seen, now: Seen, t_s: float) -> None:
        """Compare what a known heater should have done with what came."""
        doubt, sd_k, jumped = self._doubt, block.sd_k, self._response.jumped
        if not self._heater.proven and (
            self._latch_if_heated(known, now, sd_k, t_s) or self._falls_short(known, now, sd_k)
        ):
            return  # one that is proven is judged by what may come late, below
        again, proven = self._distrusted_k > 0.0, self._heater.proven
        follow = not again and self._climb.calm(sd_k)
        doubt.compare(
            known, block, before, now, jumped=jumped, follow=follow, again=again, proven=proven
        )
        if again and doubt.calm(known, sd_k):
            heat_s = now.heat_s[known.place] - before.heat_s[known.place]
            self._distrusted_k -= known.mean * heat_s
        hot = doubt.hot(known, sd_k) and self._heater.seen  # less water is no fault
        silent = doubt.silent(known, self._trial.weakest, now, sd_k, again=again)
        if hot and self._off_s >= self._heater.under_way_s:
            self._latch_if_rises(known, now, sd_k, t_s, 0.0)
        elif not (silent or hot or block.power < OFF) and doubt.creeps(known, sd_k, again=again):
            self._ask_of_creep(known, now, sd_k)
        elif hot or ((silent or doubt.cold(known, sd_k, again=True)) and block.power >= OFF):
            cut = silent or doubt.question(self._rows, known, now, sd_k, hot=hot, again=again)
            weighs = cut is not None and cut.began_s is not None
            if not (weighs and self._acquits(known, doubt, sd_k)):
                self._ask(cut)

    def _acquits(self, known: Gain, why: HeatDoubt | Climb, sd_k: float) -> bool:
        """Return whether the heater has answered unasked to `why` it is in doubt.

        Not so after a bad answer: swings of the air around a sensor are brought back as well.
        """
        if self._distrusted_k > 0.0 or self._verdicts.lately(self._t_s):
            return False
        since_s = self._t_s if why.since is None else why.since.t_s
        answered = hearing.unasked(self._rows, since_s, known, sd_k)
        if answered:
            self._doubt.acquit(known, self._rows, since_s)
            self._climb.clear()
        return answered

    def _ask_of_creep(self, known: Gain, now: Seen, sd_k: float) -> None:
        """Ask why the power has grown, unless the reading dipped and was brought back by it."""
        began_s = now.t_s - self._doubt.crept_s - evidence.BEFORE_LAGS * known.lag_s
        if evidence.odds(self._rows, began_s, known, sd_k) > evidence.SOUND:
            self._doubt.stand_by()
            return
        from_s = now.t_s - max(CREPT_LAGS * known.lag_s, BEFORE_S)
        self._ask(Cut(now.t_s, from_s, self._doubt.told(known, now), began_s=began_s, crept=True))

    def _ask(self, cut: Cut | None) -> None:
        if cut is None:
            return
        self._cut = cut
        if self._heater.gain is not None:
            self._ceiling.follow(self._rows, self._heater.gain, cut.at_s)
        if not cut.quiet:
            self._tell(cut)

    def _tell(self, cut: Cut) -> None:
        self._cut = cut._replace(quiet=False)
        self._emit("heater.questioned", text=f"{cut.why}; power is cut to see what it does")

    def _look_for_answer(self, cut: Cut, sd_k: float, now: Seen, t_s: float) -> None:
        """Look for an answer; go on when it is a good one, fail when it is none."""
        known, lag_s, asked_s = self._heater.gain, self._heater.longer_s, now.t_s - cut.at_s
        if cut.rose is None and known is not None and self._latch_if_heated(known, now, sd_k, t_s):
            return
        answer, shown = self._answer(cut, sd_k)
        if known is None:
            answer = self._trial.account.audited(answer, shown, self._rows, sd_k)
        heard_s, bad_s = hearing.believed_s(known, lag_s)
        if cut.quiet and hearing.tells(answer, asked_s, lag_s):
            self._tell(cut)
        if answer is Answer.HEATS:
            if asked_s >= heard_s:
                self._accept(shown, asked_s)
        elif asked_s < bad_s:
            return
        elif known is not None and cut.wild:
            from_s = now.t_s - max(lag_s, BEFORE_S)
            if fall.over(self._rows, from_s, known, self._doubt.loss(known)):
                self._emit("heater.answered", text=fall.OVER)
                self._suspect(known)
        elif answer is Answer.HIDDEN:
            self._leave_open(asked_s)
        elif answer is not Answer.OPEN:
            self._refuse(answer, cut, shown, asked_s, t_s)
        elif known is not None and asked_s > hearing.longest_s(cut, known, sd_k):
            answer, shown = self._answer(cut, sd_k, question.LIKELY)
            if answer is Answer.HEATS:
                self._emit("heater.answered", text=hearing.LIKELY.format(asked_s, shown.mean))
                self._trust()
            elif answer is Answer.HIDDEN:
                self._leave_open(asked_s)
            else:
                self._refuse(Answer.NOTHING, cut, shown, asked_s, t_s)
        elif known is None and asked_s > self._trial.listens_s(sd_k):
            if self._trial.over(shown, sd_k):
                self._verdicts.note(self._t_s)  # asked often enough: nothing is left to be tried
                self._refuse(Answer.NOTHING, cut, shown, asked_s, t_s)
                return
            self._trial.enlarge(sd_k)
            self._resume()

    def _leave_open(self, asked_s: float) -> None:
        """Go on: what is in doubt is the moment of the cut, and another one tells."""
        self._emit("heater.answered", text=hearing.HIDDEN.format(asked_s))
        self._resume()

    def _answer(self, cut: Cut, sd_k: float, sure: float = question.SURE) -> tuple[Answer, Gain]:
        """Return what the reading says so far, and the gain it shows."""
        known, climbed = self._heater.gain, climb.SHOWS * self._climb.shown
        if known is not None:
            return hearing.answer(self._rows, cut, known, sd_k, sure)
        weakest, froms_s = max(self._trial.weakest, climbed), [cut.from_s]
        if not climbed:  # what has climbed may have failed since
            froms_s += [self._trial.since_s, -math.inf]
        return question.of_unknown_rows(self._rows, froms_s, cut.at_s, weakest, sd_k)

    def _latch_if_heated(self, known: Gain, now: Seen, sd_k: float, t_s: float) -> bool:
        """Return whether the reading has risen long after the power went, and latch that."""
        late = self._off_s > self._heater.over_s
        return late and self._latch_if_rises(known, now, sd_k, t_s, RISES * known.mean)

    def _latch_if_rises(self, known: Gain, now: Seen, sd_k: float, t_s: float, by: float) -> bool:
        """Return whether it rises by more than `by` in K/s without power, and latch that."""
        rate = rising(self._rows, self._heater, now, self._off_s, sd_k, self._doubt.loss(known))
        if rate > by:
            self._fail("heater.stuck_on", question.told_of(rate), t_s)
        return rate > by

    def _accept(self, shown: Gain, asked_s: float) -> None:
        """Go on with a heater that heats, and with the gain it has shown if that is news."""
        if (cut := self._cut) is None or not cut.quiet:
            self._emit("heater.answered", text=hearing.told(shown, asked_s, known=self.known))
        if cut is None or cut.teaches:
            self._heater.accept(shown, more=cut is None or cut.began_s is None)
        self._trial.settle(self._t_s)
        self._distrusted_k = 0.0
        self._trust()

    def _trust(self) -> None:
        """Go on with a heater that heats; what made it doubtful is how the plant is now."""
        self._doubt.trust()
        self._climb.clear()
        self._resume()

    def _refuse(self, answer: Answer, cut: Cut, shown: Gain, asked_s: float, t_s: float) -> None:
        """Fail a heater that answered with nothing, or the wrong way.

        One that is not known is asked again before anybody is told: while a plant comes to rest,
        anything may move its reading. A remembered one may be weaker, where a little is an answer.
        """
        if self._heater.recalled and shown.mean > question.SURE * shown.sd:
            self._accept(shown, asked_s)
            return
        if self._heater.gain is None:
            lately = self._trial.refused or self._verdicts.lately(self._t_s)
            self._verdicts.note(self._t_s)
            if not lately:
                self._trial.refuse(self._t_s, self._rows, cut.from_s)
                self._resume()
                return
        code = "heater.reversed" if answer is Answer.COOLS else "heater.no_response"
        self._fail(code, f"{cut.why}; {hearing.refused(shown, asked_s, known=self.known)}", t_s)

    def _fail(self, code: str, text: str, t_s: float) -> None:
        """Go to SAFE; to LATCHED at the second time, or where nothing can switch it off."""
        latched = self._verdicts.fail(code, text, t_s, self._t_s)
        if latched and self._heater.recalled:  # once mended, or acknowledged, it is a new one
            self._heater.forget()
        self._suspect(self._heater.gain, anew=latched)

    def _suspect(self, known: Gain | None, *, anew: bool = False) -> None:
        """Go on with a heater that has to answer to its next heat, and soon: or it is latched."""
        self._verdicts.note(self._t_s)
        (self._trial.begin if anew else self._trial.settle)(self._t_s)
        if known is not None:
            self._distrusted_k = max(2.0 * known.stored_k, DOUBT_K)
            from_s = self._t_s - max(known.lag_s, BEFORE_S)
            self._doubt.distrust(known, -question.slope(self._rows, from_s))
        self._resume()

    def _resume(self) -> None:
        self._cut = None
        self._climb.pause()
        self._doubt.clear()
        self._trial.resume(self._t_s)
