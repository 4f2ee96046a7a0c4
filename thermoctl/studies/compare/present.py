"""A comparison as a table for people and as JSON for programs."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from thermoctl.studies.compare.goals import STATISTICS, Goal
from thermoctl.studies.compare.plants import FLEETS
from thermoctl.studies.compare.score import MEASURES
from thermoctl.studies.compare.summary import Line, Score
from thermoctl.studies.present import print_lines, spelling
from thermoctl.studies.tables import print_whole

MISSED = "▲"
"""Marks a figure that misses its goal."""


def as_json(lines: Sequence[Line]) -> list[dict[str, Any]]:
    """Return the lines as JSON has them: null for what was never reached."""
    return [
        {
            "fleet": line.fleet,
            "scenario": line.scenario,
            "measure": line.measure,
            "bound": line.bound,
            "goals": [dataclasses.asdict(goal) for goal in line.goals],
            "controllers": {name: _score_json(score) for name, score in line.scores.items()},
        }
        for line in lines
    ]


def _score_json(score: Score) -> dict[str, Any]:
    """Return one score, its infinite figures as null."""
    return {
        "plain": _finite(score.plain),
        "ratio": None if score.ratio is None else _finite(score.ratio),
        "runs": score.runs,
        "failed": score.failed,
        "passed": score.passed,
    }


def _finite(statistics: Mapping[Any, float]) -> dict[str, float | None]:
    return {name: value if math.isfinite(value) else None for name, value in statistics.items()}


def print_table(console: Console, lines: Sequence[Line], controllers: Sequence[str]) -> None:
    """Print every line, whole: a table for each fleet, and what its figures are.

    Parameters
    ----------
    console : Console
        Where to.
    lines : sequence of Line
        What is known.
    controllers : sequence of str
        Names, in the order of the columns; the verdict is on the first.
    """
    for fleet in dict.fromkeys(line.fleet for line in lines):
        own = [line for line in lines if line.fleet == fleet]
        table = _table(console, own, controllers)
        runs = max(score.runs for line in own for score in line.scores.values())
        of = f"{runs} plants" if runs > 1 else "1 plant"
        print_lines(console, [f"{fleet}: {FLEETS[fleet].text}; {of}"])
        print_whole(console, table)
        print_lines(console, [""])
    text = f"Median / 95 % of the plants; × is times the bound, {MISSED} misses a goal"
    print_lines(console, [f"{text}; the verdict is on {controllers[0]}."])


def _table(console: Console, lines: Sequence[Line], controllers: Sequence[str]) -> Table:
    spell = spelling(console)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    headings = ["scenario", "measure", "bound", "goal", *map(_heading, controllers), "verdict"]
    for place, heading in enumerate(headings):
        words = place in (0, 1, len(headings) - 1)
        table.add_column(
            spell(heading),
            justify="left" if words else "right",
            no_wrap=True,
            vertical="bottom",
        )
    scenario = ""
    for line in lines:
        cells = [_cell(line, line.scores.get(name)) for name in controllers]
        first = line.scores.get(controllers[0])
        row = [
            line.scenario if line.scenario != scenario else "",
            f"{MEASURES[line.measure].heading}, {unit_of(line)}",
            _bound(line),
            _goals(line) or "–",
            *cells,
            "–" if first is None else verdict(first),
        ]
        table.add_row(*(spell(cell) for cell in row))
        scenario = line.scenario
    return table


def _heading(controller: str) -> str:
    """Return a controller's name, its options below each other."""
    kind, _, options = controller.partition(":")
    return "\n".join((kind, *options.split(",")) if options else (kind,))


def unit_of(line: Line) -> str:
    """Return the unit in which a line's figures are shown; × is times the bound."""
    return "×" if line.in_bounds else MEASURES[line.measure].unit


def _bound(line: Line) -> str:
    """Return the bound with its unit."""
    measure = MEASURES[line.measure]
    if line.bound is None:
        return "–"
    return f"{line.bound * measure.factor:{measure.shown}} {measure.unit}"


def goal_words(line: Line, goal: Goal) -> str:
    """Return a goal in words, in the unit of its line."""
    factor = 1.0 if line.in_bounds else MEASURES[line.measure].factor
    return f"{STATISTICS[goal.statistic]} {goal.at_most * factor:.3g}"


def _goals(line: Line) -> str:
    """Return the goals of a line, empty where there are none."""
    return ", ".join(goal_words(line, goal) for goal in line.goals)


def misses(lines: Sequence[Line], controller: str) -> list[str]:
    """Return a sentence for each measure in which `controller` misses a goal."""
    return [
        f"{controller} misses a goal of {line.fleet}, {line.scenario}: expected"
        f" {MEASURES[line.measure].heading} {_goals(line)} {unit_of(line)} at most,"
        f" got {_cell(line, line.scores[controller]).rstrip(f' {MISSED}')} (median / 95 %)"
        for line in lines
        if controller in line.scores and line.scores[controller].passed is False
    ]


def _cell(line: Line, score: Score | None) -> str:
    """Return median and 95 %, whether the goals are missed, and how many runs failed."""
    if score is None:
        return "–"
    measure = MEASURES[line.measure]
    factor, form = (1.0, ".2f") if line.in_bounds else (measure.factor, measure.shown)
    figures = score.shown(in_bounds=line.in_bounds)
    pair = " / ".join(
        f"{figures[each] * factor:{form}}" if math.isfinite(figures[each]) else "never"
        for each in ("median", "p95")
    )
    failed = f" {score.failed} failed" if score.failed else ""
    return f"{pair}{failed} {MISSED if score.passed is False else ' '}"


def verdict(score: Score) -> str:
    """Return pass or miss; a dash where there is no goal."""
    return "–" if score.passed is None else "pass" if score.passed else "miss"
