"""Whether a remembered bank foresees better than one that knows nothing.

Both see the same samples, and the remembered one steers. Every reading is a prediction put to the
test: the log odds between the two grow by the difference of its log likelihoods,
`Bank.log_likelihood`, as far as the sample counts as evidence, ALF (6)-(7) with two models in
place of many. So the odds are those of Bayes: a model that is right gains on one that expects
anything, and one that is wrong loses to it. The loser is dropped, and from then on there is one
bank again.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from thermoctl.control.adaptive.bank import Bank
from thermoctl.control.adaptive.bank_belief import BankBelief
from thermoctl.control.adaptive.evidence import EVIDENCE_FROM
from thermoctl.control.adaptive.held import Held, observed, seen

DROP_ODDS = -3.0
"""Log odds below which the remembered bank is dropped: 20 to 1 against it."""
HEARD_S, HEARD_LAGS = 60.0, 3.0
"""Exciting time after which the trial is over: in s and in lags, the longer of the two."""

_EVEN_ODDS, _SAID_ODDS = math.log(1.5), math.log(1000.0)
"""Log odds below which they are called even, and above which 'more than' is all that is said."""

TRUSTED, DROPPED = "model.trusted", "model.dropped"
_ORIGINS = {TRUSTED: "stored", DROPPED: "dropped", "": "new"}


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """What has become of a remembered bank.

    Parameters
    ----------
    rival : BankBelief or None
        The bank that began with nothing; None when there is no trial, or it is over.
    held : Held or None
        The remembered one from another past; None once that is settled.
    odds : float
        Natural logarithm of the odds for the remembered one.
    heard_s : float
        Time that counted as evidence.
    verdict, text : str
        `TRUSTED` or `DROPPED`, and why; empty until then, or when nothing was remembered.
    """

    rival: BankBelief | None = None
    held: Held | None = None
    odds: float = 0.0
    heard_s: float = 0.0
    verdict: str = ""
    text: str = ""

    @property
    def origin(self) -> str:
        """What the bank that steers began with."""
        if self.rival is not None:
            return "trial"
        return _ORIGINS[self.verdict]


def observe(
    law: Bank, bank: BankBelief, memory: Memory, y_c: float, applied: float
) -> tuple[BankBelief, Memory]:
    """Return bank and trial after a period of `applied` and the reading `y_c`."""
    rival, held = memory.rival, memory.held
    if rival is None:
        return law.observe(bank, y_c, applied), memory
    if held is None:
        after, told = seen(law, bank, y_c, applied)
    else:
        after, held, told = observed(law, bank, held, y_c, applied)
    rivals = law.predict(rival, applied)
    odds, heard = memory.odds, 0.0
    if math.isfinite(y_c) and after.sample >= EVIDENCE_FROM:
        heard = after.excitation.share
    if heard > 0.0:
        odds += heard * (told - law.log_likelihood(rival, rivals, y_c))
    heard_s = memory.heard_s + heard * law.period_s
    return _judged(after, Memory(law.correct(rival, rivals, y_c), held, odds, heard_s))


def lost(law: Bank, bank: BankBelief, memory: Memory) -> tuple[BankBelief, Memory]:
    """Return bank and trial after a gap of which the applied power is not known."""
    rival = memory.rival
    after = memory if rival is None else replace(memory, rival=law.lost(rival), held=None)
    return law.lost(bank), after


def _judged(bank: BankBelief, memory: Memory) -> tuple[BankBelief, Memory]:
    """Return the bank to go on with, and the trial, over or not."""
    rival, odds, heard_s = memory.rival, memory.odds, memory.heard_s
    if rival is None or bank.outlook is None:
        return bank, memory
    enough_s = max(HEARD_S, HEARD_LAGS * bank.outlook.lag_s)
    if odds < DROP_ODDS or (odds < 0.0 and heard_s >= enough_s):
        return rival, Memory(None, None, odds, heard_s, DROPPED, _words(odds, heard_s))
    if heard_s >= enough_s:
        return bank, Memory(None, None, odds, heard_s, TRUSTED, _words(odds, heard_s))
    return bank, memory


def _words(odds: float, heard_s: float) -> str:
    """Return how much better which of the two foresaw the readings."""
    after = f"after {heard_s:.0f} s of changing power"
    if abs(odds) < _EVEN_ODDS:
        as_well = "no better than" if odds < 0.0 else "as well as"
        return f"the stored model foresees {as_well} one that knew nothing, {after}"
    times = f"{math.exp(min(abs(odds), _SAID_ODDS)):,.0f}"
    more = "more than " if abs(odds) > _SAID_ODDS else ""
    return f"{more}{times} to 1 {'for' if odds > 0.0 else 'against'} the stored model {after}"
