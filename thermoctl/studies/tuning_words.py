"""What a tuning found, as lines for people and as JSON."""

from __future__ import annotations

import dataclasses
import math
import textwrap
from collections.abc import Sequence
from typing import Any

from thermoctl.insight.wording import number
from thermoctl.studies.laws import parameter_names
from thermoctl.studies.orders_words import order_text, orders_json, orders_lines, orders_rows
from thermoctl.studies.plant_words import Bounded, PlantWords
from thermoctl.studies.tuning import Tuning
from thermoctl.studies.tuning_limits import Proposal
from thermoctl.studies.words import duration

_WIDTH = 18
_REFERENCE_LAGS = 3.0
_LINE, _DEEP = 96, " " * _WIDTH


def tuning_json(tuning: Tuning) -> dict[str, Any]:
    """Return orders, parameters and plant; None for what is not known."""
    return {
        "samples": len(tuning.record.t_s),
        **orders_json(tuning.weighing),
        "model": _model_json(tuning) if tuning.words is not None else None,
        "plant": _plant_json(tuning.words),
    }


def _model_json(tuning: Tuning) -> dict[str, Any]:
    """Return the order and its parameters."""
    order, score = tuning.order, tuning.score
    return {
        "n": order.n,
        "m": order.m,
        "delay": order.delay,
        "period_s": tuning.record.period_s,
        "theta": [_finite(value) for value in score.theta],
        "theta_sd": [_finite(value) for value in score.theta_sd],
        "rms_error": _finite(score.rms_error),
        "whiteness_p": _finite(score.whiteness_p),
    }


def _plant_json(words: PlantWords | None) -> dict[str, Any] | None:
    """Return each quantity with its bounds."""
    if words is None:
        return None
    return {
        field.name: None if bounded is None else dataclasses.asdict(bounded)
        for field in dataclasses.fields(words)
        for bounded in (getattr(words, field.name),)
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def tuning_lines(tuning: Tuning) -> list[str]:
    """Return what was found: the plant, the orders, the parameters."""
    record = tuning.record
    lines = [
        f"Record   {len(record.t_s):,} samples, every {record.period_s:g} s,"
        f" {duration(float(record.t_s[-1]))}",
        *(f"         {note}" for note in record.notes),
        *(["Order    given"] if tuning.given else orders_lines(tuning.weighing)),
        "",
        *_plant_lines(tuning),
        *(["", *_parameter_lines(tuning)] if tuning.words is not None else []),
    ]
    if not tuning.given:
        rows = orders_rows(tuning.weighing)
        lines += ["", _row("order n,m,d", "probability")]
        lines += [_row(order, probability) for order, probability in rows]
    return lines


def _plant_lines(tuning: Tuning) -> list[str]:
    words = tuning.words
    if words is None:
        return [
            "The plant cannot be told from this record: the power moved too little, or not at"
            " all, for its effect to stand out of the noise."
        ]
    rest, constant = words.rest_c, words.time_constant_min
    return [
        _row("Plant", "value ± 2σ"),
        _row("gain", _bounded(words.gain_k_per_min, "K/min at full power")),
        _row("lag", _bounded(words.lag_s, "s, from power to reading")),
        *_dead_time(tuning),
        _row("holding power", _bounded(words.holding_power, "% at the set point", 100.0)),
        _row("loss", _bounded(words.loss_k_per_min, "K/min at the set point")),
        _row("time constant", _interval(constant, "min") if constant else "not known"),
        _row("rest", _bounded(rest, "°C without power") if rest else "not known"),
    ]


def _dead_time(tuning: Tuning) -> list[str]:
    """Return the dead time of the order, where one was given or chosen."""
    if not (tuning.given or tuning.weighing.chosen) or not tuning.order.m:
        return []
    dead_s = (tuning.order.delay - 1) * tuning.record.period_s
    return [_row("dead time", f"{dead_s:g} s in order {order_text(tuning.order)}")]


def _parameter_lines(tuning: Tuning) -> list[str]:
    order, score = tuning.order, tuning.score
    names = parameter_names(order.structure())
    rows = zip(names, score.theta, score.theta_sd, strict=True)
    return [
        _row("Parameters", f"of order {order_text(order)}, ± 2σ"),
        *(_row(name, number(value, sd)) for name, value, sd in rows),
        _row("rms error", f"{score.rms_error:.4f} K, one step ahead"),
    ]


def _row(name: str, text: str) -> str:
    return f"{name:<{_WIDTH}}{text}"


def _bounded(bounded: Bounded, unit: str, factor: float = 1.0) -> str:
    sd = 0.25 * (bounded.high - bounded.low) if bounded.high is not None else math.inf
    return f"{number(factor * bounded.value, factor * sd)} {unit}"


def _interval(bounded: Bounded, unit: str) -> str:
    if bounded.high is None:
        return f"at least {bounded.low:.2g} {unit}; the record is too short to tell more"
    return f"{bounded.value:.0f} {unit}, between {bounded.low:.0f} and {bounded.high:.0f}"


def limit_lines(limits: Sequence[Proposal]) -> list[str]:
    """Return a row for each limit with its reasoning below; none without limits."""
    if not limits:
        return []
    rows = ["", _row("Limits", "configured, and proposed where that differs")]
    for limit in limits:
        rows.append(_row(limit.key, _limit_words(limit)))
        rows += textwrap.wrap(limit.why, _LINE, initial_indent=_DEEP, subsequent_indent=_DEEP)
    return rows


def _limit_words(limit: Proposal) -> str:
    """Return what is configured and, where that differs, what is proposed."""
    now, value = ("left out" if each is None else f"{each:g}" for each in (limit.now, limit.value))
    if limit.change:
        return f"configured: {now}, proposed: {value}"
    if value in (now, "left out"):
        return f"configured: {now}, which fits"
    return f"configured: {now}, which fits; proposed: {value} would do"


def limits_json(limits: Sequence[Proposal]) -> list[dict[str, Any]]:
    """Return each limit as `key`, `value`, `now`, `change` and `why`."""
    return [dataclasses.asdict(limit) for limit in limits]


def reference_time_s(words: PlantWords) -> float:
    """Return the reference time a minimum variance law should have, in s: three lags."""
    return round(_REFERENCE_LAGS * words.lag_s.value, 1)
