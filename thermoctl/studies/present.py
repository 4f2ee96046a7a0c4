"""Results of studies as tables for people and as JSON for programs."""

from __future__ import annotations

import dataclasses
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from thermoctl.insight.wording import number
from thermoctl.studies.experiment import Measures
from thermoctl.studies.laws import parameter_names
from thermoctl.studies.orders import Weighing
from thermoctl.studies.orders_words import orders_json, orders_lines, orders_rows
from thermoctl.studies.record import Record
from thermoctl.studies.replay import Replay
from thermoctl.studies.tables import print_whole, width_of
from thermoctl.studies.words import ascii_only, counted, duration, is_utf8, probability

Spelling = Callable[[str], str]
"""Turns words into those that the console can show; before they are laid out in columns."""


def spelling(console: Console) -> Spelling:
    """Return how words are spelt on `console`."""
    return str if is_utf8(console.encoding) else ascii_only


def print_lines(console: Console, lines: Iterable[str]) -> None:
    """Print lines; on a terminal a long one goes on below where its text begins."""
    spell = spelling(console)
    for line in lines:
        shown = _folded(spell(line), console.width) if console.is_terminal else spell(line)
        console.print(shown, style="none", markup=False, highlight=False, soft_wrap=True)


def _folded(line: str, width: int) -> str:
    """Return `line` in rows of at most `width` where words allow it."""
    name = re.match(r"\S*\s{2,}", line)
    margin = len(name[0]) if name is not None and 2 * len(name[0]) < width else 0
    rows = textwrap.wrap(
        line,
        width,
        subsequent_indent=" " * margin,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(rows)


def replay_json(result: Replay) -> dict[str, Any]:
    """Return the result as JSON has it: no NaN, but null for what is not known."""
    order = result.conditions.order
    conditions = {
        **_fields(result.conditions),
        "order": [order.n, order.m, order.delay],
        "skipped_rows": result.record.skipped,
        "notes": list(result.record.notes),
    }
    return {
        "samples": len(result.record.t_s),
        "estimators": [_fields(score) for score in result.scores],
        "conditions": conditions,
        **(orders_json(result.weighing) if result.weighing else {}),
    }


def experiment_json(
    measures: Measures, conditions: Mapping[str, Any], figures: Sequence[Path]
) -> dict[str, Any]:
    """Return an experiment's measures, conditions and figures."""
    return {
        "measures": _fields(measures),
        "conditions": dict(conditions),
        "figures": {path.suffix[1:]: str(path) for path in figures},
    }


def _fields(of: Any) -> dict[str, Any]:
    """Return the fields of a flat dataclass, with null for floats that are not finite."""
    return {field.name: _finite(getattr(of, field.name)) for field in dataclasses.fields(of)}


def _finite(value: Any) -> Any:
    """Return `value`, or null where JSON has no word for it."""
    if isinstance(value, tuple):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_replay(console: Console, result: Replay) -> None:
    """Print what was read, what was done to it, and how every law did."""
    spell = spelling(console)
    print_lines(console, (*_about_record(result.record), *_about_conditions(result)))
    if result.weighing:
        print_orders(console, result.weighing)
    print_table(console, _prediction_table(result, spell))
    print_table(console, *_parameter_tables(result, spell))
    console.print()
    print_lines(console, _warnings(result))


def print_orders(console: Console, weighing: Weighing) -> None:
    """Print the most probable orders, a row each."""
    spell = spelling(console)
    table = empty_table(spell, "order n,m,d", "probability")
    for order, chance in orders_rows(weighing):
        table.add_row(order, spell(chance))
    print_table(console, table)


def _about_record(record: Record) -> list[str]:
    """Return lines about the file."""
    names, samples = record.names, f"{len(record.t_s):,} samples"
    timing = "evenly spaced rows"
    if names.time is not None:
        timing = f"every {record.period_s:g} s, {duration(float(record.t_s[-1]))}"
    head = f"Record   {record.source}: {samples}, {timing}; {names.input} → {names.output}"
    return [head, *(f"         {note}" for note in record.notes)]


def _about_conditions(result: Replay) -> list[str]:
    """Return lines about structure, scaling, noise and scoring."""
    c = result.conditions
    kept = "taken as recorded: mean kept, not scaled"
    if c.mean_removed:
        how = "centred at rest" if result.weighing else "mean removed"
        kept = (
            f"{how}, scaled by the standard deviation: output {c.y_centre:.4g} ±"
            f" {c.y_scale:.4g}, input {c.u_centre:.4g} ± {c.u_scale:.4g}"
        )
    return [
        *(orders_lines(result.weighing) if result.weighing else ()),
        f"Model    {counted(c.order.n, 'past output')}, {counted(c.order.m, 'input')},"
        f" delay {c.order.delay}; {kept}",
        f"Noise    R2 = {c.R2:.4g} (sd {math.sqrt(c.R2):.4g}), {c.R2_source}",
        f"Score    {c.scored:,} predictions from sample {c.scored_from + 1:,} on;"
        f" the last value as prediction: rms {c.persistence_rms:.4g}",
    ]


def empty_table(spell: Spelling, *headings: str) -> Table:
    """Return an empty table: the first column words, the others figures."""
    table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0), header_style="bold")
    for place, heading in enumerate(headings):
        table.add_column(spell(heading), justify="right" if place else "left", no_wrap=True)
    return table


def _prediction_table(result: Replay, spell: Spelling) -> Table:
    """Return how well each law foresaw the output."""
    table = empty_table(spell, "\nestimator", "\nrms error", "\nR²", "whiteness\np", "µs a\nsample")
    for score in result.scores:
        figures = (
            _figure(score.rms_error, ".4f"),
            _figure(score.r2, ".5f"),
            probability(score.whiteness_p),
            _figure(score.us_per_sample, ".1f"),
        )
        table.add_row(score.name, *map(spell, figures))
    return table


def _figure(value: float, form: str) -> str:
    """Return a figure, in powers of ten where its decimals would say nothing."""
    if not math.isfinite(value):
        return "–"
    large = abs(value) >= 1e5 or 0.0 < abs(value) < 1e-3
    return f"{value:{'.2e' if large else form}}".replace("-", "−")


def _parameter_tables(result: Replay, spell: Spelling) -> tuple[Table, Table]:
    """Return the last parameters of each law: a row for each law, or one for each parameter."""
    names = parameter_names(result.conditions.order)
    cells = [
        [spell(number(value, sd)) for value, sd in zip(score.theta, score.theta_sd, strict=True)]
        for score in result.scores
    ]
    wide = empty_table(spell, "parameters ± 2σ", *names)
    for score, row in zip(result.scores, cells, strict=True):
        wide.add_row(score.name, *row)
    tall = empty_table(spell, "parameters ± 2σ", *(score.name for score in result.scores))
    for name, column in zip(names, zip(*cells, strict=True), strict=True):
        tall.add_row(name, *column)
    return wide, tall


def print_table(console: Console, table: Table, otherwise: Table | None = None) -> None:
    """Print a table whole, or `otherwise` where only that one fits the terminal."""
    width = width_of(console, table)
    if otherwise is not None and width > console.width and width_of(console, otherwise) < width:
        table = otherwise
    console.print()
    print_whole(console, table)


def _warnings(result: Replay) -> list[str]:
    """Return what a reader of the tables must not overlook."""
    base = result.conditions.persistence_rms
    lines = [
        f"{score.name} foresaw nothing: its error is larger than the spread of the record."
        for score in result.scores
        if not score.r2 > 0.0
    ]
    worse = [s.name for s in result.scores if s.r2 > 0.0 and s.rms_error > base]
    if worse:
        lines.append(f"Worse than the last value as prediction: {', '.join(worse)}.")
    return lines + _whiteness_words(result)


def _whiteness_words(result: Replay) -> list[str]:
    """Return what the test for whiteness found fault with, and what it could not judge."""
    lines = [
        f"Whiteness unknown for {score.name}: {score.whiteness_unknown}."
        for score in result.scores
        if score.whiteness_unknown
    ]
    judged = [score for score in result.scores if not score.whiteness_unknown]
    if judged and all(score.whiteness_p < 0.05 for score in judged):
        whose = f" of {', '.join(score.name for score in judged)}" if lines else ""
        lines.append(
            f"No innovations{whose} are white (p < 0.05): the model or its order leaves something"
            " out."
        )
    return lines


def print_experiment(console: Console, title: str, measures: Measures) -> None:
    """Print the measures of an experiment, each with its unit."""
    spell = spelling(console)
    console.print(spell(title), markup=False, soft_wrap=True)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(justify="right", no_wrap=True)
    table.add_column(no_wrap=True)
    why = "no swing that comes back regularly"
    rows = _measure_rows(measures)
    if measures.window_s is None:
        why, rows = "the run was too short", rows[: 1 if measures.warm_up_s is None else 2]
    for name, value, unit in rows:
        known = ("–", why) if value is None else (value.replace("-", "−"), unit)
        table.add_row(name, *map(spell, known))
    print_whole(console, table)


def _measure_rows(measures: Measures) -> list[tuple[str, str | None, str]]:
    """Return name, figure and unit of every measure."""

    def put(value: float | None, form: str, factor: float = 1.0) -> str | None:
        return None if value is None else format(factor * value, form)

    return [
        ("set point reached after", put(measures.warm_up_s, ".0f"), "s"),
        ("overshoot", put(measures.overshoot_k, ".2f"), "K"),
        ("regulation judged over", put(measures.window_s, ".0f"), "s"),
        ("bias", put(measures.bias_k, "+.3f"), "K"),
        ("standard deviation", put(measures.deviation_k, ".3f"), "K"),
        ("range", put(measures.range_k, ".2f"), "K"),
        ("limit cycle, peak to peak", put(measures.cycle_k, ".2f"), "K"),
        ("limit cycle, period", put(measures.cycle_period_s, ".0f"), "s"),
        ("actuator travel", put(measures.travel_per_min, ".2f"), "full ranges a minute"),
        ("mean power", put(measures.mean_power, ".1f", 100.0), "%"),
    ]
