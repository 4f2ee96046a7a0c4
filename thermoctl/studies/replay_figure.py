"""Figure of a replay: record, parameters by law, innovations."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from thermoctl.insight.wording import number
from thermoctl.quantities import Array
from thermoctl.studies import figure as house
from thermoctl.studies.laws import parameter_names
from thermoctl.studies.orders_figure import draw_posterior
from thermoctl.studies.record import GAP, Record
from thermoctl.studies.replay import Replay, Trace
from thermoctl.studies.words import probability

_RECORD_IN, _ORDERS_IN, _PARAMETER_IN, _INNOVATION_IN = (1.25, 0.6), 0.95, 0.95, 0.8
_TOP_IN, _BOTTOM_IN, _SPACE_IN = 0.45, 0.5, 0.33

_BAND_SHARE = 0.9
_BAND_ROOM = 2.0
"""The band may take up to this many times the range of the estimates on either side."""

_CALM_ROOM = 20.0
"""The same where even the narrowest of the band needs more."""

_TOLD_SHARE = 0.05


def draw_replay(result: Replay, paths: list[Path]) -> list[Path]:
    """Draw `result` and write it to each of `paths` (.png or .svg).

    The first law is the one under study, drawn with its band of two standard deviations; the
    parameters of at most four laws share a panel, the innovations of every law have their own.

    Raises
    ------
    Unavailable
        If matplotlib is not installed.
    ValueError
        If a suffix is neither .png nor .svg.
    OSError
        If a file cannot be written.
    """
    names = parameter_names(result.conditions.order)
    orders = [_ORDERS_IN] if result.weighing else []
    first = len(_RECORD_IN) + len(orders)
    heights = [*_RECORD_IN, *orders, *[_PARAMETER_IN] * len(names)]
    heights += [_INNOVATION_IN] * len(result.scores)
    height = sum(heights) + _SPACE_IN * (len(heights) - 1) + _TOP_IN + _BOTTOM_IN
    grid = {"sharex": True, "height_ratios": heights}
    with house.styled(house.WIDE_IN, height, len(heights), 1, **grid) as (figure, axes):
        figure.subplots_adjust(
            left=0.115,
            right=0.865,
            top=1.0 - _TOP_IN / height,
            bottom=_BOTTOM_IN / height,
            hspace=_SPACE_IN * len(heights) / sum(heights),
        )
        panels = list(axes[:, 0])
        unit_s, unit = _time_unit(result)
        draw_record(result.record, panels[0], panels[1], unit_s)
        if result.weighing:
            draw_posterior(panels[2], result.weighing, result.record, unit_s)
        for place, name in enumerate(names):
            _draw_parameter(result, place, name, panels[first + place], unit_s)
        for place in range(len(result.scores)):
            _draw_innovations(result, place, panels[first + len(names) + place], unit_s)
        for index, panel in enumerate(panels):
            house.letter(panel, _letter(index))
        duration = result.record.t_s[-1] / unit_s
        panels[-1].set_xlim(0.0, duration)
        panels[-1].set_xlabel(f"time, {unit}" if result.record.names.time else "row")
        figure.align_ylabels(panels)
        return [house.save(figure, path) for path in paths]


def _letter(index: int) -> str:
    """Return a, b ... z, aa, ab ..."""
    return (chr(96 + index // 26) if index >= 26 else "") + chr(97 + index % 26)


def _time_unit(result: Replay) -> tuple[float, str]:
    """Return the unit of the time axis; rows stay rows."""
    if result.record.names.time is None:
        return 1.0, "row"
    return house.time_unit(float(result.record.t_s[-1]))


def draw_record(
    record: Record, output: Any, entry: Any, unit_s: float, entry_name: str = "applied"
) -> None:
    """Draw what was recorded: output as a line, input as steps with area."""
    longest = GAP * record.period_s / unit_s
    t, y = house.broken(record.t_s / unit_s, record.y, longest)
    output.plot(*house.envelope(t, y), color=house.INK)
    t, u = house.broken(record.t_s / unit_s, record.u, longest)
    t, u = house.envelope(t, u)
    entry.fill_between(t, u, step="post", color=house.SLATE, alpha=0.25, linewidth=0)
    entry.step(t, u, where="post", color=house.SLATE, linewidth=0.8)
    entry.set_ylim(bottom=min(0.0, float(np.min(record.u))))
    house.label(output, float(record.y[-1]), "measured", house.INK)
    house.label(entry, float(record.u[-1]), entry_name, house.SLATE)
    output.set_ylabel("output")
    entry.set_ylabel("input")
    house.score(output, f"{record.names.output} · {len(record.t_s):,} samples")
    house.score(entry, f"{record.names.input}")


def _draw_parameter(result: Replay, place: int, name: str, panel: Any, unit_s: float) -> None:
    """Draw one parameter by up to four laws, the first with its band."""
    drawn = list(zip(result.scores, result.traces, house.HUES, house.DASHES, strict=False))
    low, high = _scale(result, place)
    ends, clipped = [], 0.0
    for rank, (_, trace, hue, dash) in enumerate(drawn):
        kept = _before(trace, trace.index)
        t, theta = result.record.t_s[trace.index[kept]] / unit_s, trace.theta[kept, place]
        if rank == 0:
            spread = 2.0 * trace.theta_sd[kept, place]
            panel.fill_between(t, theta - spread, theta + spread, color=hue, alpha=0.2, linewidth=0)
            late = trace.index[kept] >= result.conditions.scored_from
            clipped = _share((theta - spread < low) | (theta + spread > high), late)
        panel.plot(*house.envelope(t, theta), color=hue, linestyle=dash, zorder=3 - 0.1 * rank)
        _mark_end(result, trace, panel, unit_s, hue)
        ends.append(float(np.clip(theta[-1], low, high)) if len(theta) else 0.5 * (low + high))
    apart = house.spread_out(ends, 0.15 * (high - low))
    for (score, _, hue, _), y in zip(drawn, apart, strict=True):
        house.label(panel, y, score.name, hue)
    panel.set_ylim(low, high)
    panel.set_ylabel(f"${name[0]}_{{{name[1:]}}}$")
    first = result.scores[0]
    words = f"{first.name} {number(first.theta[place], first.theta_sd[place])}"
    if drawn[0][1].gave_up is not None:
        words = f"{first.name} gave up"
    elif clipped >= _TOLD_SHARE:
        words += f" · band leaves the panel for {100 * clipped:.0f} % of the record"
    house.score(panel, words)


def _before(trace: Trace, index: npt.NDArray[np.intp]) -> npt.NDArray[np.bool_]:
    """Return which samples lie before the law gave up, if it did."""
    return index < (trace.gave_up if trace.gave_up is not None else np.inf)


def _share(marked: npt.NDArray[np.bool_], among: npt.NDArray[np.bool_]) -> float:
    """Return the share of samples `among` those looked at that are `marked`."""
    return float(np.mean(marked[among])) if among.any() else 0.0


def _mark_end(result: Replay, trace: Trace, panel: Any, unit_s: float, hue: str) -> None:
    """Draw a line where a law gave up, and say so."""
    if trace.gave_up is None:
        return
    t = result.record.t_s[trace.gave_up] / unit_s
    panel.axvline(t, color=hue, linewidth=0.8, linestyle=(0, (1, 1.5)))
    right = t > 0.75 * result.record.t_s[-1] / unit_s
    panel.annotate(
        "gave up here",
        xy=(t, 0.98),
        xycoords=panel.get_xaxis_transform(),
        xytext=(-3 if right else 3, 0),
        textcoords="offset points",
        color=hue,
        fontsize=7.0,
        ha="right" if right else "left",
        va="top",
    )


def _scale(result: Replay, place: int) -> tuple[float, float]:
    """Return the limits of a parameter's panel: estimates first, then as much band as fits.

    What the laws did while learning may leave it. The band of the first law is shown up to
    `_BAND_SHARE` of the samples, unless that made the estimates' own movement invisible: with an
    input that rests, a band is wider than anything it surrounds.
    """
    ends: list[float] = []
    for trace in result.traces[: len(house.HUES)]:
        late = (trace.index >= result.conditions.scored_from) & _before(trace, trace.index)
        theta = trace.theta[late, place]
        if len(theta):
            ends += [*np.percentile(theta, (2, 98)), float(theta[-1])]
    if not ends:
        return -1.0, 1.0
    low, high = _with_band(result, place, min(ends), max(ends))
    margin = 0.1 * (high - low) or 0.1 * abs(high) or 1.0
    return low - margin, high + margin


def _with_band(result: Replay, place: int, low: float, high: float) -> tuple[float, float]:
    """Return the limits of the estimates widened by what of the first law's band there is room for.

    Where it is narrowest, a band is an estimate's due, however calm the estimate; the band of a law
    that gave up is not.
    """
    first = result.traces[0]
    late = (first.index >= result.conditions.scored_from) & np.isfinite(first.theta_sd[:, place])
    if first.gave_up is not None or not late.any():
        return low, high
    theta, spread = first.theta[late, place], 2.0 * first.theta_sd[late, place]
    reach = high - low
    narrow = 4.0 * float(np.percentile(spread, 10))
    room = max(_BAND_ROOM * reach, min(narrow, _CALM_ROOM * reach) if reach > 0.0 else narrow)
    bottom = float(np.percentile(theta - spread, 100.0 * (1.0 - _BAND_SHARE)))
    top = float(np.percentile(theta + spread, 100.0 * _BAND_SHARE))
    return max(min(low, bottom), low - room), min(max(high, top), high + room)


def _draw_innovations(result: Replay, place: int, panel: Any, unit_s: float) -> None:
    """Draw the innovations of one law over the band it expected them in."""
    score, trace = result.scores[place], result.traces[place]
    index = np.arange(len(result.record.t_s))
    from_here = (index >= result.conditions.scored_from) & _before(trace, index)
    known = np.flatnonzero(np.isfinite(trace.innovation) & from_here)
    t, e, sd = (
        values[known]
        for values in (result.record.t_s / unit_s, trace.innovation, trace.innovation_sd)
    )
    house.label(panel, 0.0, score.name, house.TEXT)
    panel.set_ylabel("$e$")
    _mark_end(result, trace, panel, unit_s, house.TEXT)
    if not len(e):
        gone = trace.gave_up is not None
        house.score(panel, "gave up at once" if gone else "every sample was rejected")
        return
    outside = np.abs(e) > 2.0 * sd
    shown = _thinned(len(e))
    panel.fill_between(
        t[shown], -2.0 * sd[shown], 2.0 * sd[shown], color=house.ALLOWED, linewidth=0
    )
    style = {"marker": "o", "linestyle": "none", "markeredgewidth": 0, "rasterized": len(e) > 2_000}
    panel.plot(t[~outside], e[~outside], color=house.INK, markersize=1.4, **style)
    panel.plot(t[outside], e[outside], color=house.OUTSIDE, markersize=2.0, **style)
    reach = max(2.5 * float(np.median(sd)), float(np.percentile(np.abs(e), 99.5)))
    panel.set_ylim(-1.15 * reach, 1.15 * reach)
    house.score(panel, _innovation_words(result, place, float(np.mean(~outside))))


def _thinned(length: int) -> Array:
    """Return indices that thin a long band to what a panel can show."""
    return np.unique(np.linspace(0, length - 1, min(length, house.POINTS_PER_PANEL)).astype(int))


def _innovation_words(result: Replay, place: int, inside: float) -> str:
    """Return the score line of an innovation panel."""
    score = result.scores[place]
    if result.traces[place].gave_up is not None:
        return f"rms {score.rms_error:.4g} · gave up: whiteness unknown"
    head = f"rms {score.rms_error:.4g} · {100 * inside:.0f} % inside ±2√S"
    if score.whiteness_unknown is not None:
        return f"{head} · whiteness unknown: {score.whiteness_unknown}"
    return f"{head} · whiteness p {probability(score.whiteness_p)}"
