r"""Gains of a PID by rule: SIMC for a plant, Tyreus and Luyben for its limit.

A plant is a slope, lags and dead time,

.. math:: G(s) = \frac{k' \tau_1\,e^{-\theta s}}{(\tau_1 s + 1)(\tau_2 s + 1) \dots},

k' being the rise in K/s at full power; with :math:`\tau_1 = \infty` it integrates. SIMC is by
S. Skogestad, Journal of Process Control 13 (2003) 291-309; the other rule by B. D. Tyreus and
W. L. Luyben, Industrial & Engineering Chemistry Research 31 (1992) 2625-2628. Implements section 6
of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from thermoctl.quantities import is_finite_number


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of a PID in its standard (ISA) form.

    That is K times the sum of error, integral of error over Ti, and Td times the derivative.

    Parameters
    ----------
    gain_per_k : float
        K, power per kelvin of error.
    integral_s : float
        Ti; infinite: no integral.
    derivative_s : float
        Td; 0: no derivative.
    """

    gain_per_k: float
    integral_s: float
    derivative_s: float = 0.0

    @property
    def Kp(self) -> float:  # noqa: N802 - as the parallel form calls it
        """Proportional gain of the parallel form, 1/K."""
        return self.gain_per_k

    @property
    def Ki(self) -> float:  # noqa: N802
        """Integral gain of the parallel form, 1/(K s)."""
        return self.gain_per_k / self.integral_s

    @property
    def Kd(self) -> float:  # noqa: N802
        """Derivative gain of the parallel form, s/K."""
        return self.gain_per_k * self.derivative_s

    @classmethod
    def series(cls, gain_per_k: float, integral_s: float, derivative_s: float) -> Gains:
        """Return the same law as a PI in series with a PD, whose gains are given."""
        share = 1.0 + derivative_s / integral_s
        return cls(gain_per_k * share, integral_s * share, derivative_s / share)


@dataclass(frozen=True, slots=True)
class Process:
    """What a rule has to know of a plant.

    Parameters
    ----------
    slope_k_per_s : float
        k', the steady gain in K at full power over the largest lag; the rise of an integrating one.
    dead_s : float
        Dead time, greater than 0.
    lags_s : tuple of float
        Lags, the largest first; when that is infinite, the plant integrates.

    Raises
    ------
    ValueError
        A value is outside its range, or the lags are not in order.
    """

    slope_k_per_s: float
    dead_s: float
    lags_s: tuple[float, ...] = (math.inf,)

    def __post_init__(self) -> None:
        for name in ("slope_k_per_s", "dead_s"):
            value = getattr(self, name)
            if not is_finite_number(value) or not value > 0.0:
                raise ValueError(f"{name} must be positive, got {value!r}")
        ordered = tuple(sorted(self.lags_s, reverse=True))
        if not self.lags_s or self.lags_s != ordered or not self.lags_s[-1] >= 0.0:
            raise ValueError(f"lags_s must begin with the largest, got {self.lags_s!r}")

    def reduced(self, order: int) -> Process:
        """Return the plant with `order` lags, by Skogestad's half rule.

        The largest lag that is left out is halved between dead time and the last one kept; smaller
        ones are dead time as a whole.
        """
        kept, (half_s, *rest) = self.lags_s[:order], (*self.lags_s[order:], 0.0)
        half_s *= 0.5
        lags_s = (*kept[:-1], kept[-1] + half_s)
        widened = kept[0] / lags_s[0] if math.isfinite(kept[0]) and kept[0] > 0.0 else 1.0
        return Process(self.slope_k_per_s * widened, self.dead_s + half_s + sum(rest), lags_s)


def simc(process: Process, *, derivative: bool = False, closed_s: float | None = None) -> Gains:
    r"""Return the gains SIMC gives a PI or a PID.

    .. math::

        K = \frac{1}{k' (\tau_c + \theta)}, \qquad T_i = \min(\tau_1, 4 (\tau_c + \theta)), \qquad
        T_d = \tau_2

    for the series form, of the plant reduced to one lag, or to two for a derivative.

    Parameters
    ----------
    process : Process
        The plant.
    derivative : bool
        Whether the second lag is cancelled.
    closed_s : float, optional
        :math:`\tau_c`, the time constant of the closed loop; the dead time that is left unless it
        is given, as the rules recommend.
    """
    plant = process.reduced(2 if derivative and len(process.lags_s) > 1 else 1)
    slowed_s = plant.dead_s + (plant.dead_s if closed_s is None else closed_s)
    gain_per_k = 1.0 / (plant.slope_k_per_s * slowed_s)
    integral_s = min(plant.lags_s[0], 4.0 * slowed_s)
    return Gains.series(gain_per_k, integral_s, sum(plant.lags_s[1:]))


@dataclass(frozen=True, slots=True)
class Limit:
    """Where a plant under proportional control begins to swing by itself.

    Parameters
    ----------
    gain_per_k : float
        Ultimate gain, power per kelvin.
    period_s : float
        Ultimate period.
    """

    gain_per_k: float
    period_s: float


def tyreus_luyben(limit: Limit, *, derivative: bool = False) -> Gains:
    """Return the gains of Tyreus and Luyben for a PI or a PID."""
    if derivative:
        return Gains(limit.gain_per_k / 2.2, 2.2 * limit.period_s, limit.period_s / 6.3)
    return Gains(limit.gain_per_k / 3.2, 2.2 * limit.period_s)
