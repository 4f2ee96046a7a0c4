"""What a change amounts to, in words: kelvin, heat, water, ice, watts."""

from __future__ import annotations

import math

from thermoctl.insight import physics
from thermoctl.insight.changes import Found
from thermoctl.insight.drifts import Compared
from thermoctl.insight.values import Change
from thermoctl.insight.wording import number, plain
from thermoctl.quantities import Uncertain

_SIGMAS = 2.0


def change_of(found: Found, gain: Uncertain, heater_w: float | None) -> Change:
    """Return a change of the balance as it is told.

    Parameters
    ----------
    found : Found
        What was found.
    gain : Uncertain
        Heating rate at full power in K/s; NaN: unknown.
    heater_w : float or None
        Rated power of the heater in W.
    """
    capacity = None
    if heater_w is not None and math.isfinite(gain.mean):
        capacity = physics.capacity_j_per_k(heater_w, gain.mean)
    if found.step_k is not None and found.step_sd_k is not None:
        return _step(found, Uncertain(found.step_k, found.step_sd_k), capacity)
    slope = Uncertain(found.slope_k_per_s or 0.0, found.slope_sd_k_per_s or 0.0)
    return _slope(found.t_s, slope, capacity)


def _step(found: Found, step: Uncertain, capacity: float | None) -> Change:
    fell = step.mean < 0.0
    size = Uncertain(abs(step.mean), step.sd)
    words = f"step {'loss' if fell else 'gain'} of {number(size.mean, size.sd)} K"
    heat_j = None
    if capacity is not None:
        heat_j = capacity * step.mean
        words += f", {plain(abs(heat_j) / 1e3)} kJ"
    if fell:
        words += _equivalent(size.mean, found.before_c, capacity)
    kind = "step.loss" if fell else "step.gain"
    return Change(found.t_s, kind, step.mean, _SIGMAS * step.sd, "K", words, heat_j)


def _equivalent(fall_k: float, before_c: float, capacity: float | None) -> str:
    """Return how much cold water, or ice, a fall amounts to."""
    if capacity is None:
        return ""
    cold = physics.cold_water_kg(capacity, fall_k, before_c)
    ice = physics.ice_kg(capacity, fall_k, before_c)
    each = [
        f"{plain(kg, 1 if kg >= 1.0 else 2)} kg of {what}"
        for kg, what in ((cold, f"water of {plain(physics.COLD_C)} °C"), (ice, "ice"))
        if kg is not None
    ]
    return f", about {' or '.join(each)}" if each else ""


def _slope(t_s: float, slope: Uncertain, capacity: float | None) -> Change:
    up = slope.mean < 0.0
    per_min = slope.scaled(60.0)
    size = number(abs(per_min.mean), per_min.sd)
    words = f"loss {'up' if up else 'down'} by {size} K/min"
    if capacity is not None:
        words += f", {plain(abs(slope.mean) * capacity)} W"
    kind = "loss.up" if up else "loss.down"
    return Change(t_s, kind, per_min.mean, _SIGMAS * per_min.sd, "K/min", words)


def change_of_gain(t_s: float, compared: Compared) -> Change:
    """Return a change of the gain as it is told.

    Parameters
    ----------
    t_s : float
        When the move began in which it was first seen.
    compared : Compared
        The gain before and now.
    """
    share = 100.0 * compared.share
    sd = 100.0 * abs(compared.now.mean / compared.before.mean) * _relative_sd(compared)
    way = "up" if share > 0.0 else "down"
    words = f"gain {way} by {number(abs(share), sd)} %, seen when the loop was moved"
    return Change(t_s, f"gain.{way}", share, _SIGMAS * sd, "%", words)


def _relative_sd(compared: Compared) -> float:
    before, now = compared.before, compared.now
    return float(((before.sd / before.mean) ** 2 + (now.sd / now.mean) ** 2) ** 0.5)


def dilution(found: Found) -> float:
    """Return how much cold water a step would be, as a share of what was there."""
    fall_k = -(found.step_k or 0.0)
    left_k = found.before_c - fall_k - physics.COLD_C
    return fall_k / left_k if fall_k > 0.0 and left_k > 0.0 else 0.0


def jump_at(t_s: float) -> Change:
    """Return a jump of the readings that nobody could measure."""
    words = "the readings jumped while the loop moved: heat came or went, or the gain is another"
    return Change(t_s, "jump", None, None, "K", words)
