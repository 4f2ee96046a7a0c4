"""Sensor curves: counts to volts to degrees, both ways.

A driver delivers counts and knows nothing of sensors; here a `Conversion` says what the voltage
means, a `Calibration` corrects it, and `Sensor` judges the wiring on the counts themselves,
before any curve is asked. The backward direction serves tests and simulated boards.
See `docs/tank.md` for how the simulated probe uses the same curves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from thermoctl.quantities import ZERO_CELSIUS_K, is_finite_number
from thermoctl.signals import Measurement, Quality, RawSample

NAN = math.nan

# IEC 60751 (2008): the Callendar-Van Dusen coefficients of industrial platinum.
PLATINUM_A = 3.9083e-3
PLATINUM_B = -5.775e-7
PLATINUM_C = -4.183e-12
PLATINUM_RANGE_C = (-200.0, 850.0)


class Conversion(Protocol):
    """What a voltage means; NaN where the curve is not defined, never an exception."""

    def temperature_c(self, volts: float) -> float:
        """Return the temperature in degC at `volts`."""
        ...

    def volts(self, temperature_c: float) -> float:
        """Return the voltage at `temperature_c`."""
        ...


class ResistanceCurve(Protocol):
    """What a resistance means; NaN off the curve, never an exception."""

    def temperature_c(self, ohm: float) -> float:
        """Return the temperature in degC at `ohm`."""
        ...

    def ohm(self, temperature_c: float) -> float:
        """Return the resistance at `temperature_c`."""
        ...


def _positive(name: str, value: float) -> None:
    """Refuse what is not a positive finite number."""
    if not (is_finite_number(value) and value > 0.0):
        raise ValueError(f"{name} must be positive and finite, got {value!r}")


@dataclass(frozen=True, slots=True)
class LinearConversion:
    """A sensor whose voltage is a straight line.

    Parameters
    ----------
    kelvin_per_v : float
        Slope in K/V, not zero.
    zero_v_c : float
        Temperature in degC at 0 V.

    Raises
    ------
    ValueError
        When the slope is zero or either number is not finite.
    """

    kelvin_per_v: float
    zero_v_c: float

    def __post_init__(self) -> None:
        if not is_finite_number(self.kelvin_per_v) or self.kelvin_per_v == 0.0:
            raise ValueError(f"kelvin_per_v must be finite and not zero, got {self.kelvin_per_v!r}")
        if not is_finite_number(self.zero_v_c):
            raise ValueError(f"zero_v_c must be finite, got {self.zero_v_c!r}")

    def temperature_c(self, volts: float) -> float:
        """Return the temperature in degC at `volts`."""
        return self.zero_v_c + self.kelvin_per_v * volts

    def volts(self, temperature_c: float) -> float:
        """Return the voltage at `temperature_c`."""
        return (temperature_c - self.zero_v_c) / self.kelvin_per_v


LM335 = LinearConversion(kelvin_per_v=100.0, zero_v_c=-ZERO_CELSIUS_K)
"""10 mV/K, 0 V at absolute zero; an error of calibration is therefore a gain."""
LM35 = LinearConversion(kelvin_per_v=100.0, zero_v_c=0.0)
"""10 mV/K, 0 V at 0 degC."""
TMP36 = LinearConversion(kelvin_per_v=100.0, zero_v_c=-50.0)
"""10 mV/K, 0.5 V at 0 degC."""


@dataclass(frozen=True, slots=True)
class Platinum:
    r"""A platinum resistor after IEC 60751.

    .. math:: R = R_0 (1 + A t + B t^2 + [t < 0]\, C (t - 100) t^3)

    Parameters
    ----------
    r0_ohm : float
        Resistance at 0 degC: 100 for PT100, 1000 for PT1000.

    Raises
    ------
    ValueError
        When `r0_ohm` is not positive.
    """

    r0_ohm: float = 100.0

    def __post_init__(self) -> None:
        _positive("r0_ohm", self.r0_ohm)

    def ohm(self, temperature_c: float) -> float:
        """Return the resistance at `temperature_c`; NaN outside -200 to 850 degC."""
        t = temperature_c
        if not PLATINUM_RANGE_C[0] <= t <= PLATINUM_RANGE_C[1]:
            return NAN
        ratio = 1.0 + t * (PLATINUM_A + t * PLATINUM_B)
        if t < 0.0:
            ratio += PLATINUM_C * (t - 100.0) * t**3
        return self.r0_ohm * ratio

    def temperature_c(self, ohm: float) -> float:
        """Return the temperature in degC at `ohm`; NaN outside -200 to 850 degC."""
        coldest, hottest = (self.ohm(edge) for edge in PLATINUM_RANGE_C)
        if not coldest <= ohm <= hottest:
            return NAN
        ratio = ohm / self.r0_ohm
        discriminant = PLATINUM_A**2 - 4.0 * PLATINUM_B * (1.0 - ratio)
        t = (-PLATINUM_A + math.sqrt(discriminant)) / (2.0 * PLATINUM_B)
        return t if t >= 0.0 else max(self._below_zero(ratio, t), PLATINUM_RANGE_C[0])

    @staticmethod
    def _below_zero(ratio: float, t: float) -> float:
        """Refine the root `t` of the quadratic for the quartic that holds below 0 degC."""
        for _ in range(6):  # quadratic convergence from 2.5 K at most; three steps reach rounding
            cubic = PLATINUM_C * (t - 100.0) * t**3
            excess = 1.0 + t * (PLATINUM_A + t * PLATINUM_B) + cubic - ratio
            slope = PLATINUM_A + 2.0 * PLATINUM_B * t + PLATINUM_C * t**2 * (4.0 * t - 300.0)
            t -= excess / slope
        return t


@dataclass(frozen=True, slots=True)
class Steinhart:
    r"""A thermistor after Steinhart and Hart (1968).

    .. math:: 1/T = a + b \ln R + c (\ln R)^3

    Parameters
    ----------
    a, b, c : float
        Coefficients with R in ohm and T in kelvin; `b` and `c` positive, so that R falls with T.

    Raises
    ------
    ValueError
        When a coefficient is not finite, or `b` or `c` is not positive.
    """

    a: float
    b: float
    c: float

    def __post_init__(self) -> None:
        if not is_finite_number(self.a):
            raise ValueError(f"a must be finite, got {self.a!r}")
        _positive("b", self.b)
        _positive("c", self.c)

    def temperature_c(self, ohm: float) -> float:
        """Return the temperature in degC at `ohm`; NaN where there is none."""
        if not (ohm > 0.0 and math.isfinite(ohm)):
            return NAN
        x = math.log(ohm)
        inverse_k = self.a + x * (self.b + self.c * x * x)
        return 1.0 / inverse_k - ZERO_CELSIUS_K if inverse_k > 0.0 else NAN

    def ohm(self, temperature_c: float) -> float:
        """Return the resistance at `temperature_c`; NaN at or below absolute zero."""
        kelvin = temperature_c + ZERO_CELSIUS_K
        if not kelvin > 0.0:
            return NAN
        # One real root of x^3 + p x - 2 h = 0, for p > 0. Written with asinh and sinh because
        # Cardano's difference of cube roots cancels when c is small.
        p = self.b / self.c
        h = (1.0 / kelvin - self.a) / (2.0 * self.c)
        scale = math.sqrt(p / 3.0)
        x = 2.0 * scale * math.sinh(math.asinh(h / scale**3) / 3.0)
        return math.exp(x)


@dataclass(frozen=True, slots=True)
class Beta:
    r"""A thermistor by its beta value.

    .. math:: R = R_{25}\, e^{\beta (1/T - 1/298.15)}

    Parameters
    ----------
    r25_ohm : float
        Resistance at 25 degC.
    beta_k : float
        Beta in kelvin, positive (NTC).

    Raises
    ------
    ValueError
        When either is not positive.
    """

    r25_ohm: float = 10_000.0
    beta_k: float = 3950.0

    def __post_init__(self) -> None:
        _positive("r25_ohm", self.r25_ohm)
        _positive("beta_k", self.beta_k)

    def temperature_c(self, ohm: float) -> float:
        """Return the temperature in degC at `ohm`; NaN where there is none."""
        ratio = ohm / self.r25_ohm
        if not 0.0 < ratio < math.inf:
            return NAN
        inverse_k = 1.0 / (25.0 + ZERO_CELSIUS_K) + math.log(ratio) / self.beta_k
        return 1.0 / inverse_k - ZERO_CELSIUS_K if inverse_k > 0.0 else NAN

    def ohm(self, temperature_c: float) -> float:
        """Return the resistance at `temperature_c`; NaN at or below absolute zero."""
        kelvin = temperature_c + ZERO_CELSIUS_K
        if not kelvin > 0.0:
            return NAN
        exponent = self.beta_k * (1.0 / kelvin - 1.0 / (25.0 + ZERO_CELSIUS_K))
        return self.r25_ohm * math.exp(exponent) if exponent < 700.0 else math.inf


@dataclass(frozen=True, slots=True)
class PullUp:
    """A resistive sensor to ground under a pull-up: open is high, short is 0.

    Parameters
    ----------
    curve : ResistanceCurve
        What the resistance means.
    pull_up_ohm, supply_v : float
        The other half of the divider, and the voltage across both.

    Raises
    ------
    ValueError
        When `pull_up_ohm` or `supply_v` is not positive.
    """

    curve: ResistanceCurve
    pull_up_ohm: float
    supply_v: float

    def __post_init__(self) -> None:
        _positive("pull_up_ohm", self.pull_up_ohm)
        _positive("supply_v", self.supply_v)

    def temperature_c(self, volts: float) -> float:
        """Return the temperature in degC at `volts`; NaN unless 0 < volts < supply."""
        if not 0.0 < volts < self.supply_v:
            return NAN
        return self.curve.temperature_c(self.pull_up_ohm * volts / (self.supply_v - volts))

    def volts(self, temperature_c: float) -> float:
        """Return the voltage at `temperature_c`."""
        ohm = self.curve.ohm(temperature_c)
        return self.supply_v if math.isinf(ohm) else self.supply_v * ohm / (ohm + self.pull_up_ohm)


@dataclass(frozen=True, slots=True)
class Calibration:
    """Correction of one chain: voltage times `gain`, plus `offset_k`.

    Parameters
    ----------
    gain : float
        For an LM335 the whole of a one-point calibration; 0.8 to 1.25, more is not calibration.
    offset_k : float
        Added to the temperature, -20 to 20 K.

    Raises
    ------
    ValueError
        When a correction is implausible.
    """

    gain: float = 1.0
    offset_k: float = 0.0

    def __post_init__(self) -> None:
        if not 0.8 <= self.gain <= 1.25:
            raise ValueError(f"gain must lie within 0.8 to 1.25, got {self.gain!r}")
        if not -20.0 <= self.offset_k <= 20.0:
            raise ValueError(f"offset_k must lie within -20 to 20, got {self.offset_k!r}")

    @classmethod
    def by_gain(cls, conversion: Conversion, volts: float, reference_c: float) -> Calibration:
        """Return the gain that makes `volts` read `reference_c`; 0 V at 0 K only.

        Raises
        ------
        ValueError
            When `volts` is not positive or the gain is implausible.
        """
        _positive("volts", volts)
        return cls(gain=conversion.volts(reference_c) / volts)

    @classmethod
    def by_offset(cls, conversion: Conversion, volts: float, reference_c: float) -> Calibration:
        """Return the offset that makes `volts` read `reference_c`.

        Raises
        ------
        ValueError
            When the offset is implausible.
        """
        return cls(offset_k=reference_c - conversion.temperature_c(volts))


@dataclass(frozen=True, slots=True)
class Sensor:
    """From counts to a `Measurement`, wiring faults included.

    Parameters
    ----------
    conversion : Conversion
        What the voltage means.
    reference_v : float
        Voltage at full scale, positive.
    open_above, short_below : float
        Fractions of full scale: above the one the sensor is OPEN, below the other it is SHORT.
        The defaults suit an LM335 on a pull-up, whose own signal lies within 0.4 to 0.8 at 5 V.
    calibration : Calibration
        Correction of the chain.

    Raises
    ------
    ValueError
        When `reference_v` is not positive, or not 0 <= short_below < open_above <= 1.
    """

    conversion: Conversion
    reference_v: float
    open_above: float = 0.98
    short_below: float = 0.02
    calibration: Calibration = Calibration()

    def __post_init__(self) -> None:
        _positive("reference_v", self.reference_v)
        if not 0.0 <= self.short_below < self.open_above <= 1.0:
            raise ValueError(
                "short_below must be at least 0 and less than open_above "
                f"({self.open_above!r}, at most 1), got {self.short_below!r}"
            )

    def measure(self, raw: RawSample | None, t_s: float = NAN) -> Measurement:
        """Return what `raw` says; MISSING at `t_s` when there is no sample. Never raises."""
        if raw is None:
            return Measurement(t_s, quality=Quality.MISSING)
        if not (math.isfinite(raw.counts) and math.isfinite(raw.full_scale) and raw.full_scale > 0):
            return Measurement(raw.t_s, quality=Quality.MISSING)
        fraction = raw.counts / raw.full_scale
        if fraction > self.open_above:
            return Measurement(raw.t_s, quality=Quality.OPEN)
        if fraction < self.short_below:
            return Measurement(raw.t_s, quality=Quality.SHORT)
        temperature_c = self.temperature_c(fraction)
        if not math.isfinite(temperature_c):  # off the curve: nearer to which fault?
            off_curve = Quality.OPEN if fraction > 0.5 else Quality.SHORT
            return Measurement(raw.t_s, quality=off_curve)
        return Measurement(raw.t_s, temperature_c)

    def temperature_c(self, fraction: float) -> float:
        """Return the temperature in degC at `fraction` of full scale, NaN off the curve."""
        volts = fraction * self.reference_v * self.calibration.gain
        return self.conversion.temperature_c(volts) + self.calibration.offset_k

    def fraction(self, temperature_c: float) -> float:
        """Return the fraction of full scale at `temperature_c`, not limited to [0, 1]."""
        volts = self.conversion.volts(temperature_c - self.calibration.offset_k)
        return volts / (self.reference_v * self.calibration.gain)
