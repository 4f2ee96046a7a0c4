"""Figure of the heating experiment: the counterparts of Figures 20 to 22 of O21."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from thermoctl.quantities import Array
from thermoctl.studies import figure as house
from thermoctl.studies.experiment import Measures, Run, regulation_window

DETAIL_S = 300.0
"""Length of the second column: the end of the run, close up."""

_HEIGHT_IN = 5.6


def draw_experiment(run: Run, measures: Measures, title: str, paths: list[Path]) -> list[Path]:
    """Draw output, input and a(t) of `run`, whole and close up, to each of `paths`.

    Raises
    ------
    Unavailable
        If matplotlib is not installed.
    ValueError
        If a suffix is neither .png nor .svg.
    OSError
        If a file cannot be written.
    """
    grid = {"sharex": "col", "height_ratios": (1.5, 1.0, 1.2)}
    with house.styled(house.WIDE_IN, _HEIGHT_IN, 3, 2, **grid) as (figure, axes):
        figure.subplots_adjust(
            left=0.11, right=0.9, top=0.885, bottom=0.085, hspace=0.36, wspace=0.27
        )
        figure.text(0.11, 0.97, title, fontsize=9, fontweight="bold", color=house.INK, va="center")
        whole, close = slice(0, len(run.t_s)), _detail(run)
        for column, part in enumerate((whole, close)):
            _draw_output(run, part, axes[0, column])
            _draw_input(run, part, axes[1, column])
            _draw_pole(run, part, axes[2, column])
            unit_s, unit = house.time_unit(float(run.t_s[part][-1] - run.t_s[part][0]))
            for panel in axes[:, column]:
                panel.set_xlim(run.t_s[part][0], run.t_s[part][-1])
                _time_axis(panel, unit_s)
            axes[2, column].set_xlabel(f"time, {unit}")
        _write_words(run, measures, axes)
        figure.align_ylabels(axes[:, 0])
        return [house.save(figure, path) for path in paths]


def _detail(run: Run) -> slice:
    """Return the last `DETAIL_S` of the run."""
    return slice(int(np.searchsorted(run.t_s, run.t_s[-1] - DETAIL_S)), len(run.t_s))


def _time_axis(panel: Any, unit_s: float) -> None:
    """Count the time axis in `unit_s`."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    low, high = panel.get_xlim()
    ticks = MaxNLocator(5, steps=[1, 2, 3, 5, 10]).tick_values(low / unit_s, high / unit_s)
    inside = [tick * unit_s for tick in ticks if low <= tick * unit_s <= high]
    panel.set_xticks(inside)
    panel.xaxis.set_major_formatter(FuncFormatter(lambda t_s, _: f"{t_s / unit_s:g}"))


def _line(panel: Any, t_s: Array, values: Array, **style: object) -> None:
    """Draw a line that keeps the peaks of a long run."""
    panel.plot(*house.envelope(t_s, values), **style)


def _draw_output(run: Run, part: slice, panel: Any) -> None:
    """Draw set point, measured and true temperature."""
    t_s = run.t_s[part]
    panel.plot(t_s, run.setpoint_c[part], color=house.MUTE, linewidth=0.8, dashes=(5, 4))
    _line(panel, t_s, run.measured_c[part], color=house.INK, linewidth=0.8)
    _line(panel, t_s, run.true_c[part], color=house.OUTSIDE, dashes=(4, 2.5))


def _draw_input(run: Run, part: slice, panel: Any) -> None:
    """Draw the accepted power as steps with area, in per cent."""
    t_s, percent = run.t_s[part], 100.0 * run.power[part]
    t_s, percent = house.envelope(t_s, percent)
    panel.fill_between(t_s, percent, step="post", color=house.SLATE, alpha=0.25, linewidth=0)
    panel.step(t_s, percent, where="post", color=house.SLATE, linewidth=0.7)
    panel.set_ylim(0.0, 105.0)
    panel.set_yticks((0, 50, 100))


def _draw_pole(run: Run, part: slice, panel: Any) -> None:
    """Draw a(t) with its band of two standard deviations."""
    t_s, a, spread = run.t_s[part], run.a[part], 2.0 * run.a_sd[part]
    panel.fill_between(t_s, a - spread, a + spread, color=house.BELIEF, alpha=0.2, linewidth=0)
    _line(panel, t_s, a, color=house.BELIEF)
    late = np.isfinite(a) & (t_s > t_s[0] + 0.02 * (t_s[-1] - t_s[0]))
    if np.any(late):
        low, high = (
            np.percentile(a[late] - spread[late], 2),
            np.percentile(a[late] + spread[late], 98),
        )
        margin = 0.15 * (high - low) or 1e-3
        panel.set_ylim(low - margin, high + margin)
    panel.ticklabel_format(axis="y", useOffset=False)


def _write_words(run: Run, measures: Measures, axes: Any) -> None:
    """Write labels, letters and scores."""
    for index, panel in enumerate(axes.flat):
        house.letter(panel, "abcdef"[index])
    axes[0, 0].set_ylabel("output, °C")
    axes[1, 0].set_ylabel("input, %")
    axes[2, 0].set_ylabel("estimate of $a(t)$")
    bottom, top = axes[0, 1].get_ylim()
    names = [
        ("measured", run.measured_c, house.INK),
        ("true", run.true_c, house.OUTSIDE),
        ("set point", run.setpoint_c, house.MUTE),
    ]
    shown = [(name, values[-1], hue) for name, values, hue in names if np.isfinite(values[-1])]
    places = house.spread_out([place for _, place, _ in shown], 0.1 * (top - bottom))
    for (name, _, hue), place in zip(shown, places, strict=True):
        house.label(axes[0, 1], place, name, hue)
    house.label(axes[1, 1], 50.0, "accepted", house.SLATE)
    if np.isfinite(run.a[-1]):
        bottom, top = axes[2, 1].get_ylim()
        house.label(axes[2, 1], run.a[-1], "estimate", house.BELIEF)
        house.label(axes[2, 1], run.a[-1] - 0.12 * (top - bottom), "±2σ", house.BELIEF)
    house.score(axes[0, 0], _warm_up_words(measures))
    house.score(axes[0, 1], _regulation_words(measures))
    if measures.travel_per_min is not None:
        house.score(axes[1, 1], f"travel {measures.travel_per_min:.1f} ranges/min")
    if regulation_window(run) is not None and np.isfinite(run.a[-1]):
        house.score(axes[2, 1], f"at the end {run.a[-1]:.5f} ± {2.0 * run.a_sd[-1]:.5f}")


def _warm_up_words(measures: Measures) -> str:
    """Return the score of the whole run."""
    if measures.warm_up_s is None or measures.overshoot_k is None:
        return "too short: set point not reached"
    return f"reached after {measures.warm_up_s:.0f} s, overshoot {measures.overshoot_k:.2f} K"


def _regulation_words(measures: Measures) -> str:
    """Return the score of regulation."""
    if measures.bias_k is None or measures.deviation_k is None:
        return "too short to judge regulation"
    if measures.cycle_k is None:
        return (
            f"sd {1e3 * measures.deviation_k:.0f} mK, bias {1e3 * measures.bias_k:+.0f} mK".replace(
                "-", "−"
            )
        )
    return f"cycle {measures.cycle_k:.2f} K every {measures.cycle_period_s:.0f} s"
