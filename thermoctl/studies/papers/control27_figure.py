"""One page: parameter, output and input of the loop of O21 (27), and a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermoctl.quantities import Array
from thermoctl.studies import figure as house
from thermoctl.studies.papers.control27_loop import METHODS, NOISE_K, SAMPLES, SCENARIOS
from thermoctl.studies.papers.present import runs
from thermoctl.studies.papers.study import Outcome

HEIGHT_IN: Final = 10.0
"""With `house.WIDE_IN` it fits on A4 with margins."""

LOOKS: Final[Mapping[str, Mapping[str, Any]]] = {
    "CKF": {"color": house.BELIEF, "linestyle": "-", "zorder": 3},
    "NKF, R1 = 0": {"color": house.OUTSIDE, "linestyle": "-", "linewidth": 0.9, "zorder": 2},
}
"""Lines by the name of their method."""

_LEFT, _RIGHT, _TOP, _BOTTOM = 0.09, 0.975, 0.915, 0.268
_TABLE = (_LEFT, 0.012, _RIGHT - _LEFT, 0.19)
_COLUMNS: Final = (0.0, 0.5, 0.62, 0.74, 0.87, 1.0)
"""Left edge of the table's first column, right edges of the others."""


def draw_control27(outcome: Outcome, seed: int, paths: Sequence[Path]) -> list[Path]:
    """Draw the figures of `outcome`, and a table of deviations, to each of `paths`.

    Parameters
    ----------
    outcome : Outcome
        Of the study of (27).
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
    with house.styled(house.WIDE_IN, HEIGHT_IN, len(SCENARIOS), 3, sharex=True) as (figure, axes):
        figure.subplots_adjust(
            left=_LEFT, right=_RIGHT, top=_TOP, bottom=_BOTTOM, hspace=0.72, wspace=0.4
        )
        for panels, scenario in zip(axes, SCENARIOS, strict=True):
            kinds = ("parameter", "output", "input")
            drawn = [outcome.figures[f"{scenario.name}, {kind}"] for kind in kinds]
            _draw_parameter(panels[0], drawn[0])
            _draw_output(panels[1], drawn[1])
            _draw_input(panels[2], drawn[2])
            _head(panels[0], f"{scenario.name.capitalize()}: {scenario.title}")
        _scale_outputs(axes[:, 1], outcome)
        for panel in axes[-1]:
            panel.set(xlim=(0, SAMPLES), xticks=range(0, SAMPLES + 1, 100), xlabel="sample $t$")
        figure.align_ylabels(axes)
        _write_labels(axes[0][0])
        text = f"The loop of O21 (27), closed: one run of each plant, seed {seed}"
        figure.text(_LEFT, 0.978, text, **_BOLD, va="center")
        _write_table(figure, outcome)
        return [house.save(figure, path) for path in paths]


_BOLD: Final[dict[str, Any]] = {"fontsize": 9, "fontweight": "bold", "color": house.INK}


def _draw_parameter(panel: Any, drawn: Mapping[str, Any]) -> None:
    """Draw a(t), and both estimates with their bands."""
    t, true = np.array(drawn["t"]), np.array(drawn["true"])
    for name, values in drawn["values"].items():
        a, sd = np.array(values), np.array(drawn["sd"][name])
        hue = LOOKS[name]["color"]
        panel.fill_between(t, a - 2.0 * sd, a + 2.0 * sd, color=hue, alpha=0.2, linewidth=0.0)
        panel.plot(t, a, **LOOKS[name])
    panel.plot(t, true, color=house.INK, linewidth=0.9, linestyle=house.TRUE_DASH, zorder=4)
    panel.set(ylabel="$a$")
    panel.locator_params(axis="y", nbins=4, steps=(1, 2, 5, 10))
    errors = [np.array(values) - true for values in drawn["values"].values()]
    house.score(panel, _both("rms error", [float(np.sqrt(np.mean(e**2))) for e in errors], ".4f"))


def _draw_output(panel: Any, drawn: Mapping[str, Any]) -> None:
    """Draw how far the output is from its set point."""
    deviations = _deviations(drawn)
    for name, deviation in deviations.items():
        panel.plot(drawn["t"], deviation, **LOOKS[name])
    panel.axhline(0.0, color=house.INK, linewidth=0.6, zorder=1)
    panel.set(ylabel="$y - y^*$ in K")
    squares = [float(np.mean(each**2)) for each in deviations.values()]
    house.score(panel, _both("mean square", squares, ".3f", " K²"))


def _deviations(drawn: Mapping[str, Any]) -> dict[str, Array]:
    """Return how far each output is from its set point, by method."""
    reference = np.array(drawn["reference"])
    return {name: np.array(values) - reference for name, values in drawn["values"].items()}


def _scale_outputs(panels: Any, outcome: Outcome) -> None:
    """Give the outputs one scale that holds them all."""
    drawn = [outcome.figures[f"{scenario.name}, output"] for scenario in SCENARIOS]
    sizes = [np.abs(each).max() for figure in drawn for each in _deviations(figure).values()]
    most_k = math.ceil(max(sizes))
    for panel in panels:
        panel.set(ylim=(-most_k, most_k), yticks=(-most_k, 0, most_k))


def _draw_input(panel: Any, drawn: Mapping[str, Any]) -> None:
    """Draw the input."""
    for name, values in drawn["values"].items():
        panel.plot(drawn["t"], values, **LOOKS[name])
    panel.set(ylabel="$u$ in K a sample")
    panel.locator_params(axis="y", nbins=4, steps=(1, 2, 5, 10))
    travels = [float(np.abs(np.diff(values)).mean()) for values in drawn["values"].values()]
    house.score(panel, _both("mean step", travels, ".2f", " K"))


def _both(what: str, values: Sequence[float], form: str, unit: str = "") -> str:
    """Return the score of a panel, in the order of the methods drawn."""
    return f"{what} {' and '.join(format(value, form) for value in values)}{unit}"


def _head(panel: Any, name: str) -> None:
    """Write the name of a row above its first panel."""
    panel.annotate(
        name,
        xy=(0.0, 1.0),
        xycoords="axes fraction",
        xytext=(0, 18),
        textcoords="offset points",
        **_BOLD,
    )


def _write_labels(panel: Any) -> None:
    """Write once which line is which, where the panel is empty."""
    lines = [("true, dashed", house.INK)]
    lines += [(f"{name}, ±2σ", look["color"]) for name, look in LOOKS.items()]
    for index, (text, hue) in enumerate(reversed(lines)):
        y = 0.05 + 0.14 * index
        panel.text(0.02, y, text, color=hue, fontsize=7.5, transform=panel.transAxes)


def _write_table(figure: Any, outcome: Outcome) -> None:
    """Write the mean square deviations as words under the panels."""
    panel = figure.add_axes(_TABLE)
    panel.set(xlim=(0, 1), ylim=(0, 1))
    panel.axis("off")
    heading = f"Mean square deviation in K², mean over {runs(outcome)}; noise alone {NOISE_K**2:g}"
    panel.text(0.0, 1.0, heading, **_BOLD, va="top")
    values = {(row["scenario"], row["method"]): row["mse"] for row in outcome.table}
    lines = [["method", *(scenario.name for scenario in SCENARIOS)]]
    for method in METHODS:
        cells = (values[scenario.name, method.name] for scenario in SCENARIOS)
        lines.append([method.name, *(f"{cell:.4f}" for cell in cells)])
    pitch = 0.86 / (len(lines) + 0.5)
    for index, line in enumerate(lines):
        for place, text in enumerate(line):
            panel.text(
                _COLUMNS[place],
                0.86 - (index + 1) * pitch,
                text,
                fontsize=7.5,
                ha="right" if place else "left",
                va="bottom",
                color=house.TEXT if index else house.MUTE,
            )
