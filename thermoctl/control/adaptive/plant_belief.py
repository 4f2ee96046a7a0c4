"""What the bank believes of its plant, in words for people.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math

import numpy as np

from thermoctl.control.adaptive.bank import Bank
from thermoctl.control.adaptive.bank_belief import BankBelief
from thermoctl.control.adaptive.filters import BETA, D, X
from thermoctl.control.adaptive.hypotheses import SHAPES
from thermoctl.signals import PlantBelief

LAG_QUANTILES = (0.05, 0.95)


def plant_belief(bank: Bank, belief: BankBelief, sign: float = 1.0) -> PlantBelief | None:
    """Return what is believed of the plant; None before the first valid reading.

    Parameters
    ----------
    bank, belief : Bank, BankBelief
        The law and what it believes.
    sign : float
        -1 where temperatures were negated because power cools.
    """
    if belief.full is None or belief.outlook is None:
        return None
    outlook = belief.outlook
    _, gain_sd = gain(bank, belief)
    loss_rate, loss_sd = loss(bank, belief)
    low_s, high_s = lag_quantiles(bank, belief)
    return PlantBelief(
        gain_k_per_s=sign * outlook.gain,
        gain_sd_k_per_s=gain_sd,
        loss_k_per_s=sign * loss_rate,
        loss_sd_k_per_s=loss_sd,
        holding_power=outlook.holding_power,
        holding_power_sd=holding_power_sd(belief),
        lag_s=outlook.lag_s,
        lag_low_s=low_s,
        lag_high_s=high_s,
        coasting_c=sign * outlook.coasting_c,
        noise_sd_k=math.sqrt(belief.noise.variance),
        learning=belief.heard > 0.0,
        jumped=belief.gate.jumped,
    )


def loss(bank: Bank, belief: BankBelief) -> tuple[float, float]:
    """Return the loss in K/s with its standard deviation, after the first reading."""
    return _mixed(bank, belief, D)


def gain(bank: Bank, belief: BankBelief) -> tuple[float, float]:
    """Return the gain in K/s with its standard deviation, after the first reading."""
    return _mixed(bank, belief, BETA)


def holding_power_sd(belief: BankBelief) -> float:
    """Return the standard deviation of the holding power d/beta, by linearisation."""
    block, share = belief.block, belief.weights.share
    assert block is not None
    beta = block[BETA, X]
    power = block[D, X] / beta
    squares = block[BETA, BETA] * power
    squares -= 2.0 * block[D, BETA]
    squares *= power
    squares += block[D, D]
    squares /= beta
    squares /= beta
    squares += power * power
    return _spread(float(share.dot(squares)), float(share.dot(power)))


def _mixed(bank: Bank, belief: BankBelief, state: int) -> tuple[float, float]:
    """Return mean and standard deviation of a rate over the hypotheses, in K/s."""
    block, share = belief.block, belief.weights.share
    assert block is not None
    each = block[state, X]
    mean = float(share.dot(each))
    squares = float(share.dot(each * each + block[state, state]))
    return mean / bank.period_s, _spread(squares, mean) / bank.period_s


def _spread(squares: float, mean: float) -> float:
    """Return the standard deviation of a mixture from its mean square and its mean."""
    return math.sqrt(max(squares - mean * mean, 0.0))


def lag_quantiles(bank: Bank, belief: BankBelief) -> tuple[float, float]:
    """Return the lags below which 5 % and 95 % of the weight lie.

    A hypothesis stands for all lags up to half-way to its neighbours, on a scale of ratios: the
    grid cannot tell them apart.
    """
    weight = belief.weights.share.reshape(-1, len(SHAPES)).sum(axis=1)
    below = np.concatenate(((0.0,), np.cumsum(weight)))
    log_lag = np.log(bank.hypotheses.lag_s.reshape(-1, len(SHAPES))[:, 0])
    step = log_lag[1] - log_lag[0]
    edges = np.append(log_lag - 0.5 * step, log_lag[-1] + 0.5 * step)
    low, high = np.exp(np.interp(LAG_QUANTILES, below / below[-1], edges)).tolist()
    return low, high
