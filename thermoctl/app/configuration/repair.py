"""What is left of a table without its mistakes, to find those behind them.

Nothing that is mended here is ever run: a document with a mistake is refused whatever follows.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from pydantic import ValidationError

from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.configuration.toml_places import KeyPath
from thermoctl.app.configuration.wording import keys_to, validated

LIMITS: Final[Mapping[str, float | None]] = {
    "setpoint_c": 20.0,
    "trip_above_c": 100.0,
    "trip_below_c": None,
    "setpoint_min_c": None,
    "setpoint_max_c": None,
}
"""Limits that contradict nothing, for a loop whose own do: its laws are tried out all the same.
All of them are taken where one is missing, bad or contradicts another; None leaves a key out."""


def repaired(table: Any) -> LoopTable | None:
    """Return the table of a loop without what is wrong in it, None if that fails."""
    while isinstance(table, Mapping):
        mended = table
        try:
            return validated(LoopTable, table)
        except ValidationError as error:
            for each in error.errors(include_url=False):
                mended = _mended(mended, keys_to(each), each["type"])
        if mended == table:
            return None
        table = mended
    return None


def without(table: Mapping[str, Any], path: KeyPath) -> Mapping[str, Any]:
    """Return a copy of `table` without the key at `path`, if it is there."""
    key, *rest = path
    if key not in table:
        return table
    inner = table[key]
    if not rest or not isinstance(inner, Mapping):
        return {each: value for each, value in table.items() if each != key}
    return {**table, key: without(inner, tuple(rest))}


def without_unknown_keys(error: ValidationError, table: Any) -> Any:
    """Return a copy of `table` without the keys that `error` does not know."""
    for each in error.errors(include_url=False):
        if each["type"] == "extra_forbidden":
            table = without(table, keys_to(each))
    return table


def without_keys_beside_limits(error: ValidationError, table: Any) -> Any:
    """Return a copy of a loop's table without what `error` names, save its limits."""
    for each in error.errors(include_url=False):
        path = keys_to(each)
        if path and path[0] not in LIMITS:
            table = _mended(table, path, each["type"])
    return table


def _mended(table: Mapping[str, Any], path: KeyPath, kind: str) -> Mapping[str, Any]:
    """Return `table` without the key at `path`, or with what stands in for it."""
    if not path or path[0] in LIMITS:
        kept = {key: value for key, value in table.items() if key not in LIMITS}
        return {**kept, **{key: each for key, each in LIMITS.items() if each is not None}}
    return without(table, path[:-1] if kind == "missing" and len(path) > 1 else path)
