"""What is believed of the plant, with error bars, and how well the loop does."""

from __future__ import annotations

from rich.text import Text

from thermoctl.app.live import items, numbers
from thermoctl.app.live.banner import ROOMY
from thermoctl.app.live.items import NOTHING, Bench, Item
from thermoctl.app.live.look import Look, Role, printable
from thermoctl.app.live.model import View
from thermoctl.app.live.rows import Part, fitted
from thermoctl.app.live.score import shadow_words
from thermoctl.insight import Gate

LEAST_ROWS = 4
"""Rows there is always room for; two more hold what is missed least."""

_VALUE, _ERROR, _UNIT, _UNIT_RIGHT = 8, 11, 6, 7

_OWN = (items.pole, items.gain, items.holding, items.innovation)
"""What a loop tells that nobody watches beside its controller."""

_PHYSICAL = (items.gain, items.loss, items.holding, items.lag, items.water, items.pole)
_HEALTH = (items.inflation, items.white, items.deviation, items.tick)
_FURTHER = (items.innovation, items.noise)

_GATES = {
    Gate.UNKNOWN: "nothing learnt yet",
    Gate.LEARNING: "learning",
    Gate.PAUSED: "learning paused: nothing to learn",
    Gate.HELD: "learning held: the water jumped",
}


def _parts(item: Item, look: Look, label_cells: int, *, errors: bool) -> list[Part]:
    """Return an item; what is told of it stands below that of the others, in ASCII too."""

    def cell(string: str, width: int) -> str:
        return f"{printable(string, utf8=look.utf8):<{width}}"

    whole = len(printable(item.label, utf8=look.utf8)) < label_cells
    label = item.label if whole else item.short
    head: list[Part] = [(cell(label, label_cells), Role.MUTE)]
    if item.value == numbers.UNKNOWN:
        return [*head, (f"{item.value:>{_VALUE}} ", Role.STRONG), (item.unit, Role.MUTE)]
    head += [(f"{item.value:>{_VALUE}} ", Role.STRONG)]
    if errors:
        role = Role.MUTE if item.error == "given" else Role.BLUE
        head += [(cell(item.error, _ERROR), role)]
    unit = _UNIT if errors else _UNIT_RIGHT
    return [*head, (cell(item.unit, unit), Role.MUTE), (item.tail, item.tail_role)]


def note(view: View, room: int) -> str:
    """Return what the rule above the panel says, in `room` cells if possible.

    The whiteness of the simple model is only worth a word where that model is all there is.
    """
    gate = None if view.insight is None else _GATES.get(view.insight.gate)
    if gate is not None:
        whole = f"± is 2σ, a range 5 to 95 % · {gate}"
        return whole if len(whole) <= room else f"± is 2σ · {gate}"
    white = view.recent.whiteness
    if view.steered and white is not None and white.verdict == "not white":
        return "± is 2σ · not white: model or noise is wrong"
    if view.step is not None and view.step.estimate.rejected:
        return "± is 2σ · last sample not used"
    return "± is 2σ"


def beliefs(view: View, look: Look, width: int, count: int = LEAST_ROWS) -> list[Text]:
    """Return `count` rows of beliefs."""
    wide = width >= ROOMY
    left_label, right_label = (11, 14) if wide else (8, 8)
    left = width * 54 // 100 if wide else width // 2 + 2
    spark_left = left - left_label - _VALUE - 1 - _ERROR - _UNIT - (3 if wide else 2)
    spark_right = width - left - right_label - _VALUE - 1 - _UNIT_RIGHT
    firsts = _PHYSICAL if view.insight is not None else _OWN
    seconds = (*_HEALTH, *_FURTHER) if view.insight is not None else _HEALTH
    rows = []
    for number in range(count):
        one = _made(firsts, number, Bench(view, look, spark_left))
        other = _made(seconds, number, Bench(view, look, spark_right))
        first = fitted(look.text(*_parts(one, look, left_label, errors=True)), left)
        second = look.text(*_parts(other, look, right_label, errors=False))
        first.append_text(fitted(second, width - left))
        rows.append(fitted(first, width))
    return rows


def _made(makers: tuple[items.Maker, ...], number: int, bench: Bench) -> Item:
    return makers[number](bench) if number < len(makers) else NOTHING


def shadow(view: View, look: Look, width: int) -> Text:
    """Return the row that compares the controller in shadow with the one in charge."""
    step = view.step
    if step is None or step.shadow is None:
        return fitted(look.text(), width)
    label = 11 if width >= ROOMY else 8
    percent = numbers.number(None if step.shadow_power is None else 100.0 * step.shadow_power, 0)
    said = f"{step.shadow} {numbers.with_unit(percent, '%')}"
    for words in shadow_words(step.shadow_score):
        longer = f"{said} · {words}"
        if label + len(look.text((longer, Role.TEXT))) > width:
            break
        said = longer
    return fitted(look.text((f"{'Shadow':<{label}}", Role.MUTE), (said, Role.TEXT)), width)
