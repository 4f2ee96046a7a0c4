"""What the controller believes, with error bars, and how well it does."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from rich.text import Text

from thermoctl.app.live import braille, numbers, trend
from thermoctl.app.live.banner import ROOMY
from thermoctl.app.live.look import Look, Role
from thermoctl.app.live.model import FEWEST, View
from thermoctl.app.live.rows import Part, fitted
from thermoctl.quantities import Array

_VALUE, _ERROR, _UNIT = 8, 9, 7
_SPARK_SIGMAS = 3.0
_DOTS = braille.DOTS_HIGH


@dataclass(frozen=True, slots=True)
class Item:
    """One figure: name, value, how sure, unit, and a spark or a word.

    Parameters
    ----------
    label, short : str
        Its name, and the name where there is little room.
    value : str
        As written; `numbers.UNKNOWN` when it is not known, and then `unit` says why.
    error : str
        Two standard deviations as written, or empty.
    unit : str
        Its unit.
    tail : str
        A spark, as cells, or words.
    """

    label: str
    short: str
    value: str
    error: str = ""
    unit: str = ""
    tail: str = ""
    tail_role: Role = Role.TEXT


def _unknown(label: str, short: str, reason: str) -> Item:
    return Item(label, short, numbers.UNKNOWN, unit=reason)


def _error(sd: float | None, scale: float, decimals: int) -> str:
    digits = numbers.number(None if sd is None else 2.0 * scale * sd, decimals)
    return "" if digits == numbers.UNKNOWN else f"± {digits}"


def _spark(view: View, look: Look, cells: int, row: int, least: float) -> str:
    """Return the course of a belief over the range shown; `least` is the least height it spans.

    The least height is the error bar, so that a line that wanders within it looks flat.
    """
    values = _columns(view, cells)[row]
    known = values[np.isfinite(values)]
    if not known.size or not math.isfinite(least):
        return ""
    middle = 0.5 * (float(known.min()) + float(known.max()))
    half = max(0.5 * float(np.ptp(known)), 0.5 * least, 1e-12 + 1e-6 * abs(middle))
    level = braille.heights(values, middle - half, middle + half, _DOTS)
    return braille.cells(braille.envelope(*braille.joined(level, level), _DOTS), utf8=look.utf8)[0]


def _columns(view: View, cells: int) -> Array:
    return view.trend.columns(view.now_s, view.range_s / (2 * cells), 2 * cells)


def _no_belief(view: View) -> str:
    if view.step is None:
        return "no data yet"
    return "not known yet" if view.step.estimate.theta.size else f"{view.step.controller}: no model"


def _belief_items(view: View, look: Look, cells: int) -> list[Item]:
    """Return the left column."""
    believed, none = view.beliefs, _no_belief(view)
    items = []
    pole = numbers.number(believed.a, 4)
    if pole == numbers.UNKNOWN:
        items.append(_unknown("Pole a", "Pole a", none))
    else:
        spark = _spark(view, look, cells, trend.POLE, 4.0 * (believed.a_sd or 0.0))
        error = _error(believed.a_sd, 1.0, 4)
        items.append(Item("Pole a", "Pole a", pole, error, "", spark, Role.BLUE))
    gain = numbers.number(None if believed.gain is None else 60.0 * believed.gain, 2)
    if gain == numbers.UNKNOWN:
        items.append(_unknown("Gain", "Gain", none))
    else:
        spark = _spark(view, look, cells, trend.GAIN, 4.0 * (believed.gain_sd or 0.0))
        error = _error(believed.gain_sd, 60.0, 2) or "given"
        items.append(Item("Gain", "Gain", gain, error, "K/min", spark, Role.BLUE))
    holding = believed.holding_power
    digits = numbers.number(None if holding is None else 100.0 * holding, 0)
    if digits == numbers.UNKNOWN:
        # It was known: the model is there, but too vague at the set point of now.
        before = bool(np.isfinite(view.trend.table[trend.HOLDING]).any())
        items.append(_unknown("To hold", "To hold", "not at this set point" if before else none))
    else:
        spark = _spark(view, look, cells, trend.HOLDING, 0.05)
        items.append(Item("To hold", "To hold", digits, "", "%", spark, Role.BLUE))
    items.append(_innovation_item(view, look, cells))
    return items


def _innovation_item(view: View, look: Look, cells: int) -> Item:
    """Return the last innovation in its own σ, after those before it, a dot each within ±3σ."""
    label, short = "Innovation", "Innov."
    recent = view.recent.innovations
    digits = numbers.number(float(recent[-1]), 1, signed=True) if recent.size else numbers.UNKNOWN
    if digits == numbers.UNKNOWN:
        unused = view.step is not None and view.step.estimate.rejected
        return _unknown(label, short, "last sample not used" if unused else _no_belief(view))
    shown = np.full(2 * cells, np.nan)
    last = recent[-shown.size :]
    shown[shown.size - last.size :] = last
    level = braille.heights(
        np.clip(shown, -_SPARK_SIGMAS, _SPARK_SIGMAS), -_SPARK_SIGMAS, _SPARK_SIGMAS, _DOTS
    )
    spark = braille.cells(braille.envelope(level, level, _DOTS), utf8=look.utf8)[0]
    return Item(label, short, digits, "", "σ", spark, Role.BLUE)


def _inflation_item(view: View, look: Look, cells: int) -> Item:
    """Return the correction λ*, with bars from 1 on a logarithmic scale up to 10."""
    label, short = "Correction λ*", "λ*"
    step = view.step
    if step is None or not step.estimate.theta.size:
        return _unknown(label, short, _no_belief(view))
    bars = np.log10(np.clip(_columns(view, cells)[trend.INFLATION_HIGH], 1.0, 10.0))
    level = np.ceil((_DOTS - 1.0) * bars - 1e-9)
    dots = braille.envelope(np.zeros_like(level), level, _DOTS)
    spark = braille.cells(dots, utf8=look.utf8, mark="#")[0]
    return Item(label, short, numbers.number(step.estimate.inflation, 2), "", "", spark, Role.BLUE)


def _health_items(view: View, look: Look, cells: int) -> list[Item]:
    """Return the right column."""
    recent = view.recent
    items = [_inflation_item(view, look, cells)]
    if recent.whiteness is None or not view.steered:
        idle = view.step is not None and not view.steered
        reason = "judged in auto only" if idle else f"after {FEWEST} innovations"
        items.append(_unknown("Whiteness", "White", reason))
    else:
        value = numbers.number(recent.whiteness.autocorrelation, 2)
        lag = f"at {view.facts.period_s:g}{numbers.NBSP}s"
        items.append(Item("Whiteness", "White", value, unit=lag, tail=recent.whiteness.verdict))
    if math.isnan(recent.deviation_sd_k):
        items.append(_unknown("Deviation sd", "Dev. sd", f"after {FEWEST} good samples"))
    else:
        value, unit = numbers.difference(recent.deviation_sd_k).lstrip("+").split(numbers.NBSP)
        worst = f"max {numbers.difference(recent.deviation_max_k).lstrip('+')}"
        items.append(Item("Deviation sd", "Dev. sd", value, unit=unit, tail=worst))
    tick = numbers.number(recent.tick_us, 0)
    slow = numbers.number(recent.tick_99_us, 0)
    tail = "" if slow == numbers.UNKNOWN else f"99 % {slow}{numbers.NBSP}µs"
    items.append(Item("Tick time", "Tick", tick, unit="µs", tail=tail))
    return items


def _parts(item: Item, label_cells: int, cells: int, *, errors: bool) -> list[Part]:
    """Return an item in exactly `cells` cells."""
    label = item.label if len(item.label) < label_cells else item.short
    head: list[Part] = [(f"{label:<{label_cells}}", Role.MUTE)]
    if item.value == numbers.UNKNOWN:
        rest = cells - label_cells - _VALUE
        head += [(f"{item.value:>{_VALUE}}", Role.STRONG), (f" {item.unit:<{rest - 1}}", Role.MUTE)]
        return head
    head += [(f"{item.value:>{_VALUE}} ", Role.STRONG)]
    used = label_cells + _VALUE + 1
    if errors:
        role = Role.MUTE if item.error == "given" else Role.BLUE
        head += [(f"{item.error:<{_ERROR}}", role)]
        used += _ERROR
    head += [
        (f"{item.unit:<{_UNIT}}", Role.MUTE),
        (f"{item.tail:<{cells - used - _UNIT}}", item.tail_role),
    ]
    return head


def note(view: View, width: int) -> str:
    """Return what the rule above the panel says at its right, room permitting."""
    step = view.step
    if step is None or step.shadow is None or width < ROOMY:
        return _how_sure(view)
    power = numbers.number(None if step.shadow_power is None else 100.0 * step.shadow_power, 0)
    return f"shadow {step.shadow} {power}{numbers.NBSP}% · {_how_sure(view)}"


def _how_sure(view: View) -> str:
    """Return what an error bar is, and what is wrong with the samples, if anything."""
    white = view.recent.whiteness
    if view.steered and white is not None and white.verdict == "not white":
        return "± is 2σ · not white: model or noise is wrong"
    if view.step is not None and view.step.estimate.rejected:
        return "± is 2σ · last sample not used"
    return "± is 2σ"


def beliefs(view: View, look: Look, width: int) -> list[Text]:
    """Return the four rows of beliefs."""
    wide = width >= ROOMY
    left_label, right_label = (11, 14) if wide else (8, 8)
    left = width * 54 // 100 if wide else width // 2 + 2
    spark_left = left - left_label - _VALUE - 1 - _ERROR - _UNIT - (3 if wide else 2)
    spark_right = width - left - right_label - _VALUE - 1 - _UNIT
    rows = []
    for one, other in zip(
        _belief_items(view, look, spark_left),
        _health_items(view, look, spark_right),
        strict=True,
    ):
        first = fitted(look.text(*_parts(one, left_label, left, errors=True)), left)
        second = look.text(*_parts(other, right_label, width - left, errors=False))
        first.append_text(fitted(second, width - left))
        rows.append(fitted(first, width))
    return rows
