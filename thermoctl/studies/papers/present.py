"""The outcome of a paper's study as a table for people and as JSON for programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from thermoctl.studies.papers.study import Cell, Column, Outcome, Study
from thermoctl.studies.present import empty_table, print_lines, print_table, spelling
from thermoctl.studies.words import counted


def outcome_json(study: Study, outcome: Outcome, files: Sequence[Path]) -> dict[str, Any]:
    """Return table, figures, what they were made of, and the files drawn.

    ``replications`` are those finished, fewer than asked for when the study was interrupted.
    """
    return {
        "table": [dict(row) for row in outcome.table],
        "figures": {number: dict(figure) for number, figure in outcome.figures.items()},
        "replications": outcome.replications,
        "seed": study.seed,
        "files": {path.suffix[1:]: str(path) for path in files},
    }


def print_outcome(console: Console, study: Study, outcome: Outcome) -> None:
    """Print the title of `study`, how much it has seen, and its table."""
    spell = spelling(console)
    print_lines(console, (study.title, f"{runs(outcome)}, seed {study.seed}"))
    table = empty_table(spell, *(column.heading for column in study.columns))
    for place, column in enumerate(study.columns):
        if all(isinstance(row[column.key], str) for row in outcome.table):
            table.columns[place].justify = "left"
    for row in outcome.table:
        table.add_row(*(spell(shown(row[column.key], column)) for column in study.columns))
    print_table(console, table)


def runs(outcome: Outcome) -> str:
    """Return how many runs are behind `outcome`, in words."""
    return counted(outcome.replications, "run")


def shown(cell: Cell, column: Column) -> str:
    """Return a cell of `column` as it is read: true minus, dash where not known."""
    match cell:
        case None:
            return "–"
        case bool():
            return "yes" if cell else "no"
        case str():
            return cell
        case _:
            return format(cell, column.shown).replace("-", "−")
