"""The page of the compartment study: Figures 1 to 5 of BO17, and an exact model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from thermoctl.studies import figure as house
from thermoctl.studies.papers.study import Outcome, Row

_HEIGHT_IN = 7.0
_LOOK = {
    "Filter 2": (house.BELIEF, house.DASHES[0]),
    "Kalman filter": (house.INK, house.DASHES[1]),
    "Filter 1": (house.OUTSIDE, house.DASHES[2]),
    "s2": (house.BELIEF, house.DASHES[0]),
    "s1": (house.OUTSIDE, house.DASHES[2]),
}
"""Hue and dash of a line; the methods of Figures 1, 2 and 5, the factors of 3 and 4."""

_AXES = {
    "1": ("gut", r"error $x_1 - \hat{x}_1$"),
    "2": ("blood", r"error $x_2 - \hat{x}_2$"),
    "3": ("Filter 1", "fading factor"),
    "4": ("Filter 2, as printed", "fading factor"),
    "5": ("both compartments", "sum of squared errors up to $k$"),
}
"""What each figure is of, and the name of its vertical axis."""

_FACTORS = {"s1": "$s_1$, gut", "s2": "$s_2$, blood"}

Figure = Mapping[str, Any]


def draw_page(outcome: Outcome, title: str, files: Sequence[Path]) -> list[Path]:
    """Draw the figures of `outcome` on one page, into each of `files`; return these.

    Raises
    ------
    Unavailable
        If matplotlib is not installed.
    ValueError
        If a suffix is neither .png nor .svg.
    OSError
        If a file cannot be written.
    """
    with house.styled(house.WIDE_IN, _HEIGHT_IN, 3, 2) as (page, axes):
        page.subplots_adjust(
            left=0.085, right=0.885, top=0.91, bottom=0.065, hspace=0.42, wspace=0.66
        )
        count = outcome.replications
        runs = f"mean of {count:,} runs" if count > 1 else "one run"
        page.text(0.085, 0.97, title, fontsize=9, fontweight="bold", color=house.INK, va="center")
        page.text(0.885, 0.97, runs, fontsize=7.5, color=house.MUTE, va="center", ha="right")
        panels = dict(zip(_AXES, axes.flat, strict=False))
        for number, panel in panels.items():
            _draw_lines(outcome.figures[number], panel)
            _name_axes(number, panel)
        _set_scales(outcome.figures, panels)
        for number, panel in panels.items():
            _name_lines(outcome.figures[number], panel)
        _mark_jump(outcome.figures["1"], panels["1"])
        _write_sums(outcome.table, panels["5"])
        _draw_exact(outcome.figures["exact model"], axes[2, 1])
        page.align_ylabels(axes[:, 0])
        return [house.save(page, path) for path in files]


def _method(name: str) -> str:
    """Return the filter's name without its settings."""
    return name.partition(",")[0]


def _shown(figure: Figure) -> dict[str, Sequence[float]]:
    """Return the lines to be drawn: those of the paper."""
    return {
        name: values
        for name, values in figure["values"].items()
        if name in _LOOK or name == "Filter 2, as printed"
    }


def _draw_lines(figure: Figure, panel: Any) -> None:
    """Draw the lines of a figure over k, and where the rates change."""
    for name, values in _shown(figure).items():
        hue, dash = _LOOK[_method(name)]
        panel.plot(figure["k"], values, color=hue, linestyle=dash)
    panel.axvline(figure["jump_after"], color=house.MUTE, linewidth=0.6, linestyle=":")
    panel.set_xlim(0, figure["k"][-1])


def _name_axes(number: str, panel: Any) -> None:
    """Write what a figure of the paper shows, and its axes' names."""
    subject, vertical = _AXES[number]
    house.letter(panel, f"Figure {number}")
    house.score(panel, subject)
    panel.set_xlabel("sample $k$")
    panel.set_ylabel(vertical)


def _set_scales(figures: Mapping[str, Figure], panels: Mapping[str, Any]) -> None:
    """Give the factors one scale, and the sums their zero."""
    for number in "12":
        panels[number].axhline(0.0, color=house.MUTE, linewidth=0.4)
    factors = [line for number in "34" for line in figures[number]["values"].values()]
    for number in "34":
        panels[number].set_ylim(0.0, 1.1 * max(map(max, factors)))
    panels["5"].set_ylim(bottom=0.0)


def _name_lines(figure: Figure, panel: Any) -> None:
    """Write the name of each line to the right of its end, none upon another."""
    lines = _shown(figure)
    bottom, top = panel.get_ylim()
    places = house.spread_out([values[-1] for values in lines.values()], 0.09 * (top - bottom))
    for name, place in zip(lines, places, strict=True):
        method = _method(name)
        house.label(panel, place, _FACTORS.get(name, method), _LOOK[method][0])


def _mark_jump(figure: Figure, panel: Any) -> None:
    """Say once what the dotted line is."""
    where = (figure["jump_after"], 0.97)
    _write(panel, "rates change", where, (4, 0), va="top", xycoords=panel.get_xaxis_transform())


def _write_sums(table: Sequence[Row], panel: Any) -> None:
    """Write the whole table into the empty part of the panel."""
    for place, row in enumerate(table):
        name, y = str(row["method"]), 0.77 - 0.085 * place
        style = {
            "color": _LOOK[_method(name)][0],
            "xycoords": panel.transAxes,
            "va": "center",
        }
        _write(panel, name.removeprefix("Filter 2, "), (0.42, y), (0, 0), **style)
        _write(panel, f"{row['hkt']:.2f}", (1.0, y), (0, 0), ha="right", **style)


def _draw_exact(figure: Figure, panel: Any) -> None:
    """Draw the mean squared errors under an exact model with twice their standard errors."""
    rows = figure["rows"]
    for place, row in enumerate(reversed(rows)):
        hue, _ = _LOOK[_method(row["method"])]
        mse, spread = row["mse"], 2.0 * (row["standard_error"] or 0.0)
        panel.plot((mse - spread, mse + spread), (place, place), color=hue)
        panel.plot(mse, place, color=hue, marker="o", markersize=3.6)
        _write(panel, row["method"], (0.0, place), (4, 6), color=hue)
        _write(panel, f"{mse:.4f}", (mse + spread, place), (5, 0), color=hue, va="center")
    panel.set_yticks(())
    panel.set_ylim(-0.5, len(rows) - 0.3)
    panel.set_xlim(left=0.0)
    panel.set_xlabel("mean squared error ± 2 standard errors")
    house.letter(panel, "Exact model")


def _write(
    panel: Any, text: str, where: tuple[float, float], offset: tuple[float, float], **style: Any
) -> None:
    """Write a note in the panel, `offset` in points from a place in the data."""
    style = {"color": house.MUTE, "fontsize": 7.5, **style}
    panel.annotate(text, where, offset, textcoords="offset points", **style)
