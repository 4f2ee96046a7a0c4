"""Make values plain: text that any terminal, file, journal or database takes."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

_NUMPY = (np.generic, np.ndarray)


def plain_text(value: Any) -> str:
    """Return `value` as one printable line, whatever had to be escaped."""
    text = str(value)
    return text if text.isprintable() else repr(text)[1:-1]


def as_json(fields: Mapping[str, Any]) -> str:
    """Return `fields` as one line of JSON; no finite number: null or text."""
    return json.dumps(_tame(fields))


def _tame(value: Any) -> Any:
    """Reduce to what JSON has: no NaN, no infinity, none of numpy's types."""
    if type(value) is float:  # nearly always, ten times a cycle of a simulation
        return value if math.isfinite(value) else None
    if isinstance(value, _NUMPY):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(name): _tame(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_tame(inner) for inner in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, int | None) else str(value)
