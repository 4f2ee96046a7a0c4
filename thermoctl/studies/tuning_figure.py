"""Figure of a tuning: the run, the orders, the answer to full power."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from thermoctl.insight.wording import number
from thermoctl.quantities import Array
from thermoctl.studies import figure as house
from thermoctl.studies.excitation import Excitation
from thermoctl.studies.orders_figure import draw_posterior
from thermoctl.studies.plant_words import PlantWords
from thermoctl.studies.replay_figure import draw_record
from thermoctl.studies.tuning import Tuning
from thermoctl.studies.tuning_limits import Proposal
from thermoctl.studies.tuning_words import limit_lines

_HEIGHTS_IN = (1.6, 0.7, 1.2, 1.7)
_TOP_IN, _BOTTOM_IN = 0.45, 0.5
_CLOSE_IN, _APART_IN = 0.36, 0.76
"""Between panels of one time axis, and above one that has its own."""
_LABEL_GAP = 0.09
_LINE_IN = 0.112
"""Height of a line of text below the panels."""
_LAGS_SHOWN, _LEAST_SHOWN = 4.0, 30.0
_UNHEARD = "The answer to full power is not known: the power moved too little, or not at all."


def draw_tuning(
    tuning: Tuning, excitation: Excitation, paths: list[Path], limits: Sequence[Proposal] = ()
) -> list[Path]:
    """Draw `tuning` of the run of `excitation` and write it to each of `paths`.

    Below stand the `limits` that are proposed; of a plant that was not heard, no answer is drawn,
    and why.

    Raises
    ------
    Unavailable
        If matplotlib is not installed.
    ValueError
        If a suffix is neither .png nor .svg.
    OSError
        If a file cannot be written.
    """
    chosen = () if tuning.given else _HEIGHTS_IN[2:3]
    answer = () if tuning.words is None else _HEIGHTS_IN[3:]
    heights = [*_HEIGHTS_IN[:2], *chosen, *answer]
    runs = len(heights) - len(answer)
    spaces = [_TOP_IN, *[_CLOSE_IN] * (runs - 1), *[_APART_IN] * len(answer)]
    below = limit_lines(limits)[1:] if answer else [_UNHEARD]
    foot_in = _LINE_IN * (len(below) + 1) if below else 0.0
    height = sum(heights) + sum(spaces) + _BOTTOM_IN + foot_in
    with house.styled(house.WIDE_IN, height, len(heights), 1) as (figure, axes):
        panels = list(axes[:, 0])
        top = height
        for panel, space, own in zip(panels, spaces, heights, strict=True):
            top -= space + own
            panel.set_position((0.115, top / height, 0.75, own / height))
        _draw_run(tuning, excitation, panels[:runs])
        if tuning.words is not None:
            _draw_answer(tuning, tuning.words, panels[-1])
        for index, panel in enumerate(panels):
            house.letter(panel, "abcd"[index])
        figure.align_ylabels(panels)
        if below:
            figure.text(
                0.02, (foot_in - 0.5 * _LINE_IN) / height, "\n".join(below),
                va="top", family="monospace", fontsize=6.0, linespacing=1.3, color=house.TEXT,
            )  # fmt: skip
        return [house.save(figure, path) for path in paths]


def _draw_run(tuning: Tuning, excitation: Excitation, panels: list[Any]) -> None:
    """Draw temperature, power and, where orders were weighed, their probabilities."""
    record = tuning.record
    unit_s, unit = house.time_unit(float(record.t_s[-1]))
    draw_record(record, panels[0], panels[1], unit_s, entry_name="taken")
    panels[0].axhspan(
        excitation.bottom_c, excitation.top_c, color=house.ALLOWED, alpha=0.5, linewidth=0
    )
    panels[0].set_ylabel("temperature, °C")
    panels[1].set_ylabel("power")
    house.score(
        panels[0],
        f"band {excitation.bottom_c:g} to {excitation.top_c:g} °C · {len(record.t_s):,} samples",
    )
    house.score(panels[1], "as the board took it: accepted_power in run.csv")
    if not tuning.given:
        draw_posterior(panels[2], tuning.weighing, record, unit_s)
    for panel in panels:
        panel.set_xlim(0.0, float(record.t_s[-1]) / unit_s)
        panel.tick_params(labelbottom=panel is panels[-1])
    panels[-1].set_xlabel(f"time, {unit}")


def _draw_answer(tuning: Tuning, words: PlantWords, panel: Any) -> None:
    """Draw how the temperature answers to full power, and the gain and lag of that answer."""
    panel.set_xlabel("time after full power, s")
    panel.set_ylabel("rise, K")
    lag_s = max(words.lag_s.value, 0.0)
    t, rise = _answer(tuning, max(_LAGS_SHOWN * lag_s, _LEAST_SHOWN * tuning.record.period_s))
    slope = words.gain_k_per_min.value / 60.0
    panel.plot(t, np.maximum(slope * (t - lag_s), 0.0), color=house.FOURTH, dashes=(4, 2.5))
    panel.plot(t, rise, color=house.BELIEF)
    panel.set_xlim(0.0, float(t[-1]))
    ends = house.spread_out(
        [float(rise[-1]), float(slope * (t[-1] - lag_s))], _LABEL_GAP * float(rise[-1])
    )
    for y, text, hue in zip(
        ends, ("model", "gain, after lag"), (house.BELIEF, house.MUTE), strict=True
    ):
        house.label(panel, y, text, hue)
    gain, lag = (
        number(each.value, 0.25 * ((each.high or each.value) - each.low))
        for each in (words.gain_k_per_min, words.lag_s)
    )
    house.score(panel, f"solid: model · dashed: gain {gain} K/min after a lag of {lag} s")


def _answer(tuning: Tuning, duration_s: float) -> tuple[Array, Array]:
    """Return times in s, and the wide model's rise in K after full power from rest."""
    wide, scaling = tuning.weighing.wide, tuning.weighing.scaling
    n, m = wide.order.n, wide.order.m
    count = int(duration_s / tuning.record.period_s) + 1
    u = np.concatenate((np.zeros(m), np.full(count, 1.0 / scaling.u_scale)))
    y = np.zeros(n + count)
    for t in range(1, count):
        past_y, past_u = y[n + t - n : n + t][::-1], u[t : m + t][::-1]
        y[n + t] = wide.theta[n : n + m] @ past_u - wide.theta[:n] @ past_y  # O21 (1)
    t_s: Array = tuning.record.period_s * np.arange(float(count))
    return t_s, scaling.y_scale * y[n:]
