r"""The powers that cost least over a horizon, within their bounds.

.. math::

    J = \sum_{j=1}^{N} (\hat y(t+j) - r)^2 + \lambda \sum_{i=1}^{N_u} (u_i - u_{i-1})^2

Its minimum under bounds is found exactly, by an active set: with a handful of moves that is a few
small systems of equations, and with none at a bound a single one.

Implements section 10 of ``docs/theory.md``.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from thermoctl.quantities import Array

Bools = npt.NDArray[np.bool_]

_ROUNDS = 60
"""Ends in a handful: every round leaves the cost smaller and visits a set at most once."""
_SLACK = 1e-9
"""Share of the largest slope by which a bound may seem worth leaving from rounding alone."""


def best_powers(
    errors_k: Array,
    step_k: Array,
    moves: int,
    weight: float,
    last: float,
    most: float,
    later: tuple[Array, Array] | None = None,
) -> Array:
    """Return the `moves` powers of least cost; the last of them is then kept.

    Parameters
    ----------
    errors_k : ndarray, shape (length,)
        Set point minus what comes without any power from now on.
    step_k : ndarray, shape (length,)
        Response to a step of full power.
    moves : int
        How many blocks have a power of their own.
    weight : float
        lambda, in K².
    last : float
        The power before the first move.
    most : float
        Powers lie in [0, most].
    later : tuple of ndarray, shapes (moves, moves) and (moves,), or None
        H and g of a cost beyond those errors; see `bounded_minimum`.
    """
    length = len(step_k)
    response = np.zeros((length, moves))  # to each power for as long as it lasts
    for i in range(moves):
        response[i:, i] = step_k[: length - i]
        if i + 1 < moves:
            response[i + 1 :, i] -= step_k[: length - i - 1]
    H = response.T @ response
    g = errors_k @ response
    diagonal = H.reshape(-1)[:: moves + 1]
    diagonal += 2.0 * weight
    diagonal[-1] -= weight
    for i in range(moves - 1):
        H[i, i + 1] -= weight
        H[i + 1, i] -= weight
    g[0] += weight * last
    if later is not None:
        H += later[0]
        g += later[1]
    return bounded_minimum(H, g, most)


def bounded_minimum(H: Array, g: Array, most: float) -> Array:
    """Return the x in [0, most] at which ``x' H x / 2 - g' x`` is least.

    Parameters
    ----------
    H : ndarray, shape (moves, moves)
        Symmetric and positive definite.
    g : ndarray, shape (moves,)
        What pulls x upwards.
    most : float
        Upper bound of each, positive.
    """
    x: Array = np.asarray(np.linalg.solve(H, g), dtype=np.float64)
    if x.min() >= 0.0 and x.max() <= most:
        return x
    x = np.minimum(np.maximum(x, 0.0), most)
    free: Bools = (x > 0.0) & (x < most)
    slack = _SLACK * float(np.abs(g).max() + np.abs(H).max() * most)
    for _ in range(_ROUNDS):
        if free.any():
            target = x.copy()
            fixed = np.logical_not(free)
            held = g[free] - H[np.ix_(free, fixed)] @ x[fixed]
            target[free] = np.linalg.solve(H[np.ix_(free, free)], held)
            x, blocked = _towards(x, target, most)
            free &= np.logical_not(blocked)
            if blocked.any():
                continue
        slope = g - H @ x  # where it points, the cost falls
        worth = np.where(free, 0.0, np.where(x > 0.0, -slope, slope))
        leaving = int(worth.argmax())
        if worth[leaving] <= slack:
            break
        free[leaving] = True
    return x


def _towards(x: Array, target: Array, most: float) -> tuple[Array, Bools]:
    """Return the point on the way to `target` at the first bound, and what is blocked there."""
    step = target - x
    bound = np.where(step > 0.0, most, 0.0)
    room = np.full(len(x), np.inf)
    np.divide(bound - x, step, out=room, where=step != 0.0)
    share = float(room.min())
    if share >= 1.0:
        return target, np.zeros(len(x), dtype=np.bool_)
    blocked: Bools = room <= share
    there: Array = np.where(blocked, bound, x + share * step)
    return there, blocked
