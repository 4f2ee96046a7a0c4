r"""Minimum variance as a benchmark, from routine data of a closed loop.

What a loop does within its delay d is the same under every law: no power given now is felt sooner.
So of the control error as a moving average of its own innovations,

.. math:: e_t = \sum_{i \ge 0} \psi_i a_{t-i}, \qquad
    \sigma^2_{mv} = \sigma_a^2 \sum_{i=0}^{d-1} \psi_i^2, \qquad
    \eta = \sigma^2_{mv} / \sigma^2_e

the first d terms are the variance that no law falls below (Harris 1989), and the index is 1 for
minimum variance control. The innovations come from an autoregression by least squares, the error
of the index from Desborough and Harris (1992).

Explained in ``docs/insight.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from thermoctl.quantities import Array

ORDER = 30
"""Number of past errors in the autoregression."""

LONGEST = 600
"""Largest number of weights of the moving average that are looked at."""

FEWEST = 10
"""Least number of samples for each of them."""


@dataclass(frozen=True, slots=True)
class Harris:
    """The index of a stretch of control errors.

    Parameters
    ----------
    index : float
        Minimum variance over the variance that there is, in [0, 1].
    index_sd : float
        Its standard deviation.
    deviation_k, bound_k : float
        Square roots of the two variances, in K.
    """

    index: float
    index_sd: float
    deviation_k: float
    bound_k: float

    @property
    def ratio(self) -> float:
        """How many times the bound the deviation is."""
        return self.deviation_k / self.bound_k


def harris(error: Array, delay: int, order: int = ORDER) -> Harris | None:
    """Return the index of control errors; None: still, or too few.

    Parameters
    ----------
    error : ndarray, shape (N,)
        Set point minus reading or the other way, evenly sampled; its mean is taken off.
    delay : int
        d, samples from a power to the first reading that feels it, at least 1.
    order : int
        Past errors in the autoregression.

    Raises
    ------
    ValueError
        `delay` or `order` is below 1.
    """
    if delay < 1 or order < 1:
        raise ValueError(f"delay and order must be at least 1, got {delay!r} and {order!r}")
    if len(error) < max(FEWEST * order, 4 * delay):
        return None
    e, N = error - error.mean(), len(error)
    variance = float(e @ e) / N
    if not variance > 1e-18:
        return None
    coefficients, innovation_var = autoregression(e, order)
    psi = impulse_response(coefficients, max(delay, min(N // 4, LONGEST)))
    least = innovation_var * float(psi[:delay] @ psi[:delay])
    index = min(1.0, least / variance)
    sd = index * math.sqrt(4.0 / N * _spread(psi, delay))
    return Harris(index, sd, math.sqrt(variance), math.sqrt(index * variance))


def autoregression(e: Array, order: int) -> tuple[Array, float]:
    """Return coefficients of e on its past, shape (order,), and what is left.

    Least squares by its normal equations, with the variance per degree of freedom.
    """
    rows = len(e) - order
    past = np.lib.stride_tricks.sliding_window_view(e, order)[:rows, ::-1]
    now = e[order:]
    G = past.T @ past
    G[np.diag_indices(order)] *= 1.0 + 1e-10  # a stretch without noise is still solved
    coefficients = np.asarray(np.linalg.solve(G, past.T @ now), dtype=np.float64)
    left = now - past @ coefficients
    return coefficients, float(left @ left) / max(1, rows - order)


def impulse_response(coefficients: Array, length: int) -> Array:
    """Return the first weights psi of an autoregression, shape (length,)."""
    psi = np.zeros(length)
    psi[0] = 1.0
    for i in range(1, length):
        reach = min(i, len(coefficients))
        psi[i] = coefficients[:reach] @ psi[i - reach : i][::-1]
    return psi


def autocorrelation(e: Array, lags: int) -> Array:
    """Return the autocorrelations at lags 0 to `lags`, shape (lags + 1,)."""
    size = 1 << (len(e) + lags).bit_length()
    spectrum = np.fft.rfft(e, size)
    r = np.fft.irfft(spectrum * spectrum.conj(), size)[: lags + 1]
    return np.asarray(r / r[0], dtype=np.float64)


def _spread(psi: Array, delay: int) -> float:
    """Return the bracket of the variance of the index by Desborough and Harris (1992).

    Autocorrelations are those of the model: those of the samples have errors that add up.
    """
    within = _correlations(psi[:delay])
    r = _correlations(psi)
    early = r[1:delay] - within[1:]
    return float(early @ early + r[delay:] @ r[delay:])


def _correlations(psi: Array) -> Array:
    """Return the autocorrelations of a moving average, lag 0 first."""
    return autocorrelation(psi, len(psi) - 1)
