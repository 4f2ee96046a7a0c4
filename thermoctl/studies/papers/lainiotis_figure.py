"""The page of the selection study: how probability gathers on one hypothesis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from thermoctl.studies import figure as house
from thermoctl.studies.papers.study import Outcome, Row

_HEIGHT_IN = 8.2
_TICKS = (1, 3, 10, 30, 100, 300)
_LETTERS = "abcdefghij"

Figure = Mapping[str, Any]


def draw_page(outcome: Outcome, title: str, last: str, files: Sequence[Path]) -> list[Path]:
    """Draw the figures of `outcome` on one page, into each of `files`; return these.

    Parameters
    ----------
    outcome : Outcome
        What the study found.
    title : str
        Heading of the page.
    last : str
        Key of the figure that compares the cases; all others are cases.
    files : sequence of Path
        Where to; the suffix, .png or .svg, decides the format.

    Raises
    ------
    Unavailable
        If matplotlib is not installed.
    ValueError
        If a suffix is neither .png nor .svg.
    OSError
        If a file cannot be written.
    """
    with house.styled(house.WIDE_IN, _HEIGHT_IN, -(-len(outcome.figures) // 2), 2) as (page, axes):
        page.subplots_adjust(left=0.085, right=0.88, top=0.92, bottom=0.06, hspace=0.5, wspace=0.42)
        count = outcome.replications
        runs = f"mean of {count:,} runs; band: quartiles" if count > 1 else "one run"
        page.text(0.085, 0.975, title, fontsize=9, fontweight="bold", color=house.INK, va="center")
        page.text(0.88, 0.975, runs, fontsize=7.5, color=house.MUTE, va="center", ha="right")
        for letter, row, panel in zip(_LETTERS, outcome.table, axes.flat, strict=False):
            _draw_case(outcome.figures[str(row["case"])], panel)
            house.letter(panel, letter)
            house.score(panel, _score(row))
            panel.text(1.1, 1.06, str(row["case"]), fontsize=7.5, va="center")
        panel = axes.flat[len(outcome.table)]
        _draw_distributions(outcome.figures[last], panel)
        house.letter(panel, _LETTERS[len(outcome.table)])
        for panel in axes.flat:
            _count_samples(panel)
        for panel in axes[-1]:
            panel.set_xlabel("sample")
        return [house.save(page, path) for path in files]


def _count_samples(panel: Any) -> None:
    """Give a panel the axis that all share, on which 8 samples show beside 180."""
    panel.set_xscale("log")
    panel.set_xlim(1, _TICKS[-1])
    panel.set_xticks(_TICKS, list(map(str, _TICKS)))
    panel.set_xticks((), minor=True)


def _score(row: Row) -> str:
    """Return the figures of a row in words."""
    median = row["samples_to_95_median"]
    taken = "not decided" if median is None else f"{median:g} samples"
    return f"{taken}, right in {100.0 * float(row['right'] or 0.0):.0f} %"


def _draw_case(figure: Figure, panel: Any) -> None:
    """Draw the mean probability of every hypothesis, and the quartiles of the true one."""
    t, values, truth = figure["t"], figure["values"], figure["true"]
    rivals = [name for name in values if name != truth]
    band = figure["true_lower_quartile"], figure["true_upper_quartile"]
    panel.fill_between(t, *band, color=house.BELIEF, alpha=0.2, linewidth=0)
    panel.axhline(0.95, color=house.MUTE, linewidth=0.6, linestyle=":")
    panel.set_ylim(0.0, 1.12)
    panel.set_yticks((0, 0.5, 0.95), ("0", "0.5", "0.95"))
    panel.set_ylabel("probability")
    named = {truth: values[truth][-1]}
    if len(values) <= len(house.HUES):  # a hue for everyone
        named |= {name: values[name][-1] for name in rivals}
    else:
        named["others"] = max(values[name][-1] for name in rivals)
        for name in rivals:
            panel.plot(t, values[name], color=house.FOURTH, linewidth=0.7)
    hues = house.HUES if "others" not in named else (house.BELIEF, house.FOURTH)
    places = house.spread_out(list(named.values()), 0.11)
    for rank, (name, place) in enumerate(zip(named, places, strict=True)):
        if name in values:
            look = {"color": hues[rank], "linestyle": house.DASHES[rank]}
            panel.plot(t, values[name], zorder=3 - 0.1 * rank, **look)
        house.label(panel, place, name, hues[rank])


def _draw_distributions(figure: Figure, panel: Any) -> None:
    """Draw quartiles, and the tenth parts at either end, of the samples to a decision."""
    rows = figure["rows"]
    for place, row in enumerate(rows):
        samples = [math.inf if each is None else each for each in row["samples"]]
        # Never ends beyond the panel; "higher", as there is nothing between a sample and never.
        ends = np.quantile(samples, (0.1, 0.25, 0.75, 0.9), method="higher").clip(max=1e4)
        panel.plot(ends[[0, 3]], (place, place), color=house.BELIEF, linewidth=0.7)
        panel.plot(ends[[1, 2]], (place, place), color=house.BELIEF, linewidth=3.0)
        panel.plot(np.median(samples), place, marker="|", color=house.INK, markersize=8)
        if row["never"]:
            house.label(panel, place, f"{100.0 * row['never']:.0f} % never", house.MUTE)
    panel.set_yticks(range(len(rows)), list(_LETTERS[: len(rows)]))
    panel.set_ylim(len(rows) - 0.4, -0.6)
    panel.set_ylabel("case")
    house.score(panel, figure["title"])
