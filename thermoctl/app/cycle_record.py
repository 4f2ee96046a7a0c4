"""A finished cycle as the keys that leave the program.

Kept apart from what is written for people, so that the daemon needs no terminal library for it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

from thermoctl.services.store import Latch
from thermoctl.signals import TRUE_TEMPERATURE, Cycle, Estimate, Feasible, ShadowScore

_ENCODER = json.JSONEncoder(allow_nan=False, check_circular=False)  # a record is made afresh


def finite(value: float | None) -> float | None:
    """Return `value`, None where it is not known; no NaN ever leaves the program."""
    return None if value is None or not math.isfinite(value) else value


def iso_time(utc_s: float) -> str | None:
    """Return a time in s since 1970 UTC as ISO 8601, None where it is not known."""
    known = math.isfinite(utc_s)
    return datetime.fromtimestamp(utc_s, UTC).isoformat(timespec="seconds") if known else None


def as_line(cycle: Cycle, beside: Mapping[str, Any] = MappingProxyType({})) -> str:
    """Return the cycle, and keys found beside it, as one JSON object."""
    record = cycle_record(cycle)
    record.update(beside)
    return _ENCODER.encode(record)


def cycle_record(cycle: Cycle) -> dict[str, Any]:
    """Return what is told of a cycle, None for what is not known."""
    step, beliefs, estimate = cycle.step, cycle.step.beliefs, cycle.step.estimate
    record: dict[str, Any] = {
        "t_s": round(step.t_s, 6),
        "loop": cycle.loop,
        "mode": step.mode.value,
        "state": step.state.value,
        "temperature_c": finite(step.measurement.temperature_c),
        "quality": step.measurement.quality.value,
        "setpoint_c": step.setpoint_c,
        "reference_c": finite(step.reference_c),
        "load": step.load,
        "power": step.command.power,
        "accepted_power": finite(cycle.accepted_power),
        "controller": step.controller,
        "innovation_k": finite(_innovation(estimate)),
        "inflation": finite(estimate.inflation),
        "gain": finite(beliefs.gain),
        "gain_sd": finite(beliefs.gain_sd),
        "a": finite(beliefs.a),
        "a_sd": finite(beliefs.a_sd),
        "holding_power": finite(beliefs.holding_power),
        "lag_s": finite(beliefs.lag_s),
        "model_origin": step.origin,
        "shadow": step.shadow,
        "shadow_power": step.shadow_power,
        "shadow_score": None if step.shadow_score is None else _flat(step.shadow_score),
        "feasible": _flat(step.feasible),
        "tick_us": round(cycle.tick_us, 1),
        "late_s": round(cycle.late_s, 6),
        "alarms": [alarm.code for alarm in step.alarms],
    }
    if TRUE_TEMPERATURE in cycle.truth:  # of a simulation, which alone knows it
        record[TRUE_TEMPERATURE] = cycle.truth[TRUE_TEMPERATURE]
    return record


def _flat(told: Feasible | ShadowScore) -> dict[str, float | None]:
    """Return the numbers of `told` by name; `asdict` would copy each of them as if it were deep."""
    return {name: finite(getattr(told, name)) for name in told.__slots__}


def _innovation(estimate: Estimate) -> float:
    return math.nan if estimate.rejected else estimate.innovation


def latch_row(loop: str, latch: Latch) -> dict[str, Any]:
    """Return a stored latch as the alarm that it was, and will be again."""
    return {
        "loop": loop,
        "code": latch.code,
        "fault": latch.fault,
        "priority": 1,
        "since": iso_time(latch.since_utc_s),
        "active": True,
        "latched": True,
        "acknowledged": False,
        "text": latch.text,
    }
