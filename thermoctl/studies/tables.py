"""Tables written whole: wrapped between columns, never within a figure."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

_ROOMY = 10_000


def print_whole(console: Console, table: Table) -> None:
    """Print `table`; columns that a terminal has no room for follow below it.

    Every part begins with the first columns, those of words, which say what a row is about. Into a
    file or a pipe a row goes as one line, however long. No line ends in spaces.

    Parameters
    ----------
    console : Console
        Where to.
    table : Table
        Has no box; a column is as wide as its widest cell. Words stand left, figures right.
    """
    for place, part in enumerate(_parts(console, table) if console.is_terminal else [table]):
        if place:
            console.print()
        _print(console, part)


def width_of(console: Console, table: Table) -> int:
    """Return how many characters wide `table` is when nothing of it is cut."""
    return Measurement.get(console, console.options.update(width=_ROOMY), table).maximum


def _parts(console: Console, table: Table) -> list[Table]:
    """Return tables that fit `console`, each with as many columns as go in; at least one."""
    figures = [place for place, column in enumerate(table.columns) if column.justify == "right"]
    first = list(range(max(1, figures[0]) if figures else 1))
    parts: list[Table] = []
    chosen: list[int] = []
    for place in range(len(first), len(table.columns)):
        wider = _of_columns(table, [*first, *chosen, place])
        if chosen and width_of(console, wider) > console.width:
            parts.append(_of_columns(table, [*first, *chosen]))
            chosen = []
        chosen.append(place)
    return [*parts, _of_columns(table, [*first, *chosen])] if parts else [table]


def _of_columns(table: Table, places: Sequence[int]) -> Table:
    """Return the columns of `table` at `places` as a table of their own."""
    columns = [table.columns[place] for place in places]
    part = Table(
        box=None,
        pad_edge=False,
        padding=table.padding,
        show_header=table.show_header,
        header_style=table.header_style,
    )
    for column in columns:
        part.add_column(
            column.header, justify=column.justify, vertical=column.vertical, no_wrap=True
        )
    for row in zip(*(column.cells for column in columns), strict=True):
        part.add_row(*row)
    return part


def _print(console: Console, table: Table) -> None:
    """Print every line as it is: a terminal wraps one that is too long, rich would cut it."""
    options = console.options.update(width=max(console.width, width_of(console, table)))
    for segments in console.render_lines(table, options, pad=False):
        line = Text.assemble(*((each.text, each.style or "") for each in segments))
        line.rstrip()
        console.print(line, soft_wrap=True, highlight=False)
