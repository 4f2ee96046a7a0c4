"""The tables of the history, and what one cycle looks like in them.

A column is described once, in `COLUMNS`: the table, the row of a cycle, the arrays of the reader
and the header of the CSV all follow from it, and so does what an older file lacks.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from thermoctl.services.plain import as_json
from thermoctl.signals import TRUE_TEMPERATURE, Cycle, Event

SCHEMA_VERSION: Final = 3
"""Kept in ``PRAGMA user_version``; a higher one was written by a newer thermoctl."""

APPLICATION_ID: Final = 0x7468726D
"""Kept in ``PRAGMA application_id``, ``thrm`` in ASCII: tells our file from somebody else's."""

Value = float | int | str | None
Kind = Literal["REAL", "INTEGER", "TEXT"]


@dataclass(frozen=True, slots=True)
class RunInfo:
    """One start of the daemon: which program, with which configuration.

    Parameters
    ----------
    version : str
        Version of thermoctl.
    configuration : str
        The whole configuration in force, as JSON text.
    started_utc_s : float or None
        Wall clock at the start, in s since 1970 UTC; None: when the first cycle is stored.

    Raises
    ------
    ValueError
        The configuration is no JSON object.
    """

    version: str
    configuration: str = "{}"
    started_utc_s: float | None = None

    def __post_init__(self) -> None:
        if type(json.loads(self.configuration)) is not dict:
            raise ValueError(f"configuration must be a JSON object, got {self.configuration!r}")


@dataclass(frozen=True, slots=True)
class Column:
    """One column of ``cycles``: name with unit, type, and where it is from.

    `since` is the first schema that has it; rows of an older one have nothing in it.
    """

    name: str
    kind: Kind
    of: Callable[[Cycle], Value]
    since: int = 1


def _active(cycle: Cycle) -> str | None:
    codes = [alarm.code for alarm in cycle.step.alarms if alarm.active or alarm.latched]
    return " ".join(codes) or None


def _other_truth(cycle: Cycle) -> str | None:
    rest = {name: value for name, value in cycle.truth.items() if name != TRUE_TEMPERATURE}
    return as_json(rest) if rest else None


COLUMNS: Final = (
    Column("loop", "TEXT", lambda c: c.loop),
    Column("t_s", "REAL", lambda c: c.step.t_s),
    Column("mode", "TEXT", lambda c: c.step.mode.value),
    Column("state", "TEXT", lambda c: c.step.state.value),
    Column("temperature_c", "REAL", lambda c: c.step.measurement.temperature_c),
    Column("quality", "TEXT", lambda c: c.step.measurement.quality.value),
    Column("setpoint_c", "REAL", lambda c: c.step.setpoint_c),
    Column("reference_c", "REAL", lambda c: c.step.reference_c, since=3),
    Column("power", "REAL", lambda c: c.step.command.power),
    Column("accepted_power", "REAL", lambda c: c.accepted_power),
    Column("reason", "TEXT", lambda c: c.step.command.reason),
    Column("controller", "TEXT", lambda c: c.step.controller),
    Column("innovation_k", "REAL", lambda c: c.step.estimate.innovation),
    Column("innovation_var_k2", "REAL", lambda c: c.step.estimate.innovation_var),
    Column("inflation", "REAL", lambda c: c.step.estimate.inflation),
    Column("rejected", "INTEGER", lambda c: int(c.step.estimate.rejected)),
    Column("gain_k_per_s", "REAL", lambda c: c.step.beliefs.gain),
    Column("gain_sd_k_per_s", "REAL", lambda c: c.step.beliefs.gain_sd),
    Column("a", "REAL", lambda c: c.step.beliefs.a),
    Column("a_sd", "REAL", lambda c: c.step.beliefs.a_sd),
    Column("holding_power", "REAL", lambda c: c.step.beliefs.holding_power),
    Column("lag_s", "REAL", lambda c: c.step.beliefs.lag_s, since=2),
    Column("shadow", "TEXT", lambda c: c.step.shadow, since=2),
    Column("shadow_power", "REAL", lambda c: c.step.shadow_power, since=2),
    Column("tick_us", "REAL", lambda c: c.tick_us),
    Column("late_s", "REAL", lambda c: c.late_s),
    Column("missed", "INTEGER", lambda c: c.missed),
    Column("alarms", "TEXT", _active),
    Column(TRUE_TEMPERATURE, "REAL", lambda c: c.truth.get(TRUE_TEMPERATURE)),
    Column("other_truth", "TEXT", _other_truth),
)

SCHEMA: Final = f"""
CREATE TABLE runs (
    id INTEGER PRIMARY KEY,
    started_utc_s REAL NOT NULL,
    version TEXT NOT NULL,
    configuration TEXT NOT NULL
);
CREATE TABLE cycles (
    id INTEGER PRIMARY KEY,
    run INTEGER NOT NULL REFERENCES runs (id),
    wall_utc_s REAL NOT NULL,
    {", ".join(f"{column.name} {column.kind}" for column in COLUMNS)}
);
CREATE INDEX cycles_by_wall ON cycles (wall_utc_s);
CREATE TABLE events (
    id INTEGER PRIMARY KEY,
    run INTEGER NOT NULL REFERENCES runs (id),
    wall_utc_s REAL NOT NULL,
    loop TEXT,
    t_s REAL NOT NULL,
    name TEXT NOT NULL,
    fields TEXT NOT NULL
);
CREATE TABLE clock_steps (
    id INTEGER PRIMARY KEY,
    run INTEGER NOT NULL REFERENCES runs (id),
    wall_utc_s REAL NOT NULL,
    t_s REAL NOT NULL,
    step_s REAL NOT NULL
);
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {SCHEMA_VERSION};
"""

INSERT_RUN: Final = "INSERT INTO runs (started_utc_s, version, configuration) VALUES (?, ?, ?)"
FIND_RUN: Final = (
    "SELECT id FROM runs WHERE started_utc_s = ? AND version = ? AND configuration = ? "
    "ORDER BY id DESC LIMIT 1"
)
INSERT_CYCLE: Final = (
    f"INSERT INTO cycles (run, wall_utc_s, {', '.join(column.name for column in COLUMNS)}) "
    f"VALUES (?, ?, {', '.join('?' * len(COLUMNS))})"
)
INSERT_EVENT: Final = (
    "INSERT INTO events (run, wall_utc_s, loop, t_s, name, fields) VALUES (?, ?, ?, ?, ?, ?)"
)
INSERT_CLOCK_STEP: Final = (
    "INSERT INTO clock_steps (run, wall_utc_s, t_s, step_s) VALUES (?, ?, ?, ?)"
)


def migration(version: int) -> list[str]:
    """Return the statements that bring a file of schema `version` up to date."""
    missing = [column for column in COLUMNS if column.since > version]
    added = [f"ALTER TABLE cycles ADD COLUMN {each.name} {each.kind}" for each in missing]
    return [*added, f"PRAGMA user_version = {SCHEMA_VERSION}"]


def readable_from(name: str, version: int) -> str:
    """Return what to select for the column `name` in a file of schema `version`."""
    lacking = any(column.name == name and column.since > version for column in COLUMNS)
    return f"NULL AS {name}" if lacking else name


def row_of(cycle: Cycle) -> tuple[Value, ...]:
    """Return `cycle` as the values of `COLUMNS`; NaN and infinities become NULL."""
    return tuple([storable(of(cycle)) for of, storable in _CELLS])


def event_row_of(event: Event, loop: str | None) -> tuple[Value, ...]:
    """Return `event` as loop, t_s, name and its fields as JSON text."""
    return _text(loop), _real(event.t_s) or 0.0, _text(event.name), as_json(event.fields)


def _real(value: Any) -> float | None:
    """SQLite turns NaN into NULL by itself; infinities it would keep."""
    if value is None:
        return None
    number = float(value)
    return number if math.isfinite(number) else None


def _text(value: Any) -> str | None:
    """One lone surrogate would make SQLite refuse the row, and with it the whole batch."""
    if value is None:
        return None
    text = str(value)
    return text if text.isascii() else text.encode(errors="replace").decode()


_STORABLE: Final[Mapping[Kind, Callable[[Any], Value]]] = {
    "REAL": _real,
    "INTEGER": lambda value: None if value is None else int(value),
    "TEXT": _text,
}
"""Plain values only: sqlite3 refuses numpy's integers and its float32."""
_CELLS: Final = tuple((column.of, _STORABLE[column.kind]) for column in COLUMNS)
