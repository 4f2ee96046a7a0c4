"""What of a bank outlives a restart, and how firmly it is believed then.

Gain, loss, noise and the weights of the hypotheses are worth keeping: they belong to the plant. So
is the coldest that was read, for its surroundings are no warmer. Where the water was, and which
power was on its way, are not. As plants change while nobody looks, gain and loss come back less
certain than they were left, and the weights closer together. What comes back is on trial anyway
(`thermoctl.control.adaptive.trial`).

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from thermoctl.control.adaptive.bank import Bank
from thermoctl.control.adaptive.bank_belief import BankBelief
from thermoctl.control.adaptive.evidence import FLOOR, Noise, weighted
from thermoctl.control.adaptive.filters import (
    GAIN_LEAST,
    LOSS_MAX,
    LOSS_MIN,
    Prior,
)
from thermoctl.control.adaptive.hypotheses import SHAPES
from thermoctl.control.adaptive.plant_belief import plant_belief
from thermoctl.quantities import Array, is_finite_number
from thermoctl.ranges import number

KNOWN_SHARE = 0.25
"""Largest standard deviation of a gain that is worth keeping, as a share of it."""

GAIN_SHARE = 0.2
"""Least standard deviation of a recalled gain, as a share of it: water is added and taken."""
LOSS_SHARE = 0.05
"""Least standard deviation of a recalled loss, as a share of the gain: it depends on temperature
and surroundings. With twice as much, the loss takes the blame for a gain that is too high."""
LOSING = 0.3
"""Share of what a lasting loss makes the sensor lag by, where power was none or full: the plant may
have been so for long, or for the seconds of a restart. With 1 hot air overshoots after 20 s without
power, with 0 after 60."""
DOUBLED_S = 14 * 86400.0
"""Age in s at which the variance of the gain is twice as large; it grows in proportion to the
age."""
WEIGHT_POWER = 0.5
"""Power to which recalled weights are raised: half as telling."""
WEIGHT_FLOOR = -5.0
"""Least log weight that is recalled: a few samples bring every hypothesis back."""

NOISE_MAX_K2 = 100.0
MOST_C = 3000.0
"""Most that a sensor reads; of coolers temperatures are negated."""
_DIGITS = 5


def remember(bank: Bank, belief: BankBelief) -> dict[str, Any] | None:
    """Return what is worth keeping, as plain numbers; None until the gain is known."""
    plant = plant_belief(bank, belief)
    if plant is None:
        return None
    rate, rate_sd = plant.gain_k_per_s, plant.gain_sd_k_per_s
    if not (rate > GAIN_LEAST and rate_sd <= KNOWN_SHARE * rate):
        return None
    coldest_c = belief.noise.coldest_c
    return {
        "period_s": bank.period_s,
        "u_min": bank.u_min,
        "hypotheses": _hypotheses(bank),
        "gain_k_per_s": _rounded(rate),
        "gain_sd_k_per_s": _rounded(rate_sd),
        "loss_k_per_s": _rounded(plant.loss_k_per_s),
        "loss_sd_k_per_s": _rounded(plant.loss_sd_k_per_s),
        "noise_variance_k2": _rounded(belief.noise.variance),
        "coldest_c": _rounded(coldest_c) if math.isfinite(coldest_c) else None,
        "log_weights": [_rounded(each) for each in belief.weights.log.tolist()],
    }


def recalled(bank: Bank, remembered: Mapping[str, Any], age_s: float) -> BankBelief:
    """Return the belief before the first sample, with what was remembered.

    Raises
    ------
    ValueError
        It is of another bank, or no plant could be like that; the text says what was expected.
    """
    of = {"period_s": bank.period_s, "u_min": bank.u_min, "hypotheses": _hypotheses(bank)}
    for name, expected in of.items():
        if remembered.get(name) != expected:
            raise ValueError(f"expected {name} {expected!r}, got {remembered.get(name)!r}")
    gain_max = bank.plants.heat_max_k / bank.lags.shortest_s
    rate = number(remembered, "gain_k_per_s", GAIN_LEAST, gain_max)
    rate_sd = number(remembered, "gain_sd_k_per_s", 0.0, KNOWN_SHARE * rate)
    lost = number(remembered, "loss_k_per_s", (bank.u_min - LOSS_MIN) * rate, LOSS_MAX * rate)
    lost_sd = number(remembered, "loss_sd_k_per_s", 0.0, gain_max)
    variance = number(remembered, "noise_variance_k2", 0.0, NOISE_MAX_K2)
    coldest_c = math.inf
    if remembered.get("coldest_c") is not None:  # files of older versions have none
        coldest_c = number(remembered, "coldest_c", -MOST_C, MOST_C)
    log = _log_weights(remembered, len(bank.hypotheses))
    aged = math.sqrt(1.0 + max(age_s, 0.0) / DOUBLED_S)
    prior = Prior(
        rate,
        aged * max(rate_sd, GAIN_SHARE * rate),
        lost,
        max(lost_sd, LOSS_SHARE * rate),
        losing=LOSING,
    )
    weights = weighted(np.maximum(WEIGHT_POWER * log, WEIGHT_FLOOR))
    return bank.start(prior, Noise(variance, coldest_c=coldest_c), weights)


def _hypotheses(bank: Bank) -> dict[str, Any]:
    """Return which hypotheses there are; weights of others would say nothing of these."""
    lags = bank.lags
    return {
        "shortest_lag_s": lags.shortest_s,
        "longest_over_shortest": lags.longest_s / lags.shortest_s,
        "lags": lags.count,
        "shapes": [list(shape) for shape in SHAPES],
        "pipe_beyond_s": lags.pipe_beyond_s,
    }


def _log_weights(remembered: Mapping[str, Any], n: int) -> Array:
    """Return the log weights, shape (n,): the greatest is 0, none below the floor."""
    told = remembered.get("log_weights")
    if not (isinstance(told, list) and len(told) == n and all(map(is_finite_number, told))):
        raise ValueError(f"expected log_weights, {n} finite numbers, got {told!r}")
    log = np.array(told, dtype=float)
    if not (log.max() == 0.0 and log.min() >= FLOOR):
        raise ValueError(
            f"expected log_weights from {FLOOR:g} to 0, the greatest being 0, got"
            f" {log.min():g} to {log.max():g}"
        )
    return log


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
