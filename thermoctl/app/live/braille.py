"""Dots on a character grid: each cell is two dots wide and four high."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from thermoctl.quantities import Array

Dots = npt.NDArray[np.bool_]

DOTS_WIDE, DOTS_HIGH = 2, 4

_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.int64)
"""Unicode numbers the dots of a braille cell by column; rows 1 to 3 first, row 4 later."""

_BLANK = 0x2800


def blank(rows: int, columns: int) -> Dots:
    """Return an empty grid of ``4 rows`` by ``2 columns`` dots, row 0 at the top."""
    return np.zeros((rows * DOTS_HIGH, columns * DOTS_WIDE), dtype=np.bool_)


def heights(values: Array, low: float, high: float, dots: int) -> Array:
    """Return where `values` lie on the scale from `low` to `high`, in dots."""
    return np.rint((values - low) * ((dots - 1) / (high - low)))


def envelope(low: Array, high: Array, dots: int) -> Dots:
    """Return a grid, `dots` high, filled from `low` to `high` in each dot column.

    Parameters
    ----------
    low, high : ndarray, shape (columns,)
        Heights in dots from the bottom, as `heights` gives them. A column that is NaN, or lies
        wholly above or below, stays empty.
    dots : int
        Height of the grid.
    """
    row = np.arange(dots - 1, -1, -1, dtype=np.float64)[:, None]
    return (row >= low) & (row <= high)  # comparisons with NaN are false


def joined(low: Array, high: Array) -> tuple[Array, Array]:
    """Return the envelope stretched to touch its left neighbour.

    Nothing is drawn over a gap: beside a NaN a column keeps its own extent.
    """
    before_low, before_high = np.full_like(low, np.nan), np.full_like(high, np.nan)
    before_low[1:], before_high[1:] = low[:-1], high[:-1]
    return (
        np.where(low > before_high + 1.0, before_high + 1.0, low),
        np.where(high < before_low - 1.0, before_low - 1.0, high),
    )


def occupied(dots: Dots) -> Dots:
    """Return `dots` with every dot of a cell set where any of them is."""
    rows, columns = dots.shape[0] // DOTS_HIGH, dots.shape[1] // DOTS_WIDE
    some = dots.reshape(rows, DOTS_HIGH, columns, DOTS_WIDE).any(axis=(1, 3))
    return np.repeat(np.repeat(some, DOTS_HIGH, axis=0), DOTS_WIDE, axis=1)


def cells(dots: Dots, *, utf8: bool, mark: str = "*") -> list[str]:
    """Return the grid as one string a row; a space where a cell is empty.

    Without UTF-8 a cell that holds any dot is drawn as `mark`.
    """
    rows, columns = dots.shape[0] // DOTS_HIGH, dots.shape[1] // DOTS_WIDE
    blocks = dots.reshape(rows, DOTS_HIGH, columns, DOTS_WIDE)
    codes = np.einsum("rhcw,hw->rc", blocks, _BITS)
    if not utf8:
        return ["".join(mark if code else " " for code in row) for row in codes.tolist()]
    return ["".join(chr(_BLANK + code) if code else " " for code in row) for row in codes.tolist()]
