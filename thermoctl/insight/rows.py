"""The plant in physical words, a row each, with error bars.

Explained in ``docs/insight.md``.
"""

from __future__ import annotations

import math

from thermoctl.insight import physics
from thermoctl.insight.told_gain import is_seen
from thermoctl.insight.values import Row
from thermoctl.insight.wording import UNKNOWN, number, plain
from thermoctl.quantities import Uncertain
from thermoctl.signals import PlantBelief

NO_HEATER = "heater_w is not configured"
NOT_YET = "not known yet"
HIDDEN = "the noise hides the lag"
_SIGMAS = 2.0

VAGUE_POWER = 0.5
"""Error bar of a holding power, as a fraction of full power, beyond which it is not known."""

VAGUE_LAG = 10.0
"""Ratio of the quantiles of a lag from which on it is assumed and not learnt."""


_NOTHING = Uncertain()


def _sets_apart(gain: Uncertain) -> bool:
    """Return whether the gain differs from none by more than its error; NaN does not."""
    return abs(gain.mean) > _SIGMAS * gain.sd


def rows(
    plant: PlantBelief,
    gain: Uncertain,
    slope: Uncertain | None = None,
    heater_w: float | None = None,
) -> tuple[Row, ...]:
    """Return the plant in physical words.

    Parameters
    ----------
    plant : PlantBelief
        What is believed now.
    gain : Uncertain
        Heating rate at full power in K/s; of a time at which the power moved.
    slope : Uncertain, optional
        How the loss grows with the temperature, in 1/s.
    heater_w : float, optional
        Rated power of the heater in W.

    Notes
    -----
    What is no better known than before the first sample has no value: a gain within its own error
    of none, a power to hold to `VAGUE_POWER`, a lag to `VAGUE_LAG` or one that cannot be seen.
    """
    gain = gain if _sets_apart(gain) else _NOTHING
    why = NOT_YET if is_seen(plant) else HIDDEN
    holding = Uncertain(plant.holding_power, plant.holding_power_sd)
    loss = _loss(plant, gain)
    if _SIGMAS * holding.sd > VAGUE_POWER:
        holding = loss = _NOTHING
    return (
        _row("gain", "gain", gain.scaled(60.0), "K/min", why),
        _row("loss", "loss", loss.scaled(60.0), "K/min", why),
        _row("holding_power", "holds with", holding.scaled(100.0), "%"),
        _lag(plant),
        Row(
            "noise",
            "noise",
            1e3 * plant.noise_sd_k,
            None,
            "mK",
            f"{plain(1e3 * plant.noise_sd_k)} mK",
        ),
        *_of_heater(gain, holding, slope, heater_w, why),
    )


def _loss(plant: PlantBelief, gain: Uncertain) -> Uncertain:
    """Return the loss in K/s: the bank knows it as a share of its own gain, not of the one told."""
    loss = Uncertain(plant.loss_k_per_s, plant.loss_sd_k_per_s)
    if math.isnan(gain.mean):
        return loss if is_seen(plant) else _NOTHING
    told = loss.scaled(gain.mean / plant.gain_k_per_s)
    return Uncertain(told.mean, math.hypot(told.sd, told.mean * gain.sd / gain.mean))


def _lag(plant: PlantBelief) -> Row:
    if not (plant.lag_high_s < VAGUE_LAG * plant.lag_low_s and is_seen(plant)):
        return _unknown("lag", "lag", "s", NOT_YET if is_seen(plant) else HIDDEN)
    low, high = plain(plant.lag_low_s), plain(plant.lag_high_s)
    text = f"{plain(plant.lag_s)} s, between {low} and {high}"
    return Row("lag", "lag", plant.lag_s, None, "s", text, plant.lag_low_s, plant.lag_high_s)


def _of_heater(
    gain: Uncertain,
    holding: Uncertain,
    slope: Uncertain | None,
    heater_w: float | None,
    why: str,
) -> tuple[Row, ...]:
    """Return the rows that need the rated power of the heater."""
    names = (("volume", "water", "l"), ("loss_w", "loss", "W"), ("loss_w_per_k", "loss", "W/K"))
    if heater_w is None or not gain.mean > 0.0:
        learnt = why if math.isnan(gain.mean) else "power cools"
        why = NO_HEATER if heater_w is None else learnt
        return tuple(_unknown(*each, why) for each in names)
    one = Uncertain(physics.litres(heater_w), 0.0)
    capacity = Uncertain(heater_w, 0.0).over(gain)
    if slope is None:
        per_k = _unknown(*names[2], "the temperature has not moved far enough")
    else:
        product = capacity.mean * slope.mean
        shares = math.hypot(slope.sd / slope.mean, capacity.sd / capacity.mean)
        per_k = _row(*names[2][:2], Uncertain(product, product * shares), names[2][2])
    return (
        _row("volume", "water", one.over(gain), "l"),
        _row("loss_w", "loss", holding.scaled(heater_w), "W"),
        per_k,
    )


def _row(name: str, label: str, known: Uncertain, unit: str, why: str = NOT_YET) -> Row:
    if not (math.isfinite(known.mean) and math.isfinite(known.sd)):
        return _unknown(name, label, unit, why)
    text = f"{number(known.mean, known.sd)} {unit}"
    return Row(name, label, known.mean, _SIGMAS * known.sd, unit, text)


def _unknown(name: str, label: str, unit: str, why: str) -> Row:
    return Row(name, label, None, None, unit, f"{UNKNOWN} {why}")
