import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thermoctl.app.live import braille


@pytest.mark.parametrize(
    ("row", "column", "cell"),
    [(0, 0, "⠁"), (1, 0, "⠂"), (2, 0, "⠄"), (3, 0, "⡀"), (0, 1, "⠈"), (3, 1, "⢀")],
)
def test_each_dot_has_its_own_place_in_the_cell(row: int, column: int, cell: str) -> None:
    dots = braille.blank(1, 1)
    dots[row, column] = True
    assert braille.cells(dots, utf8=True) == [cell]


def test_without_utf8_a_cell_with_any_dot_is_a_mark() -> None:
    dots = braille.blank(1, 3)
    dots[2, 1] = dots[0, 5] = True
    assert braille.cells(dots, utf8=False, mark="#") == ["# #"]


columns = arrays(np.float64, 12, elements=st.floats(-5.0, 12.0))


@given(columns, columns)
def test_an_envelope_has_a_dot_at_each_height_from_low_to_high(
    one: np.ndarray, other: np.ndarray
) -> None:
    low, high = np.rint(np.minimum(one, other)), np.rint(np.maximum(one, other))
    dots = braille.envelope(low, high, 8)
    for column in range(12):
        drawn = {7 - row for row in np.flatnonzero(dots[:, column])}
        assert drawn == {h for h in range(8) if low[column] <= h <= high[column]}


def test_nothing_is_drawn_at_or_across_a_gap() -> None:
    level = np.array([0.0, np.nan, 7.0])
    low, high = braille.joined(level, level)
    dots = braille.envelope(low, high, 8)
    assert dots.sum(axis=0).tolist() == [1, 0, 1]


@given(columns)
def test_a_joined_line_touches_its_left_neighbour(level: np.ndarray) -> None:
    level = np.rint(level)
    low, high = braille.joined(level, level)
    gap = np.maximum(low[1:] - level[:-1], level[:-1] - high[1:])
    assert (gap <= 1.0).all()
    assert (low <= level).all()
    assert (level <= high).all()
