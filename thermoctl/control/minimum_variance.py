"""Self-tuning minimum variance: predicted temperature onto reference.

Implements section 5 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from thermoctl.control.lasting import Lasting
from thermoctl.control.prediction import foresee, predict
from thermoctl.model.arx import Arx, KnownGain
from thermoctl.ports import Situation
from thermoctl.quantities import Array, clamp, is_finite_number
from thermoctl.signals import Beliefs

RIDE_MAX_S = 60.0
HOLDING_SD_MAX = 0.05
"""Largest standard deviation with which a holding power is reported: within +-0.1 at two."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """Conditions that the law has met of late and an operator should know.

    Parameters
    ----------
    zeros : Lasting
        Zeros of B that must not be cancelled.
    gain : Lasting
        A gain below its bound, or of the wrong sign.
    """

    zeros: Lasting = field(default_factory=Lasting)
    gain: Lasting = field(default_factory=Lasting)


@dataclass(frozen=True, slots=True)
class SelfTuningMinimumVariance:
    r"""The certainty-equivalent minimum variance law of O21 (23), for any delay.

    .. math::

        u(t) = [a_1 \hat y(t+d-1) + \dots + a_n \hat y(t+d-n) - b_2 u(t-1) - \dots
                - b_m u(t-m+1) + y^*(t+d)] / b_1

    with the latest estimates, the inputs that were applied, and temperatures that are measured up
    to y(t) and predicted beyond (`thermoctl.control.prediction`); with delay d = 1 all of them are
    measured. For the structure of (27) it is ``u = (y* - a y)/b``. The result is a power fraction
    and is NOT bounded here.

    Parameters
    ----------
    structure : Arx or KnownGain
        The model whose parameters ``situation.estimate`` holds; at least one input.
    reference_time_s : float
        Tc: ``y* = y + (r - y) h/Tc`` with the y one sample before, ``y(t+d-1)`` as predicted, so
        that an error is removed within Tc after the delay instead of within one sample of h
        seconds; three times the lag that the model does not know. 0 is the law as printed,
        ``y* = r``.
    gain_min_k : float
        Least b1, in K a sample at full power. A smaller or negative estimate is taken for this
        (projection: power heats). 0 leaves b1 as it is estimated.
    zero_radius : float
        Zeros of B at this distance from the origin or beyond are not cancelled: the past inputs
        are then taken to be the one that is sought, ``u = (... + y*)/(b1 + ... + bm)``, which has
        the same steady state and no recursion in u that could grow. Infinite: always cancel.
    on_zeros : str
        What such zeros do: ``detune`` as above, or ``refuse``: no power while there are any.

    Raises
    ------
    TypeError
        `structure` is of another kind.
    ValueError
        The structure has no input, or another argument is out of its range.
    """

    structure: Arx | KnownGain
    reference_time_s: float = 0.0
    gain_min_k: float = 0.0
    zero_radius: float = 1.0
    on_zeros: Literal["detune", "refuse"] = "detune"

    name: ClassVar[str] = "self-tuning-mv"

    def __post_init__(self) -> None:
        if not isinstance(self.structure, Arx | KnownGain):
            raise TypeError(f"structure must be Arx or KnownGain, got {self.structure!r}")
        if isinstance(self.structure, Arx) and self.structure.m < 1:
            raise ValueError(f"structure must have an input, got {self.structure}")
        for name in ("reference_time_s", "gain_min_k"):
            value = getattr(self, name)
            if not is_finite_number(value) or value < 0.0:
                raise ValueError(f"{name} must be finite and at least 0, got {value!r}")
        limited = is_finite_number(self.zero_radius) and self.zero_radius > 0.0
        if not limited and self.zero_radius != math.inf:
            raise ValueError(f"zero_radius must be positive, got {self.zero_radius!r}")
        if self.on_zeros not in ("detune", "refuse"):
            raise ValueError(f"on_zeros must be 'detune' or 'refuse', got {self.on_zeros!r}")

    def start(self) -> Conditions:
        """Return that nothing was met; the model and its past are in the situation."""
        return Conditions()

    def observe(self, belief: Conditions, situation: Situation) -> Conditions:
        """Return which conditions the parameters of this sample meet."""
        zero, gain_k = self._zero_and_gain(situation.estimate.theta)
        zeros = gain = ""
        if zero >= self.zero_radius:
            zeros = f"expected zeros of B within radius {self.zero_radius:g}, got one at {zero:.3g}"
        if gain_k < self.gain_min_k:
            least = f"{self.gain_min_k:.3g} K a sample at full power"
            gain = f"expected at least {least}, got {gain_k:.3g}"
        met = belief.zeros.after(zeros), belief.gain.after(gain)
        if met[0] is belief.zeros and met[1] is belief.gain:  # nearly always
            return belief
        return Conditions(*met)

    def decide(self, belief: Conditions, situation: Situation) -> tuple[Conditions, float]:
        """Return the next interval's power, unbounded; NaN when not known."""
        y, r = situation.temperature_c, situation.setpoint_c
        if not (math.isfinite(y) and math.isfinite(r)):
            return belief, math.nan
        if isinstance(self.structure, KnownGain):
            a = float(situation.estimate.theta[0])
            gain_k = self._bounded(self.structure.b_k)
            power = (self._reference(y, situation) - a * y) / gain_k  # O21 (27)
        else:
            power = self._power(self.structure, situation)
        return belief, power if math.isfinite(power) else math.nan

    def _reference(self, before_c: float, situation: Situation) -> float:
        """Return y*, where the temperature of one sample before is `before_c`."""
        if self.reference_time_s == 0.0:
            return situation.setpoint_c
        share = min(1.0, situation.interval_s / self.reference_time_s)
        return before_c + (situation.setpoint_c - before_c) * share

    def _power(self, structure: Arx, situation: Situation) -> float:
        """Return the power for which ``Arx`` predicts the reference; O21 (23).

        Before the start the plant is taken to have rested, and in a gap of the readings to have
        been where it is now. Without a power during n samples nothing would ever be learnt.
        """
        n, theta = structure.n, situation.estimate.theta
        now_c = situation.temperature_c
        y_past_c = np.concatenate(((now_c,), _known(situation.y_past_c, now_c)[1:n]))
        u_past = _known(situation.u_past, 0.0)
        if len(y_past_c) < n or len(u_past) < structure.delay + structure.m - 2:
            return math.nan
        zero, gain_k = self._zero_and_gain(theta)
        detuned, gain_k = zero >= self.zero_radius, self._bounded(gain_k)
        if gain_k == 0.0 or (detuned and self.on_zeros == "refuse"):
            return math.nan
        y_past_c, u_past = foresee(structure, theta, y_past_c, u_past, structure.delay - 1)
        u_sought = np.concatenate(((0.0,), np.zeros_like(u_past) if detuned else u_past))
        free_c = predict(structure, theta, y_past_c, u_sought)
        return (self._reference(float(y_past_c[0]), situation) - free_c) / gain_k  # O21 (23)

    def _zero_and_gain(self, theta: Array) -> tuple[float, float]:
        """Return how far out B has a zero, and the gain in K with or without cancelling it.

        Where every zero is to be cancelled nobody looks for one, and 0 stands for it.
        """
        structure = self.structure
        if isinstance(structure, KnownGain):
            return 0.0, structure.b_k
        b = theta[structure.n :]
        zero = 0.0 if self.zero_radius == math.inf else _farthest_zero(b)
        per_power_k = structure.y_scale_k / structure.u_scale
        return zero, float(b[0] if zero < self.zero_radius else b.sum()) * per_power_k

    def _bounded(self, gain_k: float) -> float:
        """Return the gain projected onto what power can do, when a bound is known."""
        return max(gain_k, self.gain_min_k) if self.gain_min_k > 0.0 else gain_k

    def beliefs(self, belief: Conditions, situation: Situation) -> Beliefs:
        """Return gain, pole and holding power, as far as the structure has them."""
        theta, P = situation.estimate.theta, situation.estimate.P
        h, structure = situation.interval_s, self.structure
        holding_power = self._holding(situation)
        a, a_sd = structure.pole(theta, P)
        if not h > 0.0:
            return Beliefs(a=a, a_sd=a_sd, holding_power=holding_power)
        if isinstance(structure, KnownGain):  # the gain is given, not learned: it has no sd
            return Beliefs(structure.b_k / h, None, a, a_sd, holding_power)
        if structure.n != 1:
            return Beliefs(holding_power=holding_power)
        per_power = structure.y_scale_k / structure.u_scale / h
        gain = float(theta[1:].sum()) * per_power
        gain_sd = _sd(P[1:, 1:], np.full(structure.m, per_power))
        return Beliefs(gain, gain_sd, a, a_sd, holding_power)

    def surprise_k(self, belief: Conditions, situation: Situation) -> float:
        """Return the innovation of the model in K; NaN when the sample was not used."""
        estimate, structure = situation.estimate, self.structure
        if estimate.rejected:
            return math.nan
        scale_k = 1.0 if isinstance(structure, KnownGain) else structure.y_scale_k
        return estimate.innovation * scale_k

    def _holding(self, situation: Situation) -> float | None:
        """Return the model's steady power at the set point, or None while it is too vague."""
        theta, P = situation.estimate.theta, situation.estimate.P
        r, structure = situation.setpoint_c, self.structure
        if isinstance(structure, KnownGain):
            power = (1.0 - float(theta[0])) * r / structure.b_k
            slope = np.array([-r / structure.b_k])
        else:
            n = structure.n
            B = float(theta[n:].sum())
            if B == 0.0:
                return None
            y = (r - structure.y_centre_c) / structure.y_scale_k
            power = (1.0 + float(theta[:n].sum())) * y / B
            slope = np.concatenate((np.full(n, y / B), np.full(structure.m, -power / B)))
            power, slope = power * structure.u_scale, slope * structure.u_scale
        sd = _sd(P, slope)
        if not (math.isfinite(power) and sd <= HOLDING_SD_MAX):  # false for NaN
            return None
        return clamp(power, 0.0, 1.0)

    def ride_s(self, belief: Conditions) -> float:
        """Return how long the model may steer without a sensor: Tc, at most 60 s."""
        return min(self.reference_time_s, RIDE_MAX_S)

    def remarks(self, belief: Conditions) -> Mapping[str, str]:
        """Return which zeros or which gain the law does not like, if any."""
        zeros = "controller.detuned" if self.on_zeros == "detune" else "controller.refused"
        found = ((zeros, belief.zeros), ("controller.gain_doubtful", belief.gain))
        return {name: condition.text for name, condition in found if condition.stands}


def _known(past: Array, otherwise: float) -> Array:
    """Return `past` with `otherwise` in place of what is not known."""
    return np.where(np.isnan(past), otherwise, past)


def _farthest_zero(b: Array) -> float:
    """Return the largest modulus of a zero of B, b1 z^(m-1) + ... + bm; 0 when there is none."""
    if len(b) == 1 or not np.isfinite(b).all():
        return 0.0
    if not b[1:].any():
        return 0.0
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        monic = b / b[0]
    if not np.isfinite(monic).all():  # b1 is 0, or next to it: a zero at infinity
        return math.inf
    if len(b) == 2:  # the usual order; a tenth of the time of the general case
        return abs(float(monic[1]))
    return float(np.abs(np.roots(monic)).max(initial=0.0))


def _sd(P: Array, slope: Array) -> float:
    """Return the standard deviation of ``slope' theta``."""
    return math.sqrt(max(float(slope @ P @ slope), 0.0))
