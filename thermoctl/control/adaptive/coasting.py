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

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from thermoctl.control.adaptive.filters import BETA, Block, Constants, D, T, X
from thermoctl.control.adaptive.hypotheses import Hypotheses
from thermoctl.control.adaptive.path import Path
from thermoctl.quantities import Array, clamp

FASTEST_S = 3.0
"""Tc is no shorter, whatever the lag."""
FASTEST_PERIODS = 1.5
"""Nor shorter than so many samples: at one sample any error of the gain would be given back whole,
and below it the loop would be unstable."""
HEAVY_K, CALMER = 1.2, 3.0
"""Where full power puts more than so many kelvin on their way within a lag, each tenth by which the
lag is mistaken is that much overshoot: Tc grows by as much, and no more than so many times."""
SMOOTHNESS = 0.4
"""The lag of the power itself, as a share of Tc. Noise costs a good deal less travel than at once,
while a power that has far to go is at its limit at once all the same."""

CARRIED, EVEN = 0.4, 2.0
"""On the move so much of the heat in the heater is left out of account. Were all of it counted, the
error would go by Tc and the water follow as slowly as the heater; so both go at one pace, damped by
some .85. A lag that is mistaken then costs more: where the range of power has so many times
`HEAVY_K` under way all of that heat counts, and beyond it even more."""
AT_REST, REST = 2.2, 0.08
"""Within so small a surplus of power that heat counts so many times. At rest it is the answer to
noise that has passed, and what is taken back of it need not be cooled away."""
VAGUE, VAGUE_MOST = 0.25, 0.05
"""A gain is taken to be larger by what its deviation, .05 K/s of it at most, exceeds a quarter of
it. Else a start in water that is nearly warm would ask for all the power there is."""
CAUTION, AGREED_K = 1.0, 0.05
"""An error is acted on but for so many standard deviations among the hypotheses beyond the latter.
What they disagree in is heat on its way. When it has arrived they agree: nothing waits for ever."""


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
    """

    coasting_c: float
    holding_power: float
    lag_s: float
    gain: float
    heater_k: float = 0.0
    surplus: float = 0.0
    spread_k: float = 0.0
    gain_sd: float = 0.0


def outlook(
    block: Block, path: Path, share: Array, hypotheses: Hypotheses, constants: Constants
) -> Outlook:
    """Return the means over the hypotheses, weighted by `share`."""
    h, mean = hypotheses.period_s, share.dot
    d, beta = block[D, X], block[BETA, X]
    holding = np.minimum(np.maximum(d / beta, constants.power_min), constants.power_max)
    coasting = path.under_way - hypotheses.held * holding
    coasting *= beta
    coasting += block[T, X]
    coasting_c, holding_power = float(mean(coasting)), float(mean(holding))
    coasting *= coasting
    variance = float(mean(coasting)) - coasting_c * coasting_c
    return Outlook(  # in the order of its fields: by their names it would take twice as long
        coasting_c,
        holding_power,
        float(mean(hypotheses.lag_s)),
        float(mean(beta)) / h,
        float(mean(hypotheses.element * beta)),
        float(mean(path.heat)) - holding_power,
        math.sqrt(max(variance, 0.0)),
        math.sqrt(float(mean(block[BETA, BETA]))) / h,
    )


def power_for(
    outlook: Outlook,
    setpoint_c: float,
    calmness: float,
    period_s: float,
    bounds: tuple[float, float],
    before: float,
    ramp_power: float = 0.0,
) -> float:
    """Return the power that lets the water come to rest at the set point within Tc.

    Parameters
    ----------
    outlook : Outlook
        What is expected.
    setpoint_c : float
        Where the water is to come to rest, in degC; on a ramp, that of `ahead`.
    calmness : float
        Tc as a share of the lag, unless much heat is under way.
    period_s : float
        Time between two samples.
    bounds : tuple of float
        Least and most power.
    before : float
        Power of the last period, as it was applied.
    ramp_power : float
        What lets the water rise with a ramp, beside the holding power.
    """
    full_k = outlook.gain * outlook.lag_s
    heavy = clamp(full_k / HEAVY_K, 1.0, CALMER)
    Tc_s = max(FASTEST_S, FASTEST_PERIODS * period_s, calmness * heavy * outlook.lag_s)
    tau_s = SMOOTHNESS * Tc_s
    resting = outlook.holding_power + ramp_power
    aim_c = outlook.coasting_c + outlook.gain * tau_s * (before - resting)
    surplus = outlook.surplus - ramp_power
    aim_c += outlook.heater_k * (_counted(surplus, full_k * (bounds[1] - bounds[0])) - surplus)
    error_k = _agreed(setpoint_c - aim_c, outlook.spread_k, bounds)
    gain = outlook.gain + max(min(outlook.gain_sd, VAGUE_MOST) - VAGUE * outlook.gain, 0.0)
    wanted = resting + error_k / (gain * Tc_s)
    return clamp(before + (wanted - before) * period_s / (period_s + tau_s), *bounds)


def _counted(surplus: float, swing_k: float) -> float:
    """Return as how much a surplus of power in the heater counts.

    `swing_k` is what the whole range of power has under way within a lag; a cooler adds to it.
    """
    moving = 1.0 + CARRIED * (clamp(swing_k / HEAVY_K, 1.0, CALMER) - EVEN)
    size = abs(surplus)
    return math.copysign(max(moving * size, min(AT_REST * size, AT_REST * REST)), surplus)


def _agreed(error_k: float, spread_k: float, bounds: tuple[float, float]) -> float:
    """Return what is left of an error on whose size the hypotheses do not agree.

    Where power can only heat, water that is too hot is so whatever they say.
    """
    doubt_k = CAUTION * max(spread_k - AGREED_K, 0.0)
    if error_k < 0.0 and bounds[0] >= 0.0:
        return error_k
    return math.copysign(max(abs(error_k) - doubt_k, 0.0), error_k)


def ahead(
    setpoint_c: float, rate_k_per_s: float, end_c: float, lead_s: float
) -> tuple[float, float]:
    """Return where a ramp to `end_c` will be in `lead_s`, and how fast it moves then."""
    there_c = setpoint_c + rate_k_per_s * lead_s
    if (end_c - there_c) * rate_k_per_s <= 0.0:
        return end_c, 0.0
    return there_c, rate_k_per_s
