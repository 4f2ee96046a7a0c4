"""Structures of a plant linear in its parameters: what regresses on what.

Signs and order are those of O21 (1); ``u`` is always the power that was APPLIED. Implements
section 1 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from thermoctl.quantities import Array, is_finite_number


class Structure(Protocol):
    """What an identifier and a controller must know of a model.

    Pasts run newest first. As seen from the sample y(t) that is to be explained, ``y_past_c[0]``
    is y(t-1) and ``u_past[0]`` is u(t-1).
    """

    @property
    def parameters(self) -> int:
        """Length of theta."""
        ...

    @property
    def y_memory(self) -> int:
        """How many past temperatures the regressor takes."""
        ...

    @property
    def u_memory(self) -> int:
        """How many past powers the regressor and the target take."""
        ...

    def regressor(self, y_past_c: Array, u_past: Array) -> Array:
        """Return phi(t), shape (parameters,); NaN where the past is unknown."""
        ...

    def target(self, temperature_c: float, u_past: Array) -> float:
        """Return what ``phi(t)' theta`` should be when y(t) is `temperature_c`."""
        ...

    def temperature(self, value: float, u_past: Array) -> float:
        """Return the y(t) in degC for which `target` is `value`."""
        ...

    def pole(self, theta: Array, P: Array) -> tuple[float | None, float | None]:
        """Return the pole of a first-order structure and its sd; None for others."""
        ...


@dataclass(frozen=True, slots=True)
class Arx:
    r"""The ARX structure of O21 (1), in centred and scaled variables.

    .. math::

        y(t) + a_1 y(t-1) + \dots + a_n y(t-n)
            = b_1 u(t-d) + \dots + b_m u(t-d-m+1) + v(t)

    with :math:`y = (y_{degC} - centre)/scale` and :math:`u = power/u_{scale}`. There is no
    constant term, so the centre is the temperature at which the plant rests without power.

    Parameters
    ----------
    n, m : int
        Number of past outputs and of inputs; at least 0, not both 0.
    delay : int
        d, samples from an input to its first effect; at least 1.
    y_centre_c, y_scale_k : float
        Centre in degC and scale in K of the temperature; the scale is positive.
    u_scale : float
        Power that counts as 1; positive.

    Raises
    ------
    ValueError
        An argument is outside its range.
    """

    n: int
    m: int
    delay: int = 1
    y_centre_c: float = 0.0
    y_scale_k: float = 1.0
    u_scale: float = 1.0

    def __post_init__(self) -> None:
        for name, least in (("n", 0), ("m", 0), ("delay", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise ValueError(f"{name} must be an integer of at least {least}, got {value!r}")
        if self.n + self.m == 0:
            raise ValueError("n and m must not both be 0")
        if not is_finite_number(self.y_centre_c):
            raise ValueError(f"y_centre_c must be finite, got {self.y_centre_c!r}")
        for name in ("y_scale_k", "u_scale"):
            _require_positive(name, getattr(self, name))

    @property
    def parameters(self) -> int:
        """Length of theta: the n a's, then the m b's."""
        return self.n + self.m

    @property
    def y_memory(self) -> int:
        """How many past temperatures the regressor takes."""
        return self.n

    @property
    def u_memory(self) -> int:
        """How many past powers the regressor takes; none without inputs."""
        return self.delay + self.m - 1 if self.m else 0

    def regressor(self, y_past_c: Array, u_past: Array) -> Array:
        """Return phi(t) = (-y(t-1), ..., -y(t-n), u(t-d), ..., u(t-d-m+1)).

        Parameters
        ----------
        y_past_c : ndarray, shape (n,) or longer
            Past temperatures in degC, newest first.
        u_past : ndarray, shape (delay + m - 1,) or longer
            Past applied powers, newest first.
        """
        phi = np.empty(self.n + self.m)
        phi[: self.n] = (self.y_centre_c - y_past_c[: self.n]) / self.y_scale_k  # O21 (3)
        if self.m:
            first = self.delay - 1
            phi[self.n :] = u_past[first : first + self.m] / self.u_scale  # O21 (3)
        return phi

    def target(self, temperature_c: float, u_past: Array) -> float:
        """Return the centred and scaled temperature."""
        return (temperature_c - self.y_centre_c) / self.y_scale_k

    def temperature(self, value: float, u_past: Array) -> float:
        """Return the temperature in degC of a centred and scaled one."""
        return self.y_centre_c + self.y_scale_k * value

    def pole(self, theta: Array, P: Array) -> tuple[float | None, float | None]:
        """Return -a1 and its standard deviation where n is 1, else None."""
        if self.n != 1:
            return None, None
        return -float(theta[0]), math.sqrt(max(float(P[0, 0]), 0.0))


@dataclass(frozen=True, slots=True)
class KnownGain:
    r"""The first-order structure of O21 (27): known gain, learned pole.

    .. math:: y(t) = a\,y(t-1) + b\,u(t-1) + v(t)

    y(t) - b u(t-1) is regressed on y(t-1), in degC as printed, and theta = (a,). The paper writes
    its input in kelvin per sample; here that is ``b_k`` times the power. Its a is -a1 of (1).

    Parameters
    ----------
    b_k : float
        Rise in K during one sample at full power; positive.

    Raises
    ------
    ValueError
        `b_k` is not positive.
    """

    b_k: float

    def __post_init__(self) -> None:
        _require_positive("b_k", self.b_k)

    @property
    def parameters(self) -> int:
        """Length of theta."""
        return 1

    @property
    def y_memory(self) -> int:
        """How many past temperatures the regressor takes."""
        return 1

    @property
    def u_memory(self) -> int:
        """How many past powers the target takes."""
        return 1

    def regressor(self, y_past_c: Array, u_past: Array) -> Array:
        """Return phi(t) = (y(t-1),) in degC; `u_past` is not used."""
        return y_past_c if len(y_past_c) == 1 else y_past_c[:1]  # nearly always all of it

    def target(self, temperature_c: float, u_past: Array) -> float:
        """Return y(t) - b u(t-1) in degC."""
        return temperature_c - self.b_k * u_past.item(0)  # O21 (27)

    def temperature(self, value: float, u_past: Array) -> float:
        """Return y(t) in degC when ``a y(t-1)`` is `value`."""
        return value + self.b_k * u_past.item(0)  # O21 (27)

    def pole(self, theta: Array, P: Array) -> tuple[float | None, float | None]:
        """Return a and its standard deviation."""
        variance = float(P[0, 0])
        return float(theta[0]), math.sqrt(0.0 if variance < 0.0 else variance)


def _require_positive(name: str, value: float) -> None:
    if not is_finite_number(value) or not 0.0 < value < math.inf:
        raise ValueError(f"{name} must be positive, got {value!r}")
