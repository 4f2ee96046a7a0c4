"""Halve and double every constant of the default law, and see what becomes of its loops.

Run with ``python benchmarks/sensitivity.py FOLDER``, which takes a quarter of an hour on two
processors and goes on from what is in the folder. Prints the rows of the table in
docs/sensitivity.md: what moves by more than a tenth, and what misses a goal.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import fields
from pathlib import Path

from thermoctl.app.commands.compare import contender
from thermoctl.app.settings import load
from thermoctl.app.sim import default_profile
from thermoctl.control.adaptive import Adaptive
from thermoctl.studies.compare.run import finished, jobs_for
from thermoctl.studies.compare.store import Store
from thermoctl.studies.compare.summary import Line, summarise

SEEDS = range(3)
SHOWN = {
    "rig": ("warm-up", "regulation", "step", "cold-water"),
    "lags": ("warm-up", "cold-water"),
    "sizes": ("warm-up",),
}
"""Fleets and scenarios."""
FIGURES = {
    ("warm-up", "overshoot_k"): ("max", "{fleet}, warm-up: overshoot {} K"),
    ("warm-up", "settled_s"): ("median", "{fleet}, warm-up: time {} ×"),
    ("regulation", "deviation_k"): ("mean", "{fleet}, regulation: deviation {} ×"),
    ("regulation", "travel_per_min"): ("mean", "{fleet}, regulation: travel {} /min"),
    ("step", "overshoot_k"): ("max", "{fleet}, step: overshoot {} K"),
    ("step", "settled_s"): ("median", "{fleet}, step: time {} ×"),
    ("cold-water", "overshoot_k"): ("max", "{fleet}, cold water: overshoot {} K"),
    ("cold-water", "settled_s"): ("max", "{fleet}, cold water: time {} ×"),
}
"""Which statistic of which measure is looked at, and its name."""
TOLD, TOLD_K = 0.1, 0.02
"""What moves by less than this share, or for an overshoot by less than so much, is not told."""


def variants() -> Iterator[tuple[str, float, str]]:
    """Yield constant, factor and the law with it in words, for each that can be had."""
    for table in fields(Adaptive):
        kind = table.default_factory
        for each in fields(kind) if isinstance(kind, type) else ():
            for factor in (0.5, 2.0):
                value = factor * each.default
                if isinstance(each.default, int):
                    value = int(value)
                if each.metadata["minimum"] <= value <= each.metadata["maximum"]:
                    name = f"{table.name}.{each.name}"
                    yield name, factor, f"adaptive:{name}={value!r}"


def changes(line: Line, before: str, after: str) -> Iterator[str]:
    """Yield what has become of a figure, where that is worth telling."""
    if (line.scenario, line.measure) not in FIGURES:
        return
    statistic, words = FIGURES[line.scenario, line.measure]
    old, new = (
        line.scores[name].shown(in_bounds=line.in_bounds)[statistic] for name in (before, after)
    )
    missed = line.scores[after].passed is False
    told = TOLD_K if line.measure == "overshoot_k" else TOLD * old
    if missed or abs(new - old) > told:
        yield words.format(f"{old:.2f} → {new:.2f}", fleet=line.fleet) + " **missed**" * missed


def told(lines: Sequence[Line], before: str, after: str) -> str:
    """Return all changes from one law to another."""
    return "; ".join(text for line in lines for text in changes(line, before, after)) or "—"


def main(folder: Path) -> None:
    """Print the table."""
    folder.mkdir(parents=True, exist_ok=True)
    store = Store(folder / "sensitivity.jsonl")
    _, table = load(default_profile()).loop()
    every = list(variants())
    texts = ["adaptive", *(text for _, _, text in every)]
    laws = [contender(text, table, nameplate=False, fitted=True) for text in texts]
    jobs = [job for fleet, names in SHOWN.items() for job in jobs_for(laws, [fleet], SEEDS, names)]
    jobs = list({job.key: job for job in jobs}.values())
    results = []
    for number, (_, result) in enumerate(finished(jobs, store, os.cpu_count() or 1), start=1):
        print(f"\r{number} of {len(jobs)}", end="", file=sys.stderr, flush=True)
        results.append(result)
    print(file=sys.stderr)
    lines = summarise(results, texts)
    cells: dict[str, dict[float, str]] = {}
    for name, factor, text in every:
        cells.setdefault(name, {})[factor] = told(lines, "adaptive", text)
    for name, by_factor in cells.items():
        halved, doubled = (by_factor.get(factor, "not to be had") for factor in (0.5, 2.0))
        print(f"| `{name}` | {halved} | {doubled} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
