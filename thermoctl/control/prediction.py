r"""Prediction over the delay: the samples that a power can no longer change.

With a delay of d samples the power of now meets the temperature d samples on. What lies between is
already decided, by powers that were applied, and is predicted by iterating the model:

.. math::

    \hat y(t+k) = -a_1 \hat y(t+k-1) - \dots - a_n \hat y(t+k-n)
        + b_1 u(t+k-d) + \dots + b_m u(t+k-d-m+1)

with measured temperatures where there are some. For a model that is known, this is the prediction
of least variance; polynomial division of 1 by A gives the same one
(``tests/unit/control/test_prediction.py``). Implements section 5 of ``docs/theory.md``.
"""

from __future__ import annotations

import numpy as np

from thermoctl.model.arx import Arx
from thermoctl.quantities import Array


def predict(structure: Arx, theta: Array, y_past_c: Array, u_past: Array) -> float:
    """Return the next temperature in degC; pasts as in `Arx.regressor`."""
    phi = structure.regressor(y_past_c, u_past)
    return structure.temperature(float(theta.dot(phi)), u_past)  # O21 (1)


def foresee(
    structure: Arx, theta: Array, y_past_c: Array, u_past: Array, samples: int
) -> tuple[Array, Array]:
    """Return both pasts as they will be `samples` later, as far as that is decided.

    Parameters
    ----------
    structure : Arx
        The model.
    theta : ndarray, shape (structure.parameters,)
        Its parameters, taken for the true ones.
    y_past_c : ndarray, shape (n,) or longer
        Temperatures in degC, newest first, without gaps.
    u_past : ndarray, shape (delay + m - 2,) or longer
        Applied powers, newest first, without gaps.
    samples : int
        How far to look; less than ``structure.delay``, or the powers to come would matter.

    Returns
    -------
    y_past_c, u_past : ndarray
        Each longer by `samples`: predictions come before temperatures, and zeros before powers, in
        places that a regressor does not reach.

    Raises
    ------
    ValueError
        `samples` is negative, or not less than the delay.
    """
    if not 0 <= samples < structure.delay:
        raise ValueError(f"samples must be from 0 to {structure.delay - 1}, got {samples!r}")
    for _ in range(samples):
        u_past = np.concatenate(((0.0,), u_past))
        y_past_c = np.concatenate(((predict(structure, theta, y_past_c, u_past),), y_past_c))
    return y_past_c, u_past
