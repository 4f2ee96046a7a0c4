"""Whether innovations are white: Ljung and Box's test (docs/replay.md).

An innovation is what a model could not foresee. If it can be foreseen from earlier innovations, the
model lacks something: an order, a delay, an input, or it tracks too slowly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from thermoctl.quantities import Array

LAGS = 20
"""Autocorrelations that enter the test when the record is long enough."""

FEWEST_SAMPLES = 20
"""Below this many innovations the test says nothing."""

_TERMS = 10_000
_TINY = 1e-300


@dataclass(frozen=True, slots=True)
class Whiteness:
    """Verdict of the test.

    Parameters
    ----------
    statistic : float
        Ljung and Box's Q; NaN where the test could not be made.
    lags : int
        Autocorrelations that entered, which is also the number of degrees of freedom.
    p : float
        Probability, in [0, 1], of a Q at least this large if the innovations are white.
    """

    statistic: float
    lags: int
    p: float


def ljung_box(innovations: Array, lags: int | None = None) -> Whiteness:
    r"""Test whether `innovations` are white.

    .. math:: Q = N (N + 2) \sum_{k=1}^{h} \frac{r_k^2}{N - k} \sim \chi^2_h

    No degree of freedom is taken off for estimated parameters: one-step predictions were made
    before their sample was seen, so they are no residuals of a fit.

    Parameters
    ----------
    innovations : ndarray, shape (N,)
        In the order of time; each divided by its own standard deviation, where that is known.
    lags : int, optional
        h, at least 1 and below N; by default `LAGS`, and at most a fifth of N.

    Returns
    -------
    Whiteness
        With NaN for `p` below `FEWEST_SAMPLES` finite samples, or when they do not vary.

    Raises
    ------
    ValueError
        If `lags` is not in [1, N).
    """
    e = innovations[np.isfinite(innovations)]
    N = len(e)
    h = max(1, min(LAGS, N // 5)) if lags is None else lags
    if lags is not None and not 1 <= lags < N:
        raise ValueError(f"lags must be in [1, {N}), got {lags!r}")
    e = e - e.mean() if N else e
    power = float(e @ e)
    if N < FEWEST_SAMPLES or not power > 0.0:
        return Whiteness(math.nan, h, math.nan)
    r = np.array([float(e[k:] @ e[:-k]) for k in range(1, h + 1)]) / power
    Q = N * (N + 2) * float(np.sum(r**2 / (N - np.arange(1, h + 1))))
    return Whiteness(Q, h, chi_square_tail(Q, h))


def chi_square_tail(x: float, degrees: int) -> float:
    """Return the probability that a chi-square variable exceeds `x`.

    It is the regularised upper incomplete gamma function of degrees/2 and x/2: a power series
    below the mean, Lentz's continued fraction above it, each where it converges quickly. Relative
    error below 1e-10 for up to 1,000 degrees, until the tail itself underflows.

    Parameters
    ----------
    x : float
        Zero or more.
    degrees : int
        Degrees of freedom, at least 1.

    Raises
    ------
    ValueError
        If `x` is negative or NaN, or `degrees` below 1.
    """
    if degrees < 1:
        raise ValueError(f"degrees must be at least 1, got {degrees!r}")
    if not x >= 0.0:  # written so that NaN fails too
        raise ValueError(f"x must not be negative, got {x!r}")
    a, z = 0.5 * degrees, 0.5 * x
    if z == 0.0 or math.isinf(z):
        return 1.0 if z == 0.0 else 0.0
    front = math.exp(a * math.log(z) - z - math.lgamma(a))
    if z < a + 1.0:
        return max(0.0, 1.0 - front * _lower_series(a, z))
    return front * _upper_fraction(a, z)


def _lower_series(a: float, z: float) -> float:
    """Return the lower incomplete gamma function over z^a e^-z, for z below a + 1."""
    term = total = 1.0 / a
    for k in range(1, _TERMS):
        term *= z / (a + k)
        total += term
        if term < total * 1e-17:
            break
    return total


def _upper_fraction(a: float, z: float) -> float:
    """Return the upper incomplete gamma function over z^a e^-z, for z above a + 1."""
    b = z + 1.0 - a
    c = 1.0 / _TINY
    d = fraction = 1.0 / b
    for k in range(1, _TERMS):
        numerator = k * (a - k)
        b += 2.0
        d = numerator * d + b
        d = 1.0 / (d if abs(d) > _TINY else _TINY)
        c = b + numerator / c
        c = c if abs(c) > _TINY else _TINY
        step = c * d
        fraction *= step
        if abs(step - 1.0) < 1e-16:
            break
    return fraction
