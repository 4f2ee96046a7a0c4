"""The charts: temperature, deviation and power above one time axis.

Time runs to the right and now is at the right edge. Nothing is smoothed or drawn over a gap;
a dot column shows the least and the greatest value that fell into it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from rich.text import Text

from thermoctl.app.live import braille, numbers, trend
from thermoctl.app.live.grid import Grid
from thermoctl.app.live.look import Look, Role
from thermoctl.app.live.model import View
from thermoctl.app.live.rows import fitted
from thermoctl.app.live.scale import tick_for
from thermoctl.app.live.sentences import Mark
from thermoctl.quantities import Array

LEFT, RIGHT = 7, 10
"""Cells beside a plot: axis labels, and direct labels of up to eight, such as −25.02 K."""

DEVIATION_SCALE_MK = 100.0
DEVIATION_BAND_MK = 30.0
_LABEL_CELLS = 10
_DAY_S = 86_400.0


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """What the charts of a view share: one column is one time in all.

    Parameters
    ----------
    table : ndarray, shape (15, 2 * cells)
        The run, a dot column each; rows as in `thermoctl.app.live.trend`.
    left_s, cell_s : float
        Loop time of the left edge, and length of a cell.
    first_cell : int
        Number of the leftmost cell, counted from the start of the run.
    """

    view: View
    look: Look
    cells: int
    table: Array
    left_s: float
    cell_s: float
    first_cell: int

    def cell_at(self, t_s: float) -> int:
        """Return the cell that holds `t_s`; may lie outside."""
        position = (t_s - self.left_s) / self.cell_s
        return math.floor(position) if math.isfinite(position) else -1

    def row(self, label: str, grid: Grid, row: int, gutter: tuple[str, Role]) -> Text:
        """Return one row of a chart: axis label, plot, direct label."""
        line = self.look.text(
            (f"{label:>{LEFT - 1}} ", Role.MUTE), *grid.parts(row), ("  ", Role.PAGE), gutter
        )
        return fitted(line, LEFT + self.cells + RIGHT)


def frame(view: View, look: Look, width: int) -> Frame:
    """Return the common frame of the charts of `view` in `width` cells."""
    cells = width - LEFT - RIGHT
    column_s = view.range_s / (2 * cells)
    known = math.isfinite(view.trend.origin_s) and math.isfinite(view.now_s)
    first = view.trend.first_column(view.now_s, column_s, 2 * cells) if known else 0
    return Frame(
        view=view,
        look=look,
        cells=cells,
        table=view.trend.columns(view.now_s, column_s, 2 * cells),
        left_s=view.trend.origin_s + first * column_s,
        cell_s=2.0 * column_s,
        first_cell=first // 2,
    )


def _curve(low: Array, high: Array, rows: int, look: Look) -> list[str]:
    """Return the envelope between two heights, in dots, as rows of cells."""
    dots = braille.envelope(*braille.joined(low, high), rows * braille.DOTS_HIGH)
    return braille.cells(dots, utf8=look.utf8)


def _dotted(levels: Array, rows: int, every: int, look: Look) -> list[str]:
    """Return a dotted line at `levels`, in dots from the bottom, one for each dot column."""
    sparse = np.where(np.arange(levels.size) % every == 0, levels, np.nan)
    dots = braille.envelope(sparse, sparse, rows * braille.DOTS_HIGH)
    return braille.cells(dots, utf8=look.utf8, mark=".")


def _row_of(level: float, rows: int) -> int:
    """Return the row, from the top, that holds a height in dots; -1 when it is outside."""
    if not 0.0 <= level <= rows * braille.DOTS_HIGH - 1:
        return -1
    return rows - 1 - int(level) // braille.DOTS_HIGH


def _changes(chart: Frame, grid: Grid, *, named: bool) -> None:
    """Paint a dotted line at every change point, with its time and words where there is room."""
    zero = chart.view.facts.zero
    for event in chart.view.events:
        at = chart.cell_at(event.t_s)
        if event.mark is not Mark.CHANGE or not 0 <= at < chart.cells:
            continue
        when = numbers.wall_time(zero, event.t_s, "%H:%M")
        if named and not _named(grid, at, f"{when} {event.text}"):
            _named(grid, at, f"{when} {event.text.partition(',')[0]}")
        for row in range(grid.rows):
            grid.put(row, at, "┊", Role.BLUE)


def _named(grid: Grid, at: int, words: str) -> bool:
    """Write `words` beside column `at` where there is room for all of them; return if so."""
    for row in range(grid.rows - 1, -1, -1):
        for begin in (at + 2, at - 1 - len(words)):
            if grid.free(row, begin - 1, begin + len(words)):
                grid.put(row, begin, words.replace(" ", numbers.NBSP), Role.BLUE)
                return True
    return False


def _unknown_end(chart: Frame, grid: Grid) -> None:
    """Hatch the end of a chart whose data are stale."""
    if not chart.view.stale:
        return
    begin = max(0, chart.cell_at(chart.view.last_good_s) + 1)
    for row in range(grid.rows):
        grid.put(row, begin, "╱" * (chart.cells - begin), Role.RULE)


def temperature(chart: Frame, rows: int) -> list[Text]:
    """Return the chart of the temperature, whole, with the set point dotted."""
    view, look, scale = chart.view, chart.look, chart.view.scale
    grid, dots = Grid(rows, chart.cells), rows * braille.DOTS_HIGH
    labels, gutters = [""] * rows, [("", Role.PAGE)] * rows
    if not scale.known:
        words = "no data yet"
        grid.put(rows // 2, (chart.cells - len(words)) // 2, words, Role.MUTE)
        return [chart.row("", grid, row, ("", Role.PAGE)) for row in range(rows)]

    def level(values: Array) -> Array:
        return braille.heights(values, scale.low, scale.high, dots)

    low, high = (
        level(chart.table[trend.TEMPERATURE_LOW]),
        level(chart.table[trend.TEMPERATURE_HIGH]),
    )
    grid.paint(_curve(low, high, rows, look), Role.INK)
    _changes(chart, grid, named=True)
    _unknown_end(chart, grid)
    grid.paint(_dotted(level(chart.table[trend.SETPOINT]), rows, 4, look), Role.MUTE)
    for value_c, label in scale.labels():
        labels[_row_of(float(level(np.array(value_c))), rows)] = label

    value_row = _row_of(float(level(np.array(view.temperature_c))), rows)
    if value_row >= 0:
        gutters[value_row] = (numbers.number(view.temperature_c, 2), Role.STRONG)
    set_row = _row_of(float(level(np.array(view.setpoint_c))), rows)
    if set_row >= 0 and set_row == value_row:
        set_row += 1 if set_row + 1 < rows else -1
    if set_row >= 0:
        gutters[set_row] = ("·· set", Role.MUTE)
    return [chart.row(labels[row], grid, row, gutters[row]) for row in range(rows)]


def _off_scale(chart: Frame, outside: braille.Dots, known: braille.Dots, edge: str) -> str:
    """Return which cells get a mark: wholly off the scale, the first and every third of a run.

    `edge` is the row the marks go to: a line that leaves the scale there shows it already.
    """
    pairs_out, pairs_known = outside.reshape(-1, 2), known.reshape(-1, 2)
    off = np.any(pairs_out, axis=1) & np.all(pairs_out | ~pairs_known, axis=1)
    off &= np.array([cell == " " for cell in edge])
    begins = off & ~np.concatenate([[False], off[:-1]])
    third = (chart.first_cell + np.arange(chart.cells)) % 3 == 0
    return "".join("x" if marked else " " for marked in (off & (begins | third)).tolist())


def deviation(chart: Frame, rows: int) -> list[Text]:
    """Return the chart of the deviation within ±100 mK, marked where it leaves."""
    view, look = chart.view, chart.look
    grid, dots = Grid(rows, chart.cells), rows * braille.DOTS_HIGH
    low_mk, high_mk = chart.table[trend.DEVIATION_LOW], chart.table[trend.DEVIATION_HIGH]

    def level(values: Array) -> Array:
        return braille.heights(values, -DEVIATION_SCALE_MK, DEVIATION_SCALE_MK, dots)

    even = np.arange(2 * chart.cells) % 2 == 0
    limits = braille.blank(rows, chart.cells)
    for band_mk in (DEVIATION_BAND_MK, -DEVIATION_BAND_MK):
        limits[dots - 1 - int(level(np.array(band_mk))), even] = True
    curve = braille.envelope(*braille.joined(level(low_mk), level(high_mk)), dots)
    # The dots of the band go on through the cells of the curve, or it would hide its own limits.
    drawn = curve | (limits & braille.occupied(curve))
    lines = braille.cells(drawn, utf8=look.utf8)
    grid.paint(lines, Role.INK)
    known = ~np.isnan(low_mk)
    above = _off_scale(chart, low_mk > DEVIATION_SCALE_MK, known, lines[0])
    below = _off_scale(chart, high_mk < -DEVIATION_SCALE_MK, known, lines[-1])
    grid.put(0, 0, above.replace("x", "▴"), Role.MUTE)
    grid.put(rows - 1, 0, below.replace("x", "▾"), Role.MUTE)
    _changes(chart, grid, named=False)
    _unknown_end(chart, grid)
    grid.paint(braille.cells(limits, utf8=look.utf8, mark="."), Role.MUTE)

    labels, gutters = [""] * rows, [("", Role.PAGE)] * rows
    labels[0], labels[-1] = "+100", "−100"
    if rows % 2:
        labels[rows // 2] = "0"
    bounded_mk = float(np.clip(1e3 * view.deviation_k, -DEVIATION_SCALE_MK, DEVIATION_SCALE_MK))
    row = _row_of(float(level(np.array(bounded_mk))), rows)
    if row >= 0:
        gutters[row] = (numbers.difference(view.deviation_k), Role.STRONG)
    return [chart.row(labels[row], grid, row, gutters[row]) for row in range(rows)]


def power(chart: Frame, rows: int) -> list[Text]:
    """Return the strip of accepted power: mean as an area, extremes as dots.

    It reaches below zero from the first power on that does.
    """
    look, dots = chart.look, rows * braille.DOTS_HIGH
    grid = Grid(rows, chart.cells)
    cools = bool((chart.view.trend.table[trend.POWER_LOW] < 0.0).any())
    count = chart.table[trend.POWER_COUNT]
    mean = chart.table[trend.POWER_SUM] / np.where(count > 0.0, count, np.nan)

    def level(values: Array) -> Array:
        return braille.heights(values, -1.0 if cools else 0.0, 1.0, dots)

    zero, top, bottom = (
        level(each)
        for each in (np.zeros(1), chart.table[trend.POWER_HIGH], chart.table[trend.POWER_LOW])
    )
    drawn = braille.envelope(np.minimum(zero, level(mean)), np.maximum(zero, level(mean)), dots)
    if look.utf8:
        drawn |= braille.envelope(top, top, dots)
        drawn |= braille.envelope(bottom, bottom, dots) if cools else False
    grid.paint(braille.cells(drawn, utf8=look.utf8, mark="#"), Role.SLATE)
    labels, gutters = [""] * rows, [("", Role.PAGE)] * rows
    labels[0], labels[-1] = "100 %", "−100 %" if cools else "0"
    gutters[0] = ("power", Role.MUTE)
    gutters[-1] = (numbers.power(chart.view.accepted_power), Role.STRONG)
    return [chart.row(labels[row], grid, row, gutters[row]) for row in range(rows)]


def time_axis(chart: Frame) -> Text:
    """Return the row of wall times, each under its own column."""
    zero, grid = chart.view.facts.zero, Grid(1, chart.cells)
    tick_s = tick_for(chart.view.range_s, max(1, chart.cells // _LABEL_CELLS))
    pattern = "%H:%M:%S" if tick_s < 60.0 else "%H:%M" if tick_s < _DAY_S else "%d %b"
    midnight_s = zero.hour * 3600.0 + zero.minute * 60.0 + zero.second + 1e-6 * zero.microsecond
    if math.isfinite(chart.left_s):
        first = math.ceil((chart.left_s + midnight_s) / tick_s)
        for number in range(first, first + chart.cells // _LABEL_CELLS + 1):
            t_s = number * tick_s - midnight_s
            words = numbers.wall_time(zero, t_s + 1e-3, pattern)
            begin = chart.cell_at(t_s) - len(words) // 2
            if grid.free(0, begin, begin + len(words) - 1):
                grid.put(0, begin, words, Role.MUTE)
    return chart.row("", grid, 0, ("", Role.PAGE))
