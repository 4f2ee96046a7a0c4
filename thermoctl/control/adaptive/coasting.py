r"""Where the water would come to rest, and the power that follows from it.

.. math::

    T_\infty = T + \beta\,\Bigl[t_1 (q - u_{ss}) + h \sum_{i=0}^{n_d-1} (u_{k-1-i} - u_{ss})\Bigr],
    \qquad v = u_{ss} + \frac{r - T_\infty - \beta\,\tau\,(u_{k-1} - u_{ss})}{\beta\, T_c},
    \qquad u = u_{k-1} + \frac{h}{h + \tau}\,(v - u_{k-1})

All heat that is still under way is in :math:`T_\infty`, taken from the power that was applied. So
there is nothing to wind up, full power lasts until the last moment, and whoever steered before, the
law goes on without a bump. The power follows v with the lag :math:`\tau`, which is heat under way
like any other: the temperature is led to the set point as without it, and by far less travel.

On a ramp :math:`r + \rho t` the power to rest with is :math:`u_{ss} + \rho/\beta` instead: with it
from now on the water comes to lie on the line :math:`T_\infty - \rho\,(t_1 + h n_d) + \rho t`, and
the reading on one that is later by the lag of the sensor. That line shall be the ramp. Hence, with
the total lag :math:`\lambda` and for a power without a lag of its own,

.. math:: u = u_{ss} + \frac{\rho}{\beta} + \frac{r + \rho\,\lambda - T_\infty}{\beta\, T_c},

which is the law above for where the ramp will be when the heat of now is read. So the reading is on
the ramp and the water ahead of it. The other way round would be better, but no power tells the lag
of a sensor from that of a heater, and the error would be what the one is taken for the other.

What acts may be a block that comes down with a time constant :math:`\tau_b` when power is taken
back. Power above the resting one then brings :math:`\beta\,\tau_b\,(u - u_{ss})` more than it does
while it lasts. That has to fit into the error too: on the way up :math:`T_c + \tau_b` stands for
:math:`T_c` in it, and a power that is to come down does so without the lag :math:`\tau`.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from thermoctl.control.adaptive.constants import Pace
from thermoctl.control.adaptive.filters import BETA, Block, D, PerPeriod, T, X
from thermoctl.control.adaptive.hypotheses import Hypotheses
from thermoctl.control.adaptive.path import Path
from thermoctl.quantities import Array, clamp

USUAL = Pace()


class Outlook(NamedTuple):
    """What the bank as a whole expects: means over the hypotheses, weighted.

    Parameters
    ----------
    coasting_c : float
        Where the water would come to rest with holding power from now on.
    holding_power : float
        Power that makes up for the loss, within the bounds of power.
    lag_s : float
        Total lag.
    gain : float
        Heating rate at full power in K/s.
    heater_k : float
        What the heater keeps back at full power, in K of the water.
    surplus : float
        Power that reaches the water, less the holding power.
    spread_k : float
        Standard deviation of `coasting_c` among the hypotheses.
    gain_sd : float
        Standard deviation of the gain, as each of them has it.
    lag_sd_s : float
        Standard deviation of the lag among the hypotheses.
    lag_harmonic_s : float
        Harmonic mean of the lag.
    """

    coasting_c: float
    holding_power: float
    lag_s: float
    gain: float
    heater_k: float = 0.0
    surplus: float = 0.0
    spread_k: float = 0.0
    gain_sd: float = 0.0
    lag_sd_s: float = 0.0
    lag_harmonic_s: float = 0.0


def outlook(
    block: Block, path: Path, share: Array, hypotheses: Hypotheses, constants: PerPeriod
) -> Outlook:
    """Return the means over the hypotheses, weighted by `share`."""
    h, mean, beta = hypotheses.period_s, share.dot, block[BETA, X]
    coasting_c, holding_power, surplus, spread_k = _coming(
        block[:, X], path, share, hypotheses, constants
    )
    lag_s = float(mean(hypotheses.lag_s))
    return Outlook(  # in the order of its fields: by their names it would take twice as long
        coasting_c,
        holding_power,
        lag_s,
        float(mean(beta)) / h,
        float(mean(hypotheses.element * beta)),
        surplus,
        spread_k,
        math.sqrt(float(mean(block[BETA, BETA]))) / h,
        math.sqrt(max(float(mean(hypotheses.lag_squared)) - lag_s * lag_s, 0.0)),
        1.0 / float(mean(hypotheses.lag_inverse)),
    )


def renewed(
    before: Outlook,
    x: Array,
    path: Path,
    share: Array,
    hypotheses: Hypotheses,
    constants: PerPeriod,
) -> Outlook:
    """Return the outlook from the states `x`; weights and P are as `before`."""
    coasting_c, holding_power, surplus, spread_k = _coming(x, path, share, hypotheses, constants)
    _, _, lag_s, gain, heater_k, _, _, gain_sd, lag_sd_s, lag_harmonic_s = before
    return Outlook(
        coasting_c,
        holding_power,
        lag_s,
        gain,
        heater_k,
        surplus,
        spread_k,
        gain_sd,
        lag_sd_s,
        lag_harmonic_s,
    )


def _coming(
    x: Array, path: Path, share: Array, hypotheses: Hypotheses, constants: PerPeriod
) -> tuple[float, float, float, float]:
    """Return what is new at every sample: coasting_c, holding_power, surplus and spread_k."""
    mean, d, beta = share.dot, x[D], x[BETA]
    holding = np.minimum(np.maximum(d / beta, constants.power_min), constants.power_max)
    coasting = path.under_way - hypotheses.held * holding
    coasting *= beta
    coasting += x[T]
    coasting_c, holding_power = float(mean(coasting)), float(mean(holding))
    coasting *= coasting
    variance = float(mean(coasting)) - coasting_c * coasting_c
    surplus = float(mean(path.heat)) - holding_power
    return coasting_c, holding_power, surplus, math.sqrt(0.0 if variance < 0.0 else variance)


def power_for(
    outlook: Outlook,
    setpoint_c: float,
    calmness: float,
    period_s: float,
    bounds: tuple[float, float],
    before: float,
    ramp_power: float = 0.0,
    pace: Pace = USUAL,
    kept_s: float = 0.0,
) -> float:
    """Return the power that lets the water come to rest at the set point within Tc.

    Parameters
    ----------
    outlook : Outlook
        What is expected.
    setpoint_c : float
        Where the water is to come to rest, in degC; on a ramp, that of `ahead`.
    calmness : float
        Tc as a share of the lag, unless that is hardly known.
    period_s : float
        Time between two samples.
    bounds : tuple of float
        Least and most power.
    before : float
        Power of the last period, as it was applied.
    ramp_power : float
        What lets the water rise with a ramp, beside the holding power.
    pace : Pace
        The constants of this law.
    kept_s : float
        Time constant with which what acts comes down when power is taken back.
    """
    floor_s = math.hypot(pace.lag_floor_s, pace.lag_floor_share * outlook.lag_s)
    doubt_k = outlook.gain * math.hypot(outlook.lag_sd_s, floor_s)
    heavy = clamp(doubt_k / pace.mistaken_k, 1.0, pace.calmer)
    fastest_s, Tc_s = pace.fastest_periods * period_s, calmness * heavy * outlook.lag_s
    fastest_s = pace.fastest_s if fastest_s < pace.fastest_s else fastest_s
    Tc_s = fastest_s if Tc_s < fastest_s else Tc_s
    tau_s = pace.smoothness * Tc_s
    resting = outlook.holding_power + ramp_power
    aim_c = outlook.coasting_c + outlook.gain * tau_s * (before - resting)
    surplus = outlook.surplus - ramp_power
    swing_k = outlook.gain * outlook.lag_s * (bounds[1] - bounds[0])
    aim_c += outlook.heater_k * (_counted(surplus, swing_k, pace) - surplus)
    error_k = _agreed(setpoint_c - aim_c, outlook.spread_k, bounds, pace)
    gain_sd, gain = outlook.gain_sd, outlook.gain
    vague = pace.vague_k_per_s if pace.vague_k_per_s < gain_sd else gain_sd
    vague -= pace.vague_share * gain
    gain = gain if vague < 0.0 else gain + vague
    keeps = kept_s > 0.0 and error_k > 0.0
    if keeps:  # power above the resting one is heat for as long as it takes to come down
        Tc_s += kept_s
    wanted = resting + error_k / (gain * Tc_s)
    power = before + (wanted - before) * period_s / (period_s + tau_s)
    if keeps:  # what comes down late is not told late as well
        power = min(power, wanted)
    return clamp(power, *bounds)


def _counted(surplus: float, swing_k: float, pace: Pace) -> float:
    """Return as how much a surplus of power in the heater counts.

    `swing_k` is what the whole range of power has under way within a lag; a cooler adds to it.
    """
    heavy, size = clamp(swing_k / pace.heavy_k, 1.0, pace.calmer), abs(surplus)
    moving = (1.0 + pace.left_out * (heavy - pace.even)) * size
    resting = pace.resting * (pace.rest_power if pace.rest_power < size else size)
    return math.copysign(resting if moving < resting else moving, surplus)


def _agreed(error_k: float, spread_k: float, bounds: tuple[float, float], pace: Pace) -> float:
    """Return what is left of an error on whose size the hypotheses do not agree.

    Where power can only heat, water that is too hot is so whatever they say.
    """
    if (error_k < 0.0 and bounds[0] >= 0.0) or spread_k <= pace.agreed_k:
        return error_k
    doubt_k = pace.caution * (spread_k - pace.agreed_k)
    return math.copysign(max(abs(error_k) - doubt_k, 0.0), error_k)


def ahead(
    setpoint_c: float, rate_k_per_s: float, end_c: float, lead_s: float
) -> tuple[float, float]:
    """Return where a ramp to `end_c` will be in `lead_s`, and how fast it moves then."""
    there_c = setpoint_c + rate_k_per_s * lead_s
    if (end_c - there_c) * rate_k_per_s <= 0.0:
        return end_c, 0.0
    return there_c, rate_k_per_s
