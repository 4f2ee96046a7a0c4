"""What is left of a table without its mistakes, to find those behind them.

Nothing that is mended here is ever run: a document with a mistake is refused whatever follows.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ValidationError

from thermoctl.app.configuration.wording import validated

Model = TypeVar("Model", bound=BaseModel)
KeyPath = tuple[str, ...]

_ROUNDS: Final = 8
"""Removing a key may leave another one missing, or show a table that contradicts itself."""


def repaired(model: type[Model], table: Any, stand_ins: Mapping[str, Any]) -> Model | None:
    """Return `table` as a `model` without what is wrong in it, None if that fails.

    Parameters
    ----------
    model : type
        What the table should have been.
    table : any
        Its content as it was written.
    stand_ins : mapping
        By key, what is taken for all of them where one is missing, bad or contradicts another;
        None leaves a key out.
    """
    for _ in range(_ROUNDS):
        if not isinstance(table, Mapping):
            return None
        try:
            whole = validated(model, table)
        except ValidationError as error:
            for each in error.errors(include_url=False):
                table = _mended(table, _path(each["loc"]), each["type"], stand_ins)
        else:
            return whole if isinstance(whole, model) else None
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


def without_keys_beside(limits: Collection[str], error: ValidationError, table: Any) -> Any:
    """Return a copy of `table` without what `error` names, save those of `limits`."""
    for each in error.errors(include_url=False):
        path = _path(each["loc"])
        if path and path[0] not in limits and isinstance(table, Mapping):
            table = _mended(table, path, each["type"], {})
    return table


def _path(loc: tuple[int | str, ...]) -> KeyPath:
    """Return the keys of a place in a table, without the tags of what it may be."""
    return tuple(str(part) for part in loc if str(part)[:1] != "<")


def _mended(
    table: Mapping[str, Any], path: KeyPath, kind: str, stand_ins: Mapping[str, Any]
) -> Mapping[str, Any]:
    """Return `table` without the key at `path`, or with what stands in for it."""
    if not path or path[0] in stand_ins:
        kept = {key: value for key, value in table.items() if key not in stand_ins}
        return {**kept, **{key: each for key, each in stand_ins.items() if each is not None}}
    return without(table, path[:-1] if kind == "missing" and len(path) > 1 else path)
