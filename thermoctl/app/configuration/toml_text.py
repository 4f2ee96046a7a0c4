"""Writes a configuration as TOML: tables, text, numbers, booleans and lists."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(content: Mapping[str, Any]) -> str:
    """Return `content` as a TOML document, its tables in the order they come in.

    Raises
    ------
    TypeError
        A value is of a type that a configuration does not have.
    """
    return "\n\n".join(_tables(content, ())) + "\n"


def toml_value(value: Any) -> str:
    """Return one value that is no table as TOML; raise TypeError if it has none."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # nan, inf, -inf
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Sequence):
        return f"[{', '.join(map(toml_value, value))}]"
    raise TypeError(f"expected text, a number, true, false or a list, got {value!r}")


def _tables(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    """Yield a block for `table`, unless it only holds tables, and one for each table in it."""
    values = [
        f"{_key(key)} = {toml_value(value)}"
        for key, value in table.items()
        if not isinstance(value, Mapping)
    ]
    if path and (values or not table):
        values.insert(0, f"[{'.'.join(map(_key, path))}]")
    if values:
        yield "\n".join(values)
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _tables(value, (*path, key))


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else toml_value(key)
