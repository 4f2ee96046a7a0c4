"""Numbers that a setting may have, written beside its default."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, fields
from typing import Any

from thermoctl.quantities import is_finite_number


def ranged(default: float, low: float, high: float) -> Any:
    """Return a field of a dataclass that takes numbers in [low, high].

    A whole `default` makes it a whole number. The class has to call `check_ranges`.
    """
    return field(default=default, metadata={"minimum": low, "maximum": high})


def check_ranges(settings: Any) -> None:
    """Raise ``ValueError`` naming the first field that is outside its range."""
    for each in fields(settings):
        if each.metadata:
            value = getattr(settings, each.name)
            require(each.name, value, **each.metadata)
            if isinstance(each.default, int) and not isinstance(value, int):
                raise ValueError(f"{each.name} must be a whole number, got {value!r}")


def require(name: str, value: Any, minimum: float, maximum: float) -> None:
    """Raise ``ValueError`` naming `name` unless `value` is a number within."""
    if not _is_within(value, minimum, maximum):
        raise ValueError(f"{name} must lie in [{minimum:g}, {maximum:g}], got {value!r}")


def number(content: Mapping[str, Any], name: str, minimum: float, maximum: float) -> float:
    """Return the number `name` of what was read, or raise ``ValueError``."""
    value = content.get(name)
    if not _is_within(value, minimum, maximum):
        raise ValueError(f"expected {name} in [{minimum:g}, {maximum:g}], got {value!r}")
    return float(value)  # type: ignore[arg-type]


def _is_within(value: Any, minimum: float, maximum: float) -> bool:
    return is_finite_number(value) and minimum <= value <= maximum
