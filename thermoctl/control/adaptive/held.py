"""A remembered bank from one more past: the plant was held until just now.

A loop that is started anew within seconds finds its plant neither without power nor under full
power, but under the power that holds it. Heat of just that is under way, and the plant loses what
it lost when it was left. So a remembered bank is begun from this past as well, and every reading is
evidence for it or for the other two, `thermoctl.control.adaptive.twins`. When time is up for these,
the better one goes on alone. A bank that remembers nothing knows of no such power.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from thermoctl.control.adaptive.bank import Bank
from thermoctl.control.adaptive.bank_belief import BankBelief
from thermoctl.quantities import clamp


class Held(NamedTuple):
    """The remembered bank from the past that does not lead.

    Parameters
    ----------
    belief : BankBelief
        What it believes.
    odds : float
        Natural logarithm of the odds that the plant was held.
    aside : bool
        Whether it is `belief` that was.
    """

    belief: BankBelief
    odds: float = 0.0
    aside: bool = False


def begun(law: Bank, bank: BankBelief) -> tuple[BankBelief, Held]:
    """Return the recalled `bank` under holding power, and itself beside that."""
    prior = bank.prior
    held = law.under(bank, prior.loss / prior.gain)
    return held._replace(prior=prior._replace(losing=1.0)), Held(bank)


def observed(
    law: Bank, bank: BankBelief, beside: Held, y_c: float, applied: float
) -> tuple[BankBelief, Held | None, float]:
    """Return what leads after `applied` and `y_c`, what does not, and a likelihood.

    That is the log likelihood of `y_c` by both, as far as each is likely; the one that does not
    lead is None once it is settled which of them goes on.
    """
    both = (beside.belief, bank) if beside.aside else (bank, beside.belief)
    (held, by_held), (free, by_free) = (seen(law, each, y_c, applied) for each in both)
    share, most = 0.5 * (1.0 + math.tanh(0.5 * beside.odds)), max(by_held, by_free)
    likelihood = share * math.exp(by_held - most) + (1.0 - share) * math.exp(by_free - most)
    onset_most = law.hearing.onset_most
    odds = beside.odds + clamp(by_held - by_free, -onset_most, onset_most)
    aside = odds < 0.0
    leads, other = (free, held) if aside else (held, free)
    rest = None if free.twin is None else Held(other, odds, aside)
    return leads, rest, most + math.log(likelihood)


def seen(law: Bank, belief: BankBelief, y_c: float, applied: float) -> tuple[BankBelief, float]:
    """Return the belief after `y_c`, and the log likelihood of `y_c` before it."""
    ahead = law.predict(belief, applied)
    return law.correct(belief, ahead, y_c), law.log_likelihood(belief, ahead, y_c)
