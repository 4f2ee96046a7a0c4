r"""What a wide model says of the plant, in words of physics with bounds.

With q the backward shift, A(q) = (1 - p q) C(q), p being the pole nearest to 1. What is left of the
model, B/C, is how fast power heats, and how late:

.. math::

    \text{gain} = \frac{B(1)}{C(1)\,h}, \qquad
    \text{lag} = h \Bigl(\frac{B'(1)}{B(1)} - \frac{C'(1)}{C(1)} - 1\Bigr), \qquad
    \text{loss} = -\frac{\ln p}{h}

The lag is the mean one, dead time and all time constants but the longest together; a power that is
held from one sample to the next has none. Bounds are two standard deviations, from the covariance
of the parameters by linearisation.

Explained in ``docs/tune.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from thermoctl.quantities import Array
from thermoctl.studies.record import Record, RecordError
from thermoctl.studies.scaled import Scaling
from thermoctl.studies.wide import WideModel, fit_wide

LAGS = 3
"""Past outputs of the model that words are taken from."""

REACH = 26
"""Its past inputs at first, unless an order that was weighed looks farther back."""

FAR_LAGS, WIDENED = 4.0, 3
"""Inputs that look back less far than so many lags miss the tail of the answer, and tell a shorter
lag: the model is widened until they do not, so many times at most."""

PER_PARAMETER = 12
"""As long as it has so many samples for a parameter: with fewer, bounds grow by more than the tail
is worth."""

GAIN, LAG = 0, 2
"""Places of the two among the values of a view."""

_NEWTON_STEPS = 30
_SLOWEST_POLE = 0.5
_STEP = 1e-3
_SIGMAS = 2.0


@dataclass(frozen=True, slots=True)
class Bounded:
    """A quantity with the bounds it lies between in 95 of 100 cases.

    `high` is None where there is no upper one.
    """

    value: float
    low: float
    high: float | None


@dataclass(frozen=True, slots=True)
class PlantWords:
    """A plant in the words of its operator; None where the record does not say.

    Parameters
    ----------
    gain_k_per_min : Bounded
        Rise at full power, without losses.
    loss_k_per_min : Bounded
        Fall without power at the set point.
    time_constant_min : Bounded or None
        Time in which a deviation from rest falls to 37 %; None where the record is too short to
        tell it from endless, though its least value may be known: then `value` is that.
    lag_s : Bounded
        Mean lag from power to reading.
    holding_power : Bounded
        Fraction of full power that holds the set point.
    rest_c : Bounded or None
        Temperature without power.
    """

    gain_k_per_min: Bounded
    loss_k_per_min: Bounded
    lag_s: Bounded
    holding_power: Bounded
    time_constant_min: Bounded | None
    rest_c: Bounded | None


def plant_words(record: Record, setpoint_c: float, reach: int = REACH) -> PlantWords | None:
    """Return what a wide model says of the plant, None where that is no tank.

    None, too, where the input moves too little for it to say anything: the bounds of the gain
    would hold 0.

    Parameters
    ----------
    record : Record
        Temperature in degC and power as a fraction, evenly sampled.
    setpoint_c : float
        Temperature the loop is to hold, in degC.
    reach : int
        Past inputs.

    Raises
    ------
    RecordError
        If the temperature never changes, or too few samples have a past as long as that.
    """
    told = _told(record, setpoint_c, reach)
    if told is None:
        return None
    values, margins = told
    gain, loss, lag, holding, _, rest = (
        Bounded(value, value - margin, value + margin)
        for value, margin in zip(values.tolist(), margins.tolist(), strict=True)
    )
    rate, margin = float(values[-2]), float(margins[-2])
    return PlantWords(
        gain, loss, lag, holding, _time_constant(rate, margin), rest if rate > margin else None
    )


def _told(record: Record, setpoint_c: float, reach: int) -> tuple[Array, Array] | None:
    """Return the values of a model that looks back far enough, and their margins.

    One that looks farther back than the record lets it tell the gain is no better.
    """
    farthest = len(record.y) // PER_PARAMETER - LAGS - 1
    told = _seen(record, setpoint_c, reach)
    for _ in range(WIDENED):
        if told is None:
            break
        wanted = min(math.ceil(FAR_LAGS * float(told[0][LAG]) / record.period_s), farthest)
        if wanted <= reach:
            break
        reach = wanted
        try:
            wider = _seen(record, setpoint_c, reach)
        except RecordError:  # it has too many gaps for that
            break
        told = told if wider is None else wider
    return told


def _seen(record: Record, setpoint_c: float, reach: int) -> tuple[Array, Array] | None:
    """Return values and margins of the model of so many past inputs; None if it is no tank's."""
    scaling = Scaling.of(record)
    wide = fit_wide(record, scaling.outputs(record), scaling.inputs(record), LAGS, reach)
    view = _View(wide, scaling, record.period_s, setpoint_c)
    values = view.of(wide.theta)
    if values is None:
        return None
    margins: Array = _SIGMAS * view.deviations(values)
    return (values, margins) if values[GAIN] - margins[GAIN] > 0.0 else None


def _time_constant(rate: float, margin: float) -> Bounded | None:
    """Return the inverse of a rate of loss in 1/min, which may not be told from 0."""
    shortest = 1.0 / (rate + margin) if rate + margin > 0.0 else math.inf
    if rate > margin:
        return Bounded(1.0 / rate, shortest, 1.0 / (rate - margin))
    return Bounded(shortest, shortest, None) if math.isfinite(shortest) else None


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """A wide model with the units to see it in."""

    wide: WideModel
    scaling: Scaling
    period_s: float
    setpoint_c: float

    def of(self, theta: Array) -> Array | None:
        """Return gain, loss, lag, holding power, rate of loss and rest; None if it is no tank."""
        n, scaling = self.wide.order.n, self.scaling
        a, b, c = np.concatenate(([1.0], theta[:n])), theta[n:-1], float(theta[-1])
        pole = _slowest(a)
        if pole is None:
            return None
        rest_of_a = _divided(a, pole)
        B, C, A = float(b.sum()), float(rest_of_a.sum()), float(a.sum())
        if B == 0.0 or C == 0.0:
            return None
        B_slope = float(np.arange(1, len(b) + 1) @ b)
        C_slope = float(np.arange(len(rest_of_a)) @ rest_of_a)
        gain = 60.0 * B / C / self.period_s * scaling.y_scale / scaling.u_scale
        lag = self.period_s * (B_slope / B - C_slope / C - 1.0)
        rate = -60.0 * math.log(pole) / self.period_s
        y = (self.setpoint_c - scaling.y_centre) / scaling.y_scale
        holding = scaling.u_centre + scaling.u_scale * (A * y - c) / B
        u = -scaling.u_centre / scaling.u_scale
        rest = scaling.y_centre + scaling.y_scale * (B * u + c) / A if A else math.inf
        return np.array((gain, gain * holding, lag, holding, rate, rest))

    def deviations(self, values: Array) -> Array:
        """Return the standard deviation of each value, by differences from theta's own."""
        theta, sd = self.wide.theta, np.sqrt(np.diag(self.wide.covariance))
        slopes = np.zeros((len(values), len(theta)))
        for j in np.flatnonzero(sd):
            step = np.zeros(len(theta))
            step[j] = _STEP * sd[j]
            ahead, behind = self.of(theta + step), self.of(theta - step)
            if ahead is None or behind is None:
                return np.full(len(values), math.inf)
            slopes[:, j] = (ahead - behind) / (2.0 * step[j])
        variance = np.einsum("ij,jk,ik->i", slopes, self.wide.covariance, slopes)
        deviations: Array = np.sqrt(np.maximum(variance, 0.0))
        return deviations


def _slowest(a: Array) -> float | None:
    """Return the pole nearest to 1 of 1/A by Newton's steps from 1, None if none is near."""
    powers = np.arange(len(a))
    q = 1.0
    for _ in range(_NEWTON_STEPS):
        slope = float((powers[1:] * a[1:]) @ q ** (powers[1:] - 1))
        if slope == 0.0:
            return None
        step = float(a @ q**powers) / slope
        q -= step
        if not 0.0 < q < 1.0 / _SLOWEST_POLE:
            return None
        if abs(step) < 1e-14:
            break
    return 1.0 / q if abs(float(a @ q**powers)) < 1e-9 else None


def _divided(a: Array, pole: float) -> Array:
    """Return C of A = (1 - pole q) C, without its remainder, which is 0."""
    quotient = np.empty(len(a) - 1)
    carry = 0.0
    for k in range(len(quotient)):
        carry = float(a[k]) + pole * carry
        quotient[k] = carry
    return quotient
