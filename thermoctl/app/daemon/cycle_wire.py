"""A finished cycle on its way through the control socket, and out of it again.

The record of `thermoctl.app.cycle_record` is what people and programs read; beside it go the
details without which no view could be drawn. What only simulations know stays behind, and so do
covariances: nobody shows them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, asdict, fields, replace
from typing import Any, TypeVar, get_type_hints

import numpy as np

from thermoctl.errors import Unavailable
from thermoctl.insight import Change, Drift, Gate, Insight, Limit, Performance, Row
from thermoctl.signals import (
    Alarm,
    Beliefs,
    Command,
    Cycle,
    Estimate,
    Event,
    Feasible,
    Measurement,
    Mode,
    Quality,
    ShadowScore,
    State,
    Step,
)

T = TypeVar("T", Alarm, Change, Drift, Event, Feasible, Performance, Row, ShadowScore)

_HINTS = {
    kind: get_type_hints(kind)
    for kind in (Alarm, Change, Drift, Event, Feasible, Performance, Row, ShadowScore)
}
"""Types of the fields; found out once, because that takes longer than all the rest."""


def details_of(cycle: Cycle, insight: Insight | None = None) -> dict[str, Any]:
    """Return what a view needs of `cycle` and its record does not hold.

    Parameters
    ----------
    cycle : Cycle
        The cycle.
    insight : Insight or None
        What is told of its plant; None where nobody looks.
    """
    step, estimate = cycle.step, cycle.step.estimate
    return {
        "reason": step.command.reason,
        "theta": estimate.theta,
        "innovation_var_k2": estimate.innovation_var,
        "rejected": estimate.rejected,
        "alarms": [asdict(alarm) for alarm in step.alarms],
        "events": [
            {"t_s": event.t_s, "name": event.name, "fields": event.fields} for event in step.events
        ],
        "insight": None if insight is None else insight.as_json(),
    }


def cycle_from(record: Mapping[str, Any], details: Mapping[str, Any]) -> Cycle:
    """Return the cycle that `record` and `details` tell of.

    Raises
    ------
    Unavailable
        They are not those of a daemon that this program understands.
    """
    with _understood():
        return _cycle(record, details)


def insight_from(details: Mapping[str, Any]) -> Insight | None:
    """Return the insight that `details` tell of; None where there is none.

    Raises
    ------
    Unavailable
        It is not that of a daemon that this program understands.
    """
    with _understood():
        told = details["insight"]
        return None if told is None else _insight(told)


@contextmanager
def _understood() -> Iterator[None]:
    try:
        yield
    except (KeyError, TypeError, ValueError) as error:
        text = f"expected a cycle of a daemon of the same version, and could not read {error}"
        raise Unavailable(text) from error


def _insight(told: Mapping[str, Any]) -> Insight:
    performance = _made(Performance, told["performance"])
    return Insight(
        t_s=_number(told["t_s"]),
        gate=Gate(told["gate"]),
        rows=tuple(_made(Row, each) for each in told["rows"]),
        changes=tuple(_made(Change, each) for each in told["changes"]),
        drifts=tuple(_made(Drift, each) for each in told["drifts"]),
        performance=replace(performance, limit=Limit(performance.limit)),
    )


def _cycle(record: Mapping[str, Any], details: Mapping[str, Any]) -> Cycle:
    t_s = float(record["t_s"])
    score = record["shadow_score"]
    quality = Quality(record["quality"])
    step = Step(
        t_s=t_s,
        measurement=Measurement(t_s, _number(record["temperature_c"]), quality),
        mode=Mode(record["mode"]),
        state=State(record["state"]),
        setpoint_c=_number(record["setpoint_c"]),
        command=Command(_number(record["power"]), t_s, str(details["reason"])),
        controller=str(record["controller"]),
        estimate=_estimate(record, details),
        beliefs=Beliefs(
            **{each.name: _maybe(record[each.name]) for each in fields(Beliefs)},
        ),
        alarms=tuple(_made(Alarm, each) for each in details["alarms"]),
        events=tuple(_made(Event, each) for each in details["events"]),
        shadow=record["shadow"],
        shadow_power=_maybe(record["shadow_power"]),
        shadow_score=None if score is None else _made(ShadowScore, score),
        feasible=_made(Feasible, record["feasible"]),
        reference_c=_number(record["reference_c"]),
        load=_number(record["load"]),
    )
    accepted, tick_us = _number(record["accepted_power"]), _number(record["tick_us"])
    return Cycle(str(record["loop"]), step, accepted, tick_us, _number(record["late_s"]))


def _estimate(record: Mapping[str, Any], details: Mapping[str, Any]) -> Estimate:
    theta = np.array([_number(each) for each in details["theta"]])
    return Estimate(
        theta=theta,
        P=np.full((theta.size, theta.size), math.nan),
        innovation=_number(record["innovation_k"]),
        innovation_var=_number(details["innovation_var_k2"]),
        inflation=_number(record["inflation"]),
        rejected=bool(details["rejected"]),
    )


def _made(kind: type[T], told: Mapping[str, Any]) -> T:
    """Return a `kind`; keys of a newer daemon are passed over, and null is a number not known."""
    hints = _HINTS[kind]
    given = {}
    for each in fields(kind):
        if each.name in told or (each.default is MISSING and each.default_factory is MISSING):
            given[each.name] = _plain(told[each.name], hints[each.name])
    return kind(**given)


def _plain(value: Any, hint: Any) -> Any:
    if hint is float:
        return _number(value)
    if isinstance(value, Mapping):
        return {name: math.nan if each is None else each for name, each in value.items()}
    return value


def _number(value: Any) -> float:
    """Return a number of JSON; NaN where it has none."""
    return math.nan if value is None else float(value)


def _maybe(value: Any) -> float | None:
    return None if value is None else float(value)
