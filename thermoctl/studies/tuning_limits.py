r"""Limits that suit a plant, from what a run has taught of it.

Full power P heats at the rate k, and what was given during the last lag L has not been read yet: so
much is stored, whatever happens,

.. math:: s = k P L

All is computed with the upper bounds of gain and lag. Explained in ``docs/tune.md``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from thermoctl.regulator.limits import command_lasts_s
from thermoctl.studies.tuning import Tuning
from thermoctl.studies.words import duration

TRIP_STORED, TRIP_SPARE_K, TRIP_MIN_K = 2.0, 1.0, 2.0
"""A trip lies above all that is set by twice what is stored and a kelvin, two kelvin at least."""
TRIP_FAR = 3.0
"""One that is farther than so many times that protects late."""
JUMP_RISES, JUMP_SD, JUMP_USUAL_K = 2.0, 6.0, 1.0
"""A reading may be off by two rises in a period and six deviations, and by a kelvin anyway."""
PERIOD_LONG, PERIOD_GOOD = 3.0, 5.0
"""A lag holds three periods at least, five are good."""
RISE_LAGS = 2.0
"""A rise to full power within half a lag costs nothing that could be seen."""
RUNAWAY_K = 5.0
"""With the trip as the last limit, the water goes no farther beyond it than this."""
HOLDING_SPARE = 2.0
"""The most power is at least so many times the one that holds."""


@dataclass(frozen=True, slots=True)
class InForce:
    """What is configured now.

    Parameters
    ----------
    setpoint_c, highest_setpoint_c : float
        Set point, and the highest that an operator may ask for.
    trip_above_c, power_max : float
        As configured.
    jump_k, rise_per_s, dead_man_s : float or None
        As configured; None where it is not.
    """

    setpoint_c: float
    highest_setpoint_c: float
    trip_above_c: float
    power_max: float
    jump_k: float | None = None
    rise_per_s: float | None = None
    dead_man_s: float | None = None


@dataclass(frozen=True, slots=True)
class Proposal:
    """One limit.

    Parameters
    ----------
    key : str
        Its name in the configuration.
    value, now : float or None
        What is proposed, and what is configured; None: to be left out.
    change : bool
        Whether what is configured should be changed.
    why : str
        The reasoning, in a sentence.
    """

    key: str
    value: float | None
    now: float | None
    change: bool
    why: str


@dataclass(frozen=True, slots=True)
class _Plant:
    """The upper bounds of a plant, in SI, and its mean lag.

    `noise_k` is how well one sample ahead is foreseen.
    """

    slope: float
    lag_s: float
    mean_lag_s: float
    holding_power: float
    noise_k: float
    period_s: float


def proposed(tuning: Tuning, now: InForce) -> tuple[Proposal, ...]:
    """Return the limits that the plant has a say in; none where it was not heard."""
    words = tuning.words
    if words is None:
        return ()
    noise_k = tuning.score.rms_error
    plant = _Plant(
        slope=(words.gain_k_per_min.high or words.gain_k_per_min.value) / 60.0,
        lag_s=max(words.lag_s.high or words.lag_s.value, 0.5 * tuning.record.period_s),
        mean_lag_s=max(words.lag_s.value, 0.5 * tuning.record.period_s),
        holding_power=max(words.holding_power.high or words.holding_power.value, 0.0),
        noise_k=noise_k if math.isfinite(noise_k) else 0.0,
        period_s=tuning.record.period_s,
    )
    return tuple(_limits(plant, now))


def _limits(plant: _Plant, now: InForce) -> Iterator[Proposal]:
    yield _trip(plant, now)
    yield _jump(plant, now)
    yield _period(plant)
    yield _power(plant, now)
    yield _rise(plant, now)
    yield _dead_man(plant, now)


def _trip(plant: _Plant, now: InForce) -> Proposal:
    rate = plant.slope * now.power_max
    stored_k, late_s = rate * plant.lag_s, plant.lag_s + 2.0 * plant.period_s
    margin_k = max(TRIP_STORED * stored_k + TRIP_SPARE_K, TRIP_MIN_K)
    top_c = now.highest_setpoint_c
    if not top_c < now.trip_above_c:  # nothing but the trip limits set points
        top_c = now.setpoint_c
    value_c = math.ceil(2.0 * (top_c + margin_k)) / 2.0
    fits = value_c <= now.trip_above_c <= top_c + max(TRIP_FAR * margin_k, value_c - top_c)
    why = (
        f"{stored_k:.2g} K are stored in element and sensor at full power; twice that and"
        f" {TRIP_SPARE_K:g} K above {top_c:g} °C. A heater that is stuck there is cut two readings"
        f" and a lag late: at {value_c + rate * late_s:.1f} °C"
    )
    return Proposal("trip_above_c", value_c, now.trip_above_c, not fits, why)


def _jump(plant: _Plant, now: InForce) -> Proposal:
    rise_k = plant.slope * now.power_max * plant.period_s
    least_k = JUMP_RISES * rise_k + JUMP_SD * plant.noise_k
    needed_k = math.ceil(10.0 * max(least_k, JUMP_USUAL_K)) / 10.0
    why = (
        f"full power rises {rise_k:.2g} K in a period, readings scatter by {plant.noise_k:.2g} K:"
        f" {least_k:.2g} K are no outlier"
    )
    if now.jump_k is None:
        return Proposal("jump_k", None, None, False, f"{why}; left out, it widens by itself")
    return Proposal("jump_k", needed_k, now.jump_k, now.jump_k < least_k, why)


def _period(plant: _Plant) -> Proposal:
    h, lag_s = plant.period_s, plant.mean_lag_s
    why = f"{lag_s / h:.3g} samples in a lag of {lag_s:.3g} s, expected {PERIOD_LONG:g} at least"
    if PERIOD_LONG * h <= lag_s:
        return Proposal("period_s", h, h, False, why)
    return Proposal("period_s", float(f"{max(lag_s / PERIOD_GOOD, 0.05):.1g}"), h, True, why)


def _power(plant: _Plant, now: InForce) -> Proposal:
    h = plant.period_s
    late_s = command_lasts_s(h) + plant.lag_s
    least = min(HOLDING_SPARE * plant.holding_power, 1.0)
    value = min(max(RUNAWAY_K / (plant.slope * late_s), least), 1.0)
    value = math.ceil(20.0 * value) / 20.0
    beyond_k = plant.slope * min(now.power_max, 1.0) * late_s
    why = (
        f"heat goes on for {late_s:.3g} s when the link is cut at full power, {beyond_k:.2g} K;"
        f" {RUNAWAY_K:g} are bearable, and {100.0 * plant.holding_power:.0f} % holds the set point"
    )
    short = now.power_max < min(HOLDING_SPARE * plant.holding_power, 1.0)
    return Proposal("power_max", value, now.power_max, now.power_max > value or short, why)


def _rise(plant: _Plant, now: InForce) -> Proposal:
    least = RISE_LAGS / plant.lag_s
    why = f"the plant answers {plant.lag_s:.3g} s late by itself, so there is nothing to soften"
    if now.rise_per_s is None or not math.isfinite(now.rise_per_s):
        return Proposal("rise_per_s", None, None, False, why)
    value = math.ceil(100.0 * least) / 100.0
    slower = now.rise_per_s < least
    why = (
        f"{1.0 / now.rise_per_s:.3g} s to full power beside a lag of {plant.lag_s:.3g} s; where the"
        " supply asks for no limit, leave it out"
    )
    return Proposal("rise_per_s", value, now.rise_per_s, slower, why)


def _dead_man(plant: _Plant, now: InForce) -> Proposal:
    value_s = math.ceil(round(10.0 * command_lasts_s(plant.period_s), 6)) / 10.0
    lasts_s = value_s if now.dead_man_s is None else now.dead_man_s
    rise_k = plant.slope * now.power_max * lasts_s
    why = (
        f"a command is valid for {duration(value_s)}; full power for {duration(lasts_s)} without"
        f" anybody there is {rise_k:.2g} K"
    )
    known = now.dead_man_s is not None
    return Proposal("dead_man_s", value_s, now.dead_man_s, known and lasts_s > 2.0 * value_s, why)
