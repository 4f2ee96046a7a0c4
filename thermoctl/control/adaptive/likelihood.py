"""The likelihood of a reading, by the belief before it was seen.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math

import numpy as np

from thermoctl.control.adaptive.bank_belief import BankBelief, Prediction
from thermoctl.control.adaptive.evidence import Weights
from thermoctl.control.adaptive.filters import Block, X, Z
from thermoctl.quantities import Array


def of_reading(
    belief: BankBelief, ahead: Prediction, y_c: float, weights: Weights, most_sds: float
) -> tuple[float, Weights]:
    r"""Return the log likelihood of `y_c`, and what it leaves of the weights.

    It is that of the hypotheses together, with these weights and without a constant:
    :math:`\ln \sum_j w_j \, S_j^{-1/2} e^{-\min(\nu_j^2/S_j,\,m^2)/2}`, where m is `most_sds`.
    Where nothing was foreseen, or `y_c` is NaN, it is 0.
    """
    surprises = _surprises(ahead, y_c, belief.noise.believed)
    if surprises is None:
        return 0.0, weights
    nis, S = surprises
    nis = np.minimum(nis, most_sds**2)
    log = weights.log - 0.5 * (np.log(S) + nis)
    most = float(log.max())
    told = most + math.log(float(np.exp(log - most).sum() * weights.share.max()))
    return told, weights.after(1.0, nis, S)


def foreseen(weights: Weights, ahead: Prediction, y_c: float, R: float, most_sds: float) -> bool:
    """Return whether the hypothesis that is likeliest once `y_c` counts foresaw it.

    That is to within `most_sds` standard deviations; `R` is the variance of the noise. Before any
    evidence all are equal, and none did.
    """
    surprises = _surprises(ahead, y_c, R)
    if surprises is None or not weights.log.any():
        return False
    nis, S = surprises
    return nis.item(weights.after(1.0, nis, S).likeliest) <= most_sds**2


def misled(belief: BankBelief, block: Block | None, y_c: float, most_sds: float) -> bool:
    """Return whether the first reading was wrong: the second, `y_c`, is far from it.

    Nothing was there to hold the first against, and what it is missed by would pass for gain. Once
    is enough: a plant that does move as fast goes on from the second reading.
    """
    if block is None or belief.sample != belief.blind:
        return False
    m = belief.weights.likeliest
    nu, S_m = y_c - float(block[Z, X, m]), float(block[Z, Z, m]) + belief.noise.believed
    return nu * nu > most_sds**2 * S_m


def _surprises(ahead: Prediction, y_c: float, R: float) -> tuple[Array, Array] | None:
    """Return the innovations squared over their variances, and these; None where there are none."""
    full, x, gains = ahead.full, ahead.x, ahead.gains
    if full is None or x is None or not math.isfinite(y_c):
        return None
    nu = y_c - x[Z]
    S = full[Z, Z] + R if gains is None else gains.S
    return nu * nu / S, S
