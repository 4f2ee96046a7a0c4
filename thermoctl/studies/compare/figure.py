"""The page of a comparison: every figure a point with a line to its 95 %."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from thermoctl.studies import figure as house
from thermoctl.studies.compare.plants import FLEETS
from thermoctl.studies.compare.score import MEASURES
from thermoctl.studies.compare.summary import Line, Score

MOST_DRAWN = len(house.HUES)
"""Controllers in one figure; one more could not be told from the others in grey."""

MARKERS = ("o", "s", "D", "^")

_ROW_IN, _MARGIN_IN, _GAP_IN = 0.30, 0.62, 0.62
_NAME_IN, _NOTE_IN = 0.14, 0.14
_LEFT, _BESIDE = 0.02, 0.17
_GOAL: Any = {"color": house.MUTE, "linewidth": 0.8}
_MIDDLING, _DOTTED, _DASHED = ("median", "mean"), (1, 1), (4, 2)
_RATIOS, _KELVIN, _SECONDS, _TRAVEL = "times the bound", "K", "s", "full ranges a minute"
_UNITS = {"settled_s": _SECONDS, "travel_per_min": _TRAVEL}


def draw_comparison(
    lines: Sequence[Line], controllers: Sequence[str], paths: Sequence[Path]
) -> list[Path]:
    """Draw every line of a comparison, and return what was written.

    Parameters
    ----------
    lines : sequence of Line
        What is known.
    controllers : sequence of str
        Names; the first `MOST_DRAWN` of them are drawn.
    paths : sequence of Path
        Files, each ending in .png or .svg.

    Raises
    ------
    Unavailable
        If matplotlib is not installed.
    ValueError
        If a suffix is neither .png nor .svg.
    OSError
        If a file cannot be written.
    """
    drawn = list(controllers[:MOST_DRAWN])
    panels = _panels(lines)
    rows = [len(own) for _, own in panels]
    gaps_in = _GAP_IN * (len(rows) - 1)
    notes = _notes(lines, controllers)
    bottom_in = _MARGIN_IN + _NOTE_IN * (len(notes) - 1)
    top_in = _MARGIN_IN + _NAME_IN * len(drawn)
    height_in = _ROW_IN * sum(rows) + gaps_in + top_in + bottom_in
    with house.styled(house.WIDE_IN, height_in, len(panels), 1, height_ratios=rows) as (page, axes):
        page.subplots_adjust(
            left=0.30,
            right=0.965,
            top=1.0 - top_in / height_in,
            bottom=bottom_in / height_in,
            hspace=_GAP_IN / (_ROW_IN * sum(rows) / len(rows)),
        )
        for index, (unit, own) in enumerate(panels):
            panel = axes[index, 0]
            _draw_panel(panel, own, drawn, unit)
            house.letter(panel, "abcd"[index])
        _write_head(page, lines, drawn, height_in)
        for place, note in enumerate(reversed(notes)):
            y = (0.17 + _NOTE_IN * place) / height_in
            page.text(_LEFT, y, note, fontsize=7.5, va="center", color=house.MUTE)
        return [house.save(page, path) for path in paths]


def _panels(lines: Sequence[Line]) -> list[tuple[str, list[Line]]]:
    """Return the lines of each panel under its unit; only panels that have lines."""
    sorted_by: dict[str, list[Line]] = {_RATIOS: [], _KELVIN: [], _SECONDS: [], _TRAVEL: []}
    for line in lines:
        unit = _RATIOS if line.in_bounds else _UNITS.get(line.measure, _KELVIN)
        sorted_by[unit].append(line)
    return [(unit, own) for unit, own in sorted_by.items() if own]


def _draw_panel(panel: Any, lines: Sequence[Line], drawn: Sequence[str], unit: str) -> None:
    """Draw one row for each line, in it one point for each controller."""
    figures = [
        value
        for line in lines
        for name in drawn
        if name in line.scores
        for value in _ends(line, line.scores[name])
        if math.isfinite(value) and value > 0.0
    ]
    figures += [goal.at_most for line in lines for goal in line.goals] or [1.0]
    panel.set_xscale("log")
    low = min(0.9, min(figures)) if unit == _RATIOS else min(figures) / 1.3
    panel.set_xlim(low, 1.4 * max(figures))
    panel.set_ylim(len(lines) - 0.4, -0.6)
    for row, line in enumerate(lines):
        panel.axhline(row + 0.5, color=house.ALLOWED, linewidth=0.4, zorder=0)
        for goal in line.goals:
            dashes = _DOTTED if goal.statistic in _MIDDLING else _DASHED
            panel.plot([goal.at_most] * 2, [row - 0.45, row + 0.45], dashes=dashes, **_GOAL)
        for place, name in enumerate(drawn):
            if name in line.scores:
                offset = _BESIDE * (place - 0.5 * (len(drawn) - 1))
                _draw_score(panel, row + offset, _ends(line, line.scores[name]), place)
    if unit == _RATIOS:
        panel.axvline(1.0, color=house.INK, linewidth=0.8)
    panel.set_yticks(range(len(lines)), [_row_name(line) for line in lines])
    panel.tick_params(axis="y", length=0)
    panel.set_xlabel(unit, labelpad=2)
    _plain_ticks(panel)


def _plain_ticks(panel: Any) -> None:
    """Count a logarithmic axis in plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())


def _ends(line: Line, score: Score) -> tuple[float, float]:
    """Return median and 95 %."""
    figures = score.shown(in_bounds=line.in_bounds)
    return figures["median"], figures["p95"]


def _draw_score(panel: Any, y: float, pair: tuple[float, float], place: int) -> None:
    """Draw a point at the median and a line to the 95 %; what is never reached points right."""
    hue, (median, worse) = house.HUES[place], pair
    left, right = panel.get_xlim()
    ends = [max(min(value, right), left) for value in pair]
    panel.plot(ends, [y, y], color=hue, linewidth=1.1)
    if math.isfinite(median):
        panel.plot(ends[:1], [y], MARKERS[place], color=hue, markersize=3.6, clip_on=False)
    if not math.isfinite(worse):
        panel.plot([right], [y], ">", color=hue, markersize=4.0, clip_on=False)


def _row_name(line: Line) -> str:
    """Return what stands beside a row."""
    fleet = "" if line.fleet == "rig" else f"{line.fleet}, "
    bound = ""
    if line.bound is not None:
        measure = MEASURES[line.measure]
        bound = f" ({line.bound * measure.factor:{measure.shown}} {measure.unit})"
    return f"{fleet}{line.scenario}: {MEASURES[line.measure].heading}{bound}"


def _notes(lines: Sequence[Line], controllers: Sequence[str]) -> list[str]:
    """Return what marks and names mean, and who is not drawn, a line each."""
    notes = ["point: median of the plants; line: to their 95 %; arrow at the right edge: never"]
    statistics = {goal.statistic for line in lines for goal in line.goals}
    goals = {
        "dotted: goal of the median or mean": any(each in _MIDDLING for each in statistics),
        "dashed: goal of the 95 %": any(each not in _MIDDLING for each in statistics),
    }
    if any(goals.values()):
        notes.append("; ".join(text for text, there in goals.items() if there))
    if any(line.in_bounds for line in lines):
        notes.append("solid, at 1: the bound, computed for each plant; in brackets: their median")
    notes += [f"{name}: {FLEETS[name].text}" for name in _runs(lines) if name in FLEETS]
    if left := controllers[MOST_DRAWN:]:
        notes.append(f"not drawn, and in the table: {', '.join(left)}")
    return notes


def _runs(lines: Sequence[Line]) -> dict[str, int]:
    """Return how many plants of each fleet there are."""
    return {line.fleet: max(score.runs for score in line.scores.values()) for line in lines}


def _write_head(page: Any, lines: Sequence[Line], drawn: Sequence[str], height_in: float) -> None:
    """Write the title, and the name of every controller beside its mark."""
    from matplotlib.lines import Line2D

    fleets = ", ".join(f"{count} × {fleet}" for fleet, count in _runs(lines).items())
    title = f"Controllers on the same plants: {fleets}"
    words: Any = {"va": "center", "color": house.INK}
    page.text(_LEFT, 1.0 - 0.17 / height_in, title, fontsize=9, fontweight="bold", **words)
    for place, name in enumerate(drawn):
        y, hue = 1.0 - (0.37 + _NAME_IN * place) / height_in, house.HUES[place]
        mark: Any = {"color": hue, "marker": MARKERS[place], "markevery": [0], "markersize": 3.6}
        ends = ([_LEFT + 0.002, _LEFT + 0.025], [y, y])
        page.add_artist(Line2D(*ends, linewidth=1.1, transform=page.transFigure, **mark))
        page.text(_LEFT + 0.035, y, name, fontsize=7.5, va="center", color=hue)
