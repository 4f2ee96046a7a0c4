"""How a belief begins, and the checks every constructor of this room shares.

Implements section 2 of ``docs/theory.md``.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from thermoctl.quantities import Array, frozen, is_finite_number
from thermoctl.signals import Estimate

LARGEST = 1e50
"""No regressor, parameter, variance or normalised innovation squared is let past this.

It is beyond every meaning, and within it no product in this room can overflow.
"""

SANE = 1e10
"""What stays within this was rejected nowhere, and need not be looked at sample by sample."""

SHOWN = 200
"""Characters of a refused value that a message repeats."""


def start(n: int, P0: float | npt.ArrayLike = 1.0, theta0: npt.ArrayLike | None = None) -> Estimate:
    """Return the belief before the first sample.

    Parameters
    ----------
    n : int
        Number of parameters, at least 1.
    P0 : float or array_like, shape (n, n)
        Covariance the first update starts from, unchanged; a float stands for ``P0 * I``.
    theta0 : array_like, shape (n,), optional
        First guess of the parameters; zeros by default.

    Raises
    ------
    ValueError
        `n` is no positive integer; `P0` is not finite, symmetric and positive semi-definite of
        that size; `theta0` does not lie below `LARGEST` or is not of that shape.
    """
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1:
        raise ValueError(f"n must be a positive integer, got {n!r}")
    return Estimate(_parameters("theta0", theta0, int(n)), covariance("P0", P0, int(n)))


def covariance(name: str, value: float | npt.ArrayLike, n: int | None = None) -> Array:
    """Return a read-only covariance matrix from a matrix or a float times I.

    Raises
    ------
    ValueError
        `value` is not finite, symmetric and positive semi-definite, or not of shape (n, n).
    """
    matrix = numbers(name, value)
    if matrix.ndim not in (0, 2) or matrix.size == 0:
        raise ValueError(f"{name} must be a float or a square matrix, got shape {matrix.shape}")
    if matrix.ndim == 0 and n is not None:
        matrix = float(matrix) * np.eye(n)
    size = matrix.shape[0] if n is None and matrix.ndim else n
    if matrix.shape != (size, size):
        raise ValueError(f"{name} must be a float or of shape ({size}, {size}), got {matrix.shape}")
    scale = _largest(name, matrix)
    if np.abs(matrix - matrix.T).max() > 1e-9 * scale:
        raise ValueError(f"{name} must be symmetric, got {matrix.tolist()}")
    matrix = 0.5 * (matrix + matrix.T)
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    if smallest < -1e-9 * scale:
        raise ValueError(
            f"{name} must be positive semi-definite, its smallest eigenvalue is {smallest:g}"
        )
    return frozen(matrix)


def positive(name: str, value: float, at_most: float = LARGEST) -> None:
    """Raise ``ValueError`` unless `value` is a number in [1/LARGEST, at_most]."""
    if is_finite_number(value) and 1.0 / LARGEST <= value <= at_most:
        return
    limit = "" if at_most == LARGEST else f" and at most {at_most:g}"
    if is_finite_number(value) and value > 0.0:
        limit = f", from {1.0 / LARGEST:g} to {at_most:g}"
    raise ValueError(f"{name} must be positive{limit}, got {shown(value)}")


def truth(name: str, value: object) -> None:
    """Raise ``ValueError`` unless `value` is True or False."""
    if not isinstance(value, bool):
        raise ValueError(f"{name} must be True or False, got {shown(value)}")  # noqa: TRY004


def numbers(name: str, value: npt.ArrayLike) -> Array:
    """Return `value` as a new array of finite floats; ``ValueError`` if not."""
    array = floats(name, value).copy()
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, got {shown(value)}")
    return array


def bounded(name: str, value: npt.ArrayLike) -> Array:
    """Return `value` as a new array of floats below `LARGEST`; ``ValueError`` if not."""
    array = numbers(name, value)
    if array.size:
        _largest(name, array)
    return array


def scalar(name: str, value: float | npt.ArrayLike) -> float:
    """Return `value` as a plain float; ``ValueError`` when it is no number."""
    if isinstance(value, float):
        return float(value)  # also of numpy's own, which would warn where a plain one overflows
    try:
        number = floats(name, value)
    except ValueError as error:
        raise ValueError(f"{name} must be a number, got {shown(value)}") from error
    if number.ndim:
        raise ValueError(f"{name} must be a single number, got {shown(value)}")
    return float(number)


def floats(name: str, value: npt.ArrayLike) -> Array:
    """Return `value` as an array of floats, or raise ``ValueError`` naming it.

    Text, truth values and complex numbers are no numbers here, though NumPy would convert them.
    """
    try:
        given = np.asarray(value)
        if given.dtype.kind == "O":
            given = given + 0.0  # which None and text cannot do, though NumPy would convert them
        if given.dtype.kind not in "bcSU":
            return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name} must consist of numbers, got {shown(value)}") from error
    raise ValueError(f"{name} must consist of numbers, got {shown(value)}")


def shown(value: object) -> str:
    """Return `value` as one short line for a message."""
    text = repr(value.tolist() if isinstance(value, np.ndarray) else value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def _largest(name: str, array: Array) -> float:
    """Return the largest magnitude in `array`, or raise ``ValueError`` if it is past all use."""
    largest = float(np.abs(array).max())
    if not largest < LARGEST:
        raise ValueError(f"{name} must lie below {LARGEST:g}, got {largest:g}")
    return largest


def _parameters(name: str, value: npt.ArrayLike | None, n: int) -> Array:
    """Return the first guess, read-only; zeros where none is given."""
    theta = np.zeros(n) if value is None else bounded(name, value)
    if theta.shape != (n,):
        raise ValueError(f"{name} must have shape ({n},), got {theta.shape}")
    return frozen(theta)


def sane(values: Array) -> bool:
    """Return whether all `values` lie within `SANE`; false for NaN."""
    flat = values.ravel()  # one pass for the sum of squares; the extremes would take two
    return bool(flat.dot(flat) < SANE * SANE)
