"""Self-tuning minimum variance: predicted temperature onto reference.

Implements section 5 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from thermoctl.model.arx import Arx, KnownGain
from thermoctl.ports import Situation
from thermoctl.quantities import Array, clamp, is_finite_number
from thermoctl.signals import Beliefs

RIDE_MAX_S = 60.0
HOLDING_SD_MAX = 0.05
"""A holding power is told when its standard deviation is at most this: within +-.1 at two."""


@dataclass(frozen=True, slots=True)
class SelfTuningMinimumVariance:
    r"""The certainty-equivalent minimum variance law of O21 (23), delay one.

    .. math::

        u(t) = [a_1 y(t) + \dots + a_n y(t-n+1) - b_2 u(t-1) - \dots - b_m u(t-m+1)
                + y^*(t+1)] / b_1

    with the latest estimates and the inputs that were applied. For the structure of (27) it is
    ``u = (y* - a y)/b``. The result is a power fraction and is NOT bounded here.

    Parameters
    ----------
    structure : Arx or KnownGain
        The model whose parameters ``situation.estimate`` holds; delay 1, at least one input.
    reference_time_s : float
        Tc: ``y* = y + (r - y) h/Tc``, so that an error is removed within Tc instead of within one
        sample of h seconds; three times the lag that the model does not know. 0 is the law as
        printed, ``y* = r``.
    gain_min_k : float
        Least b1, in K a sample at full power. A smaller or negative estimate is taken for this
        (projection: power heats). 0 leaves b1 as it is estimated.
    zero_radius : float
        Zeros of B at this distance from the origin or beyond are not cancelled: the past inputs
        are then taken to be the one that is sought, ``u = (... + y*)/(b1 + ... + bm)``, which has
        the same steady state and no recursion in u that could grow. Infinite: always cancel.

    Raises
    ------
    TypeError
        `structure` is of another kind.
    ValueError
        The structure has no input or a delay other than 1, or a number is out of its range.
    """

    structure: Arx | KnownGain
    reference_time_s: float = 0.0
    gain_min_k: float = 0.0
    zero_radius: float = 1.0

    name: ClassVar[str] = "self-tuning-mv"

    def __post_init__(self) -> None:
        if not isinstance(self.structure, Arx | KnownGain):
            raise TypeError(f"structure must be Arx or KnownGain, got {self.structure!r}")
        if isinstance(self.structure, Arx) and (self.structure.m < 1 or self.structure.delay != 1):
            raise ValueError(f"structure must have an input and delay 1, got {self.structure}")
        for name in ("reference_time_s", "gain_min_k"):
            value = getattr(self, name)
            if not is_finite_number(value) or value < 0.0:
                raise ValueError(f"{name} must be finite and at least 0, got {value!r}")
        limited = is_finite_number(self.zero_radius) and self.zero_radius > 0.0
        if not limited and self.zero_radius != math.inf:
            raise ValueError(f"zero_radius must be positive, got {self.zero_radius!r}")

    def start(self) -> None:
        """Return None: all that is remembered are the estimate and the applied inputs."""

    def observe(self, belief: None, situation: Situation) -> None:
        """Return None: the identifier learns, and the situation holds what it has learnt."""

    def decide(self, belief: None, situation: Situation) -> tuple[None, float]:
        """Return the next interval's power, unbounded; NaN when not known."""
        y, r = situation.temperature_c, situation.setpoint_c
        if not (math.isfinite(y) and math.isfinite(r)):
            return None, math.nan
        reference_c = r
        if self.reference_time_s > 0.0:
            reference_c = y + (r - y) * min(1.0, situation.interval_s / self.reference_time_s)
        theta = situation.estimate.theta
        if isinstance(self.structure, KnownGain):
            power = (reference_c - float(theta[0]) * y) / self._gain(self.structure.b_k)
        else:
            power = self._power(self.structure, situation, reference_c)
        return None, power if math.isfinite(power) else math.nan

    def _power(self, structure: Arx, situation: Situation, reference_c: float) -> float:
        """Return the power for which ``Arx`` predicts `reference_c`; O21 (23).

        Before the start the plant is taken to have rested, and in a gap of the readings to have
        been where it is now: without a power for so long as n samples it would never be learnt.
        """
        n, theta = structure.n, situation.estimate.theta
        y_past_c = _known(situation.y_past_c, situation.temperature_c)
        if n > 0:
            y_past_c = np.concatenate(((situation.temperature_c,), y_past_c[1:n]))
        b = theta[n:]
        cancel = _zeros_inside(b, self.zero_radius)
        u_past = np.concatenate(((0.0,), _known(situation.u_past, 0.0)[: structure.m - 1]))
        if not cancel:
            u_past[:] = 0.0
        if len(y_past_c) < n or len(u_past) < structure.m:
            return math.nan
        per_power_k = structure.y_scale_k / structure.u_scale
        gain_k = self._gain(float(b[0] if cancel else b.sum()) * per_power_k)
        if gain_k == 0.0:
            return math.nan
        free_c = structure.temperature(
            float(theta.dot(structure.regressor(y_past_c, u_past))), u_past
        )
        return (reference_c - free_c) / gain_k  # O21 (23)

    def _gain(self, gain_k: float) -> float:
        """Return the gain projected onto what power can do, when a bound is known."""
        return max(gain_k, self.gain_min_k) if self.gain_min_k > 0.0 else gain_k

    def beliefs(self, belief: None, situation: Situation) -> Beliefs:
        """Return gain, pole and holding power, as far as the structure has them."""
        theta, P = situation.estimate.theta, situation.estimate.P
        h, structure = situation.interval_s, self.structure
        holding_power = self._holding(situation)
        if isinstance(structure, KnownGain):
            gain = structure.b_k / h if h > 0.0 else None  # given, not learned: it has no sd
            return Beliefs(gain, None, float(theta[0]), _sd(P, np.ones(1)), holding_power)
        if structure.n != 1:
            return Beliefs(holding_power=holding_power)
        a, a_sd = -float(theta[0]), _sd(P[:1, :1], np.ones(1))
        if not h > 0.0:
            return Beliefs(a=a, a_sd=a_sd, holding_power=holding_power)
        per_power = structure.y_scale_k / structure.u_scale / h
        gain = float(theta[1:].sum()) * per_power
        gain_sd = _sd(P[1:, 1:], np.full(structure.m, per_power))
        return Beliefs(gain, gain_sd, a, a_sd, holding_power)

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

    def ride_s(self, belief: None) -> float:
        """Return how long the model may steer without a sensor: Tc, at most 60 s."""
        return min(self.reference_time_s, RIDE_MAX_S)

    def remarks(self, belief: None) -> Mapping[str, str]:
        """Return nothing."""
        return {}


def _known(past: Array, otherwise: float) -> Array:
    """Return `past` with `otherwise` in place of what is not known."""
    return np.where(np.isnan(past), otherwise, past)


def _zeros_inside(b: Array, radius: float) -> bool:
    """Return whether all zeros of B, b1 z^(m-1) + ... + bm, lie within `radius`."""
    if len(b) == 1 or radius == math.inf or not np.isfinite(b).all():
        return True
    if b[0] == 0.0:  # a zero at infinity
        return not b[1:].any()
    return bool(np.abs(np.roots(b)).max(initial=0.0) < radius)


def _sd(P: Array, slope: Array) -> float:
    """Return the standard deviation of ``slope' theta``."""
    return math.sqrt(max(float(slope @ P @ slope), 0.0))
