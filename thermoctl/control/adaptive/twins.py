"""Two beliefs of a plant just met, one at rest and one long under full power.

Both see the same readings, and their log odds say which leads. After some time it goes on alone.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math

from thermoctl.control.adaptive import likelihood
from thermoctl.control.adaptive.bank_belief import BankBelief, Prediction, Twin
from thermoctl.control.adaptive.constants import Hearing
from thermoctl.quantities import clamp

ONSET_SAMPLES = 10
"""Least number of samples that tell whether the plant was met at rest."""


def led(
    belief: BankBelief,
    ahead: Prediction,
    y_c: float,
    corrected: tuple[BankBelief, BankBelief],
    hearing: Hearing,
    period_s: float,
) -> BankBelief:
    """Return the belief that leads, and for some time the other with it.

    Parameters
    ----------
    belief, ahead : BankBelief, Prediction
        The one that led before the reading `y_c`, and what it predicted; both with their twins.
    y_c : float
        Reading in degC; NaN when there is none.
    corrected : tuple of BankBelief
        What the reading has made of the two, that of `belief` first.
    hearing, period_s : Hearing, float
        Of the bank.
    """
    twin, (after, other), most_sds = belief.twin, corrected, hearing.gate_sds
    assert twin is not None
    assert ahead.twin is not None
    alone, weights = likelihood.of_reading(belief, ahead, y_c, twin.beside, most_sds)
    told, others = likelihood.of_reading(twin.belief, ahead.twin, y_c, twin.weights, most_sds)
    for_heat = told - alone if twin.heated else alone - told
    odds = twin.odds + clamp(for_heat, -hearing.onset_most, hearing.onset_most)
    heat_leads = odds > hearing.onset_odds
    if heat_leads == twin.heated:
        after, other, weights, others = other, after, others, weights
    n = after.sample
    if n >= ONSET_SAMPLES and n * period_s >= hearing.onset_s:
        return after._replace(twin=None)
    return after._replace(twin=Twin(other, odds, not heat_leads, others, weights))


def log_likelihood(belief: BankBelief, ahead: Prediction, y_c: float, hearing: Hearing) -> float:
    """Return the log likelihood of `y_c` by both twins, as likely as each is."""
    twin = belief.twin
    assert twin is not None
    assert ahead.twin is not None
    of, most_sds = twin.belief, hearing.gate_sds
    alone = likelihood.of_reading(belief, ahead, y_c, belief.weights, most_sds)[0]
    other = likelihood.of_reading(of, ahead.twin, y_c, of.weights, most_sds)[0]
    odds = twin.odds - hearing.onset_odds  # beyond it there was heat
    share = 0.5 * (1.0 + math.tanh(0.5 * (odds if twin.heated else -odds)))
    most = max(alone, other)
    return most + math.log((1.0 - share) * math.exp(alone - most) + share * math.exp(other - most))
