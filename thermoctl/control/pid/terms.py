"""The terms of a PID, and an integral that cannot wind up.

Implements section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from thermoctl.control.pid.simc import Gains

TOLERANCE = 0.01
"""Largest difference from the power asked for that is a converter's rounding; beyond it somebody
limited it."""


@dataclass(frozen=True, slots=True)
class Terms:
    """What a PID remembers from one sample to the next.

    Parameters
    ----------
    integral : float
        Its integral, in power. With a set point weight of 1 it is the power at rest.
    seen_c, smooth_c : float
        Last temperature, and the temperature filtered for the derivative; NaN before the first.
    asked : float
        Power asked for at the last sample; NaN: somebody else was in charge.
    """

    integral: float = math.nan
    seen_c: float = math.nan
    smooth_c: float = math.nan
    asked: float = math.nan


@dataclass(frozen=True, slots=True)
class PidTerms:
    r"""The standard form with its derivative on the measurement.

    .. math::

        u = K \Bigl[ b r - y + \frac{1}{T_i} \int (r - y)\,dt \Bigr]
            - K \frac{T_d s}{1 + s T_d/N} y

    Parameters
    ----------
    gains : Gains
        K, Ti, Td.
    setpoint_weight : float
        b.
    derivative_filter : float
        N.
    """

    gains: Gains
    setpoint_weight: float = 1.0
    derivative_filter: float = 10.0

    def see(self, terms: Terms, temperature_c: float, interval_s: float) -> Terms:
        """Return the terms after a temperature; one that is not finite changes nothing."""
        if not math.isfinite(temperature_c):
            return terms
        filter_s = self.gains.derivative_s / self.derivative_filter
        smooth_c = temperature_c
        if filter_s > 0.0 and math.isfinite(terms.smooth_c):
            left = math.exp(-interval_s / filter_s)
            smooth_c += (terms.smooth_c - temperature_c) * left
        return replace(terms, seen_c=temperature_c, smooth_c=smooth_c)

    def power(self, terms: Terms, setpoint_c: float) -> float:
        """Return the power of all terms, not bounded."""
        return self._quick(terms, setpoint_c) + terms.integral

    def track(self, terms: Terms, setpoint_c: float, applied: float) -> Terms:
        """Return the terms that ask for exactly `applied`."""
        return replace(terms, integral=applied - self._quick(terms, setpoint_c))

    def at_rest(self, terms: Terms, setpoint_c: float, holding: float) -> Terms:
        """Return the terms whose integral alone would give the power `holding`."""
        return replace(terms, integral=holding + self._offset(setpoint_c))

    def holding(self, terms: Terms, setpoint_c: float) -> float:
        """Return the power that would be left without error and without movement."""
        return terms.integral - self._offset(setpoint_c)

    def integrate(
        self,
        terms: Terms,
        setpoint_c: float,
        applied: float,
        interval_s: float,
        *,
        keeps: bool = False,
    ) -> Terms:
        """Return the terms after `interval_s` in charge, in which `applied` was given.

        What the plant was given is what counts. Where it was less than asked for, an integral that
        would hold more than that relaxes onto it, and a positive error is integrated no further
        than to where the integral holds nothing; at the lower end likewise upside down. No limit
        gives more than was asked for: then somebody else steers, as beside a law in shadow. Nor is
        that so where what acts `keeps` its heat: a block that cools down gives more than it is
        asked for, and a law that followed it would ask it to stay as hot as it is.
        """
        if applied > max(terms.asked, 0.0) + TOLERANCE and not keeps:
            return self.track(terms, setpoint_c, applied)
        gains, offset = self.gains, self._offset(setpoint_c)
        holding = terms.integral - offset
        error_k = setpoint_c - terms.seen_c
        added = gains.gain_per_k * error_k * interval_s / gains.integral_s
        excess = terms.asked - applied
        if abs(excess) <= TOLERANCE or excess * added < 0.0:
            return replace(terms, integral=terms.integral + added)
        relaxed = (applied - holding) * -math.expm1(-interval_s / gains.integral_s)
        if excess > 0.0:
            holding = holding + min(relaxed, 0.0) if holding > 0.0 else min(holding + added, 0.0)
        else:
            holding = holding + max(relaxed, 0.0) if holding < 1.0 else max(holding + added, 1.0)
        return replace(terms, integral=offset + holding)

    def _offset(self, setpoint_c: float) -> float:
        """Return what the integral carries because the set point is weighted."""
        return self.gains.gain_per_k * (1.0 - self.setpoint_weight) * setpoint_c

    def _quick(self, terms: Terms, setpoint_c: float) -> float:
        """Return proportional and derivative term."""
        gains = self.gains
        power = gains.gain_per_k * (self.setpoint_weight * setpoint_c - terms.seen_c)
        if gains.derivative_s > 0.0:
            power -= gains.gain_per_k * self.derivative_filter * (terms.seen_c - terms.smooth_c)
        return power
