"""Tables on terminals of any width, and in pipes."""

import io

import pytest
from rich.console import Console
from rich.table import Table

from thermoctl.studies.tables import print_whole, width_of

NAMES = ("what", "one", "two\nlines", "three", "four")
ROWS = [(f"row {row}", *(f"{row}.{place} ± 0.5 " for place in range(4))) for row in range(3)]


def a_table(words=1):
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    for place, name in enumerate(NAMES):
        justify = "left" if place < words else "right"
        table.add_column(name, justify=justify, no_wrap=True, vertical="bottom")
    for row in ROWS:
        table.add_row(*row)
    return table


def printed(width, *, terminal=True, words=1):
    file = io.StringIO()
    console = Console(file=file, width=width, force_terminal=terminal, color_system=None)
    print_whole(console, a_table(words))
    return file.getvalue()


@pytest.mark.parametrize("width", range(20, 71))
def test_no_figure_is_broken_whatever_the_width_of_the_terminal(width):
    text = printed(width)
    assert max(map(len, text.splitlines())) <= width
    for row in ROWS:
        for cell in row:
            assert cell.strip() in text


def test_every_part_begins_with_what_its_rows_are_about():
    parts = printed(40).split("\n\n")
    assert len(parts) > 1
    for part in parts:
        assert [line[:5] for line in part.splitlines()][-3:] == ["row 0", "row 1", "row 2"]


def test_a_table_that_fits_is_in_one_part():
    console = Console(file=io.StringIO(), width=80)
    assert "\n\n" not in printed(width_of(console, a_table()))
    assert "\n\n" in printed(width_of(console, a_table()) - 1)


def test_in_a_pipe_a_row_is_a_line_however_long():
    lines = printed(20, terminal=False).splitlines()
    assert len(lines) == 2 + len(ROWS)
    assert [line.split()[:2] for line in lines[2:]] == [["row", "0"], ["row", "1"], ["row", "2"]]


@pytest.mark.parametrize("terminal", [True, False])
def test_no_line_ends_in_spaces(terminal):
    for line in printed(40, terminal=terminal).splitlines():
        assert line == line.rstrip()


def test_every_column_of_words_before_the_figures_says_what_a_row_is_about():
    parts = printed(45, words=2).split("\n\n")
    assert len(parts) > 1
    for part in parts:
        assert "0.0 ± 0.5" in part


def test_headings_keep_their_style_in_every_part():
    file = io.StringIO()
    print_whole(Console(file=file, width=30, force_terminal=True), a_table())
    assert file.getvalue().count("\x1b[1m") >= len(NAMES)
