"""The figures of the panel, each made from a view."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thermoctl.app.live import braille, numbers, trend
from thermoctl.app.live.look import Look, Role
from thermoctl.app.live.model import FEWEST, View, to_hold, told
from thermoctl.insight import Row
from thermoctl.quantities import Array

_SPARK_SIGMAS = 3.0
_ERROR_CELLS = 10
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
        Two standard deviations or a range as written, or empty.
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


NOTHING = Item("", "", "")
"""An empty place."""


@dataclass(frozen=True, slots=True)
class Bench:
    """What items are made from: the view, the look, and cells for a spark."""

    view: View
    look: Look
    cells: int

    def spark(self, row: int, least: float) -> str:
        """Return the course of a belief over the range shown.

        It spans at least `least`, the error bar, so that a line that wanders within it looks flat.
        """
        values = self.columns()[row]
        known = values[np.isfinite(values)]
        if not known.size or not math.isfinite(least):
            return ""
        middle = 0.5 * (float(known.min()) + float(known.max()))
        half = max(0.5 * float(np.ptp(known)), 0.5 * least, 1e-12 + 1e-6 * abs(middle))
        level = braille.heights(values, middle - half, middle + half, _DOTS)
        return self.drawn(braille.envelope(*braille.joined(level, level), _DOTS))

    def drawn(self, dots: braille.Dots) -> str:
        """Return `dots`, one cell high; nothing where there is no braille."""
        return braille.cells(dots, utf8=True)[0] if self.look.utf8 else ""

    def columns(self) -> Array:
        """Return the run as dot columns of a spark."""
        view, count = self.view, 2 * self.cells
        return view.trend.columns(view.now_s, view.range_s / count, count)

    def no_belief(self) -> str:
        """Return why a law says nothing."""
        step = self.view.step
        if step is None:
            return "no data yet"
        return "not known yet" if step.estimate.theta.size else f"{step.controller}: no model"


Maker = Callable[[Bench], Item]


def _unknown(label: str, short: str, reason: str) -> Item:
    return Item(label, short, numbers.UNKNOWN, unit=reason)


def _error(twice_sd: float | None, decimals: int) -> str:
    digits = numbers.number(twice_sd, decimals)
    return "" if digits == numbers.UNKNOWN else f"± {digits}"


def _twice(sd: float | None, scale: float = 1.0) -> float | None:
    return None if sd is None else 2.0 * scale * sd


# -- what is believed ------------------------------------------------------------------------------


def pole(bench: Bench) -> Item:
    """Return the coefficient of the temperature one sample ago."""
    believed = bench.view.beliefs
    digits = numbers.number(believed.a, 4)
    if digits == numbers.UNKNOWN:
        return _unknown("Pole a", "Pole a", bench.no_belief())
    spark = bench.spark(trend.POLE, 4.0 * (believed.a_sd or 0.0))
    error = _error(_twice(believed.a_sd), 4)
    return Item("Pole a", "Pole a", digits, error, "", spark, Role.BLUE)


def gain(bench: Bench) -> Item:
    """Return the rise at full power; best as found out beside the controller."""
    row, believed = told(bench.view.insight, "gain"), bench.view.beliefs
    if row is not None:
        return _item(bench, row, "Gain", 2, trend.GAIN)
    digits = numbers.number(None if believed.gain is None else 60.0 * believed.gain, 2)
    if digits == numbers.UNKNOWN:
        return _unknown("Gain", "Gain", bench.no_belief())
    if believed.gain is not None and 2.0 * (believed.gain_sd or 0.0) > abs(believed.gain):
        return _unknown("Gain", "Gain", "not known yet")  # it might as well cool
    spark = bench.spark(trend.GAIN, 240.0 * (believed.gain_sd or 0.0))
    error = _error(_twice(believed.gain_sd, 60.0), 2) or "given"
    return Item("Gain", "Gain", digits, error, "K/min", spark, Role.BLUE)


def holding(bench: Bench) -> Item:
    """Return the power that holds the set point."""
    view = bench.view
    power, sd = (math.nan, math.nan) if view.step is None else to_hold(view.step, view.insight)
    digits = numbers.number(100.0 * power, 0)
    if digits == numbers.UNKNOWN:
        # It was known: the model is there, but too vague at the set point of now.
        before = bool(np.isfinite(view.trend.table[trend.HOLDING]).any())
        reason = "not at this set point" if before else bench.no_belief()
        return _unknown("To hold", "To hold", reason)
    error = _error(200.0 * sd, 0)
    spark = bench.spark(trend.HOLDING, 0.05)
    return Item("To hold", "To hold", digits, error, "%", spark, Role.BLUE)


def innovation(bench: Bench) -> Item:
    """Return the last innovation in its own σ, with a spark of those before it."""
    view, label, short = bench.view, "Innovation", "Innov."
    recent = view.recent.innovations
    digits = numbers.number(float(recent[-1]), 1, signed=True) if recent.size else numbers.UNKNOWN
    if digits == numbers.UNKNOWN:
        unused = view.step is not None and view.step.estimate.rejected
        return _unknown(label, short, "last sample not used" if unused else bench.no_belief())
    shown = np.full(2 * bench.cells, np.nan)
    last = recent[-shown.size :]
    shown[shown.size - last.size :] = last
    level = braille.heights(
        np.clip(shown, -_SPARK_SIGMAS, _SPARK_SIGMAS), -_SPARK_SIGMAS, _SPARK_SIGMAS, _DOTS
    )
    spark = bench.drawn(braille.envelope(level, level, _DOTS))
    return Item(label, short, digits, "", "σ", spark, Role.BLUE)


def inflation(bench: Bench) -> Item:
    """Return the correction λ*, with bars from 1 on a logarithmic scale up to 10."""
    label, short, step = "Correction λ*", "λ*", bench.view.step
    if step is None or not step.estimate.theta.size:
        return _unknown(label, short, bench.no_belief())
    bars = np.log10(np.clip(bench.columns()[trend.INFLATION_HIGH], 1.0, 10.0))
    level = np.ceil((_DOTS - 1.0) * bars - 1e-9)
    spark = bench.drawn(braille.envelope(np.zeros_like(level), level, _DOTS))
    return Item(label, short, numbers.number(step.estimate.inflation, 2), "", "", spark, Role.BLUE)


# -- the plant in physical words -------------------------------------------------------------------


_LOSSES = (("loss_w_per_k", 1), ("loss_w", 0), ("loss", 2))
"""Ways to say the loss, the best first, with their decimals."""

_SURE = 0.2
"""W/K is said once its error is no larger a share of it: it takes several set points to know."""


def loss(bench: Bench) -> Item:
    """Return what the plant loses, in watts where the heater's are known."""
    for name, decimals in _LOSSES:
        row = told(bench.view.insight, name)
        vague = name == "loss_w_per_k" and row is not None and not _is_sure(row)
        if row is not None and not vague:
            return _item(bench, row, "Loss", decimals, trend.LOSS)
    return _unknown("Loss", "Loss", "not known yet")


def _is_sure(row: Row) -> bool:
    if row.value is None or row.error is None:
        return False
    return row.error <= _SURE * abs(row.value)


def lag(bench: Bench) -> Item:
    """Return the time from heater to reading, with its 5 % and 95 % quantile."""
    row = told(bench.view.insight, "lag")
    if row is None:
        return _unknown("Lag", "Lag", "not known yet")
    return _item(bench, row, "Lag", 0, trend.LAG)


def water(bench: Bench) -> Item:
    """Return how much water it behaves like."""
    row = told(bench.view.insight, "volume")
    if row is None:
        return _unknown("Water", "Water", _why_not(bench, "volume"))
    return _item(bench, row, "Water", 1, None)


def noise(bench: Bench) -> Item:
    """Return the standard deviation of a reading."""
    row = told(bench.view.insight, "noise")
    if row is None:
        return _unknown("Noise", "Noise", "not known yet")
    return _item(bench, row, "Noise", 0, None)


def _why_not(bench: Bench, name: str) -> str:
    """Return the reason that stands where a value is not."""
    rows = () if bench.view.insight is None else bench.view.insight.rows
    words = next((row.text for row in rows if row.name == name), "")
    return words.lstrip(f"{numbers.UNKNOWN} ") or "not known yet"


def _item(bench: Bench, row: Row, label: str, decimals: int, course: int | None) -> Item:
    """Return a row of the insight with decimals that do not depend on its value."""
    low, high = numbers.number(row.low, decimals), numbers.number(row.high, decimals)
    ranged = numbers.UNKNOWN not in (low, high)
    error = f"({low} to {high})" if ranged else _error(row.error, decimals)
    if len(error) > _ERROR_CELLS and ranged:
        error = f"({low}–{high})"  # without brackets the row would read as three numbers
    spark = ""
    if course is not None:
        ranges = (row.high or 0.0) - (row.low or 0.0) if ranged else 2.0 * (row.error or 0.0)
        spark = bench.spark(course, ranges)
    unit = "L" if row.unit == "l" else row.unit
    digits = numbers.number(row.value, decimals)
    return Item(label, label, digits, error, unit, spark, Role.BLUE)


# -- how well it does ------------------------------------------------------------------------------


def white(bench: Bench) -> Item:
    """Return how white the innovations are, and the verdict."""
    view = bench.view
    if view.recent.whiteness is None or not view.steered:
        idle = view.step is not None and not view.steered
        reason = "judged in auto only" if idle else f"after {FEWEST} innovations"
        return _unknown("Whiteness", "White", reason)
    value = numbers.number(view.recent.whiteness.autocorrelation, 2)
    at = f"at {view.facts.period_s:g}{numbers.NBSP}s"
    return Item("Whiteness", "White", value, unit=at, tail=view.recent.whiteness.verdict)


def deviation(bench: Bench) -> Item:
    """Return how well the set point is held: against the bound, where one is known."""
    recent, insight = bench.view.recent, bench.view.insight
    if math.isnan(recent.deviation_sd_k):
        return _unknown("Deviation sd", "Dev. sd", f"after {FEWEST} good samples")
    value, unit = numbers.difference(recent.deviation_sd_k).lstrip("+").split(numbers.NBSP)
    ratio = numbers.number(None if insight is None else insight.performance.ratio, 2)
    tail = f"max {numbers.difference(recent.deviation_max_k).lstrip('+')}"
    if ratio != numbers.UNKNOWN:
        tail = f"{ratio} × bound"
    return Item("Deviation sd", "Dev. sd", value, unit=unit, tail=tail)


def tick(bench: Bench) -> Item:
    """Return what a cycle costs."""
    recent = bench.view.recent
    slow = numbers.number(recent.tick_99_us, 0)
    tail = "" if slow == numbers.UNKNOWN else f"99 % {slow}{numbers.NBSP}µs"
    value = numbers.number(recent.tick_us, 0)
    return Item("Tick time", "Tick", value, unit="µs", tail=tail)
