"""The whole picture: a pure function of a view, of the size, and of the look.

From top to bottom: state, values, temperature, deviation, power, time axis, beliefs, events and
keys. Nothing scrolls; on a higher terminal the charts and the list of events grow.
"""

from __future__ import annotations

from dataclasses import dataclass

from rich.text import Text

from thermoctl.app.live import banner, charts, numbers, panel
from thermoctl.app.live.look import Look, Role
from thermoctl.app.live.model import View
from thermoctl.app.live.rows import Part, fitted, parted, ruled
from thermoctl.app.live.sentences import Mark, Sentence

LEAST_WIDTH, LEAST_HEIGHT = 80, 24

_RULE_CELLS = 24
"""Cells of a rule that its note leaves to the title, and to a little of the rule itself."""

_SPACINGS = ((0, " ", "  "), (0, " ", " "), (1, " ", " "), (2, " ", " "), (2, "", " "))
"""Ways to set the keys, the roomiest first: how short the words are, what stands around them."""

_MARK_ROLES = {Mark.WARNING: Role.AMBER, Mark.ALARM: Role.RED, Mark.CHANGE: Role.BLUE}


@dataclass(frozen=True, slots=True)
class _Layout:
    """How many rows the parts that can grow get; everything else takes seven."""

    temperature: int = 4
    deviation: int = 4
    power: int = 2
    beliefs: int = panel.LEAST_ROWS
    shadow: int = 0
    events: int = 2


def _layout(height: int, *, shadow: bool) -> _Layout:
    """Return the layout for `height` rows, at least 24; further rows are dealt out in turn."""
    turn = ("S" if shadow else "E") + "ETDEEBB" + "TDTDE" * height
    extra = turn[: height - LEAST_HEIGHT]
    return _Layout(
        temperature=4 + extra.count("T"),
        deviation=4 + extra.count("D"),
        beliefs=panel.LEAST_ROWS + extra.count("B"),
        shadow=extra.count("S"),
        events=2 + extra.count("E"),
    )


def _event_row(view: View, look: Look, event: Sentence, width: int) -> Text:
    role = _MARK_ROLES.get(event.mark, Role.TEXT)
    left: list[Part] = [
        (f"{numbers.wall_time(view.facts.zero, event.t_s):<8}  ", Role.MUTE),
        (f"{event.mark.value} ", role),
        (event.text, Role.BLUE if event.mark is Mark.CHANGE else Role.TEXT),
    ]
    return parted(look, left, [(event.name, Role.MUTE)], width)


def _events(view: View, look: Look, rows: int, width: int) -> list[Text]:
    """Return the last events, the newest first."""
    newest = view.events[::-1][:rows]
    shown = [_event_row(view, look, event, width) for event in newest]
    if not shown:
        since = "yet" if view.facts.simulated else "since this view was opened"
        shown = [fitted(look.text((f"nothing has happened {since}", Role.MUTE)), width)]
    return shown + [fitted(look.text(), width) for _ in range(rows - len(shown))]


def _keys(view: View, look: Look, width: int) -> Text:
    """Return the row of keys, or the question that is open."""
    if view.prompt:
        return fitted(look.text((f" {view.prompt} ", Role.CHIP)), width)
    row = look.text()
    for short, before, after in _SPACINGS:
        parts: list[Part] = []
        for key, *lengths in _offered(view):
            words = lengths[min(short, len(lengths) - 1)]
            parts += [(f" {key} ", Role.CHIP), (f"{before}{words}{after}", Role.MUTE)]
        if view.lost:
            parts += [(f"asked again and again: {view.lost}", Role.TEXT)]
        row = look.text(*parts)
        if len(row.plain.rstrip()) <= width:
            break
    return fitted(row, width)


def _offered(view: View) -> list[tuple[str, ...]]:
    """Return the keys that do something now, each with its words, the shortest last."""
    if view.lost:
        return [("q", "quit")]
    keys: list[tuple[str, ...]] = [("↑↓", "set point", "set"), ("m", "mode")]
    if view.step is not None and view.step.shadow is not None:
        keys += [("c", "controller", "controller", "law")]
    if view.facts.simulated:
        keys += [("d", "cold water", "cold"), ("i", "ice"), ("s", "stirrer", "stirrer", "stir")]
    keys += [("a", "ack")]
    if view.facts.simulated:
        keys += [("space", "go on" if view.paused else "pause")]
    return [*keys, ("q", "quit")]


def _performance(view: View, width: int) -> str:
    """Return what the rule above the deviation says: the verdict on it, if there is room."""
    band = f"dotted: ±{charts.DEVIATION_BAND_MK:g} mK"
    verdict = "" if view.insight is None else numbers.sentence(view.insight.verdict)
    whole = f"{verdict} · {band}" if verdict else band
    return whole if len(whole) + _RULE_CELLS <= width else verdict or band


def render(view: View, width: int, height: int, look: Look) -> list[Text]:
    """Return `view` as `height` rows of `width` cells each.

    Parameters
    ----------
    view : View
        One moment of a run.
    width, height : int
        Size of the terminal. Below 80 by 24 the first row says all there is room for.
    look : Look
        What the terminal can show.
    """
    if width < LEAST_WIDTH or height < LEAST_HEIGHT:
        rows = [banner.one_line(view, look, width)] if height > 0 else []
        return rows + [fitted(look.text(), width) for _ in range(height - len(rows))]
    shadow = view.step is not None and view.step.shadow is not None
    layout, chart = _layout(height, shadow=shadow), charts.frame(view, look, width)
    return [
        banner.state_row(view, look, width),
        banner.values_row(view, look, width),
        ruled(look, "Temperature °C", f"last {numbers.span(view.range_s)}", width),
        *charts.temperature(chart, layout.temperature),
        ruled(look, "Deviation mK", _performance(view, width), width),
        *charts.deviation(chart, layout.deviation),
        *charts.power(chart, layout.power),
        charts.time_axis(chart),
        ruled(look, "What it believes", panel.note(view, width - _RULE_CELLS), width),
        *panel.beliefs(view, look, width, layout.beliefs),
        *(panel.shadow(view, look, width) for _ in range(layout.shadow)),
        ruled(look, "Events", "", width),
        *_events(view, look, layout.events, width),
        _keys(view, look, width),
    ]
