r"""The gain of a plant, estimated on a stretch of samples whose noise is known.

.. math:: \Delta y_k = \beta h\, q_k - d - c\,(y_{k-1} - \bar y) + \nu_k

with q the power as it is felt. A loop that holds its set point answers noise with power, so least
squares would see its law as much as the plant, and the more so when the noise is fitted along with
the gain. Therefore the noise is learnt once, as an autoregression of :math:`\nu` at a time when the
gain was known, and both sides pass through it before they are compared.

Explained in ``docs/insight.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from thermoctl.insight.harris import autoregression
from thermoctl.insight.lagged_power import felt
from thermoctl.quantities import Array, Uncertain

NOISE_ORDER = 40
"""Number of past disturbances in the autoregression of the noise."""

SKIPPED_LAGS = 4.0
"""Time in lags that is left out at the beginning: power from before it, which is unknown, still
shows."""

LEVEL_K = 1.5
"""Range of temperatures in K beyond which they show how the loss grows with them."""


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """Samples without a gap, shape (N,): readings in degC, and the power before each."""

    reading_c: Array
    applied: Array
    period_s: float

    def __len__(self) -> int:
        return len(self.reading_c)

    def moves(self, lag_s: float) -> tuple[Array, Array]:
        """Return what the reading moves by, and the power felt in that time."""
        q = felt(self.applied, lag_s, self.period_s)
        skip = math.ceil(SKIPPED_LAGS * lag_s / self.period_s)
        return np.diff(self.reading_c)[skip:], q[1:][skip:]


@dataclass(frozen=True, slots=True)
class Assay:
    """What a stretch says of the plant.

    Parameters
    ----------
    gain : Uncertain
        Heating rate at full power in K/s.
    slope : Uncertain or None
        How the loss grows with the temperature, in 1/s; None where that hardly moved.
    """

    gain: Uncertain
    slope: Uncertain | None = None


def noise_of(stretch: Stretch, lag_s: float, gain_k_per_s: float) -> Array | None:
    """Return what whitens a stretch at rest, shape (n,); None: too short.

    Parameters
    ----------
    stretch : Stretch
        At rest.
    lag_s, gain_k_per_s : float
        Of the plant, known from elsewhere.
    """
    moves, q = stretch.moves(lag_s)
    if len(moves) < 10 * NOISE_ORDER:
        return None
    left = moves - gain_k_per_s * stretch.period_s * q
    left = left - left.mean()
    if not float(left @ left) > 1e-18:
        return None
    coefficients, _ = autoregression(left, NOISE_ORDER)
    return np.concatenate(([1.0], -coefficients))


def assay(stretch: Stretch, lag_s: float, whitener: Array) -> Assay | None:
    """Return what a stretch says of the plant; None where it says nothing.

    Parameters
    ----------
    stretch : Stretch
        Samples in which nothing but the heater warmed or cooled.
    lag_s : float
        Total lag of the plant.
    whitener : ndarray, shape (n,)
        From `noise_of`.
    """
    moves, q = stretch.moves(lag_s)
    if len(moves) < 4 * len(whitener):
        return None
    level = stretch.reading_c[len(stretch) - len(moves) - 1 : -1]
    columns = [q * stretch.period_s, np.ones_like(q)]
    levels = float(np.ptp(level)) > LEVEL_K
    if levels:
        columns.append((level - level.mean()) * stretch.period_s)
    X = np.column_stack([np.convolve(each, whitener, "valid") for each in columns])
    y = np.convolve(moves, whitener, "valid")
    G = X.T @ X
    try:
        inverse = np.linalg.inv(G)
    except np.linalg.LinAlgError:
        return None
    theta = inverse @ (X.T @ y)
    left = y - X @ theta
    variance = float(left @ left) / max(1, len(y) - len(theta))
    sd = np.sqrt(np.maximum(np.diag(inverse) * variance, 0.0))
    if not (np.isfinite(theta).all() and np.isfinite(sd).all()):
        return None
    slope = Uncertain(-float(theta[2]), float(sd[2])) if levels else None
    return Assay(Uncertain(float(theta[0]), float(sd[0])), slope)
