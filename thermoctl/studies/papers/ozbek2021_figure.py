"""One page: the counterparts of Figures 1 to 18 of O21, and the table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermoctl.studies import figure as house
from thermoctl.studies.papers.ozbek2021_methods import JUMPS, METHODS, SAMPLES
from thermoctl.studies.papers.present import runs, shown
from thermoctl.studies.papers.study import Column, Outcome

HEIGHT_IN: Final = 10.3
"""With `house.WIDE_IN` it fits on A4 with margins of 13 mm."""

ROWS: Final = sorted((m.figures, m.title) for m in METHODS if m.figures is not None)
"""Methods as the paper shows them one after the other: figures of estimate, P and residuals."""

_LEFT, _RIGHT, _TOP, _BOTTOM = 0.09, 0.975, 0.922, 0.228
_TABLE = (_LEFT, 0.012, _RIGHT - _LEFT, 0.155)
_COLUMNS: Final = (0.0, 0.44, 0.55, 0.66, 0.77, 0.885, 1.0)
"""Left edge of the table's first column, right edges of the others."""


def draw_ozbek2021(
    outcome: Outcome, columns: Sequence[Column], seed: int, paths: Sequence[Path]
) -> list[Path]:
    """Draw figures and table of `outcome` to each of `paths`, on one page.

    Parameters
    ----------
    outcome : Outcome
        Of the study of O21, with its Figures 1 to 18.
    columns : sequence of Column
        Of the table.
    seed : int
        Named on the page.
    paths : sequence of Path
        Files ending in .png or .svg.

    Raises
    ------
    Unavailable
        If matplotlib is not installed.
    ValueError
        If a suffix is neither .png nor .svg.
    OSError
        If a file cannot be written.
    """
    grid = {"sharex": True}
    with house.styled(house.WIDE_IN, HEIGHT_IN, len(ROWS), 3, **grid) as (figure, axes):
        figure.subplots_adjust(
            left=_LEFT, right=_RIGHT, top=_TOP, bottom=_BOTTOM, hspace=0.68, wspace=0.4
        )
        for panels, (numbers, name) in zip(axes, ROWS, strict=True):
            _draw_estimate(panels[0], outcome.figures[str(numbers[0])])
            _draw_variance(panels[1], outcome.figures[str(numbers[1])])
            _draw_residuals(panels[2], outcome.figures[str(numbers[2])])
            for panel, number in zip(panels, numbers, strict=True):
                house.letter(panel, str(number))
                for jump in JUMPS:
                    panel.axvline(jump + 0.5, color=house.MUTE, linewidth=0.6, linestyle=":")
            _head(panels[0], name)
        _write_axes(axes, max(map(abs, _every_residual(outcome))))
        _write_labels(axes)
        _write_title(figure, seed)
        _write_table(figure, outcome, columns)
        return [house.save(figure, path) for path in paths]


def _draw_estimate(panel: Any, drawn: Mapping[str, Any]) -> None:
    """Draw the estimate with its band over the true value."""
    t, a, sd = (np.array(drawn[key]) for key in ("t", "values", "sd"))
    true = np.array(drawn["true"])
    panel.fill_between(t, a - 2.0 * sd, a + 2.0 * sd, color=house.BELIEF, alpha=0.2, linewidth=0.0)
    panel.plot(t, true, color=house.INK, linewidth=0.9, linestyle=house.TRUE_DASH)
    panel.plot(t, a, color=house.BELIEF)
    house.score(panel, f"mean square error {np.mean((a - true) ** 2):.3f}")


def _draw_variance(panel: Any, drawn: Mapping[str, Any]) -> None:
    """Draw P on its logarithmic axis."""
    panel.plot(drawn["t"], drawn["values"], color=house.BELIEF)
    house.score(panel, f"last value {drawn['values'][-1]:.4f}")


def _draw_residuals(panel: Any, drawn: Mapping[str, Any]) -> None:
    """Draw the residuals over what the law expected of them; those outside stand out."""
    t, e, limit = (np.array(drawn[key]) for key in ("t", "values", "sd"))
    limit = 2.0 * limit
    panel.fill_between(t, -limit, limit, color=house.ALLOWED, linewidth=0.0)
    outside = np.abs(e) > limit
    dots = {"linestyle": "", "marker": "o", "markeredgewidth": 0.0}
    panel.plot(t[~outside], e[~outside], color=house.INK, markersize=1.2, **dots)
    panel.plot(t[outside], e[outside], color=house.OUTSIDE, markersize=2.0, **dots)
    house.score(panel, f"{100.0 * np.mean(~outside):.0f} % inside ±2√S")


def _every_residual(outcome: Outcome) -> list[float]:
    """Return all residuals that are drawn."""
    return [e for (_, _, number), _ in ROWS for e in outcome.figures[str(number)]["values"]]


def _head(panel: Any, name: str) -> None:
    """Write the name of a row above its first panel."""
    panel.annotate(
        name,
        xy=(0.0, 1.0),
        xycoords="axes fraction",
        xytext=(0, 18),
        textcoords="offset points",
        fontsize=9,
        fontweight="bold",
        color=house.INK,
    )


def _write_axes(axes: Any, largest_residual: float) -> None:
    """Give every column its scale, and every axis a name."""
    end = max(10.0, 5.0 * math.ceil(largest_residual / 5.0))
    for estimate, variance, residual in axes:
        estimate.set(ylim=(-1.5, 1.5), yticks=(-0.9, 0.0, 0.9), ylabel="estimate of $a$")
        variance.set(yscale="log", ylim=(1e-4, 2.0), ylabel="variance $P$")
        variance.set_yticks((0.001, 0.01, 0.1, 1.0), ("0.001", "0.01", "0.1", "1"))
        variance.minorticks_off()
        residual.set(ylim=(-end, end), yticks=np.linspace(-end, end, 5), ylabel="residual $e$")
    for panel in axes[-1]:
        panel.set(xlim=(0, SAMPLES), xticks=range(0, SAMPLES + 1, 100), xlabel="sample $t$")


def _write_labels(axes: Any) -> None:
    """Write once what the lines, the bands and the dots are, where the first row is empty."""
    estimate, _, residual = axes[0]
    top = residual.get_ylim()[1]
    for panel, x, y, text, hue in (
        (estimate, 95, 0.9, "true", house.INK),
        (estimate, 208, 0.45, "estimate", house.BELIEF),
        (estimate, 208, 0.0, "±2σ", house.BELIEF),
        (residual, 208, 0.75 * top, "outside ±2√S", house.OUTSIDE),
    ):
        side = "right" if x < 100 else "left"
        panel.text(x, y, text, color=hue, fontsize=7.5, va="center", ha=side)


def _write_title(figure: Any, seed: int) -> None:
    """Write what the page shows."""
    style = {"color": house.INK, "va": "center"}
    text = "Figures 1 to 18 of O21, repeated: one run of (24), seed"
    figure.text(_LEFT, 0.983, f"{text} {seed}", fontsize=9, fontweight="bold", **style)


def _write_table(figure: Any, outcome: Outcome, columns: Sequence[Column]) -> None:
    """Write the table as words under the panels."""
    panel = figure.add_axes(_TABLE)
    panel.set(xlim=(0, 1), ylim=(0, 1))
    panel.axis("off")
    heading = f"Mean over {runs(outcome)}"
    panel.text(0.0, 1.0, heading, fontsize=9, fontweight="bold", color=house.INK, va="top")
    pitch = 0.84 / (len(outcome.table) + 2)
    lines = [[column.heading for column in columns]]
    lines += [[shown(row[column.key], column) for column in columns] for row in outcome.table]
    for index, line in enumerate(lines):
        y = 0.84 - (index + 1) * pitch
        for place, text in enumerate(line):
            panel.text(
                _COLUMNS[place],
                y,
                text,
                fontsize=7.5,
                ha="right" if place else "left",
                va="bottom",
                color=house.TEXT if index else house.MUTE,
            )
