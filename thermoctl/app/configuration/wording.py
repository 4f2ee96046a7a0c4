"""Why a value was refused, in words: what was expected and what came."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from thermoctl.app.configuration.toml_places import KeyPath
from thermoctl.app.configuration.units import other_unit
from thermoctl.app.plugins import blamed, nearest
from thermoctl.quantities import is_finite_number

Model = TypeVar("Model", bound=BaseModel)

_LONGEST = 60
_MEMBER = re.compile(r"<\w+\.\w+: ('[^']*')>")
"""A member of an enumeration as Python shows it, and the word in it."""
_TAG = re.compile(r"<\w+>")
"""In the place of an error: which one of several tables was meant; not a key."""
_EXPECTED = {
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "text in quotes",
    "finite_number": "a finite number",
    "greater_than": "a number above {gt:g}",
    "greater_than_equal": "at least {ge:g}",
    "less_than": "a number below {lt:g}",
    "less_than_equal": "at most {le:g}",
    "literal_error": "{expected}",
    "enum": "{expected}",
    "model_type": "a table",
    "dict_type": "a table",
    "tuple_type": "a list",
    "list_type": "a list",
    "string_too_short": "text of at least {min_length} characters",
    "string_too_long": "text of at most {max_length} characters",
}


def validated(model: type[Model], table: Any) -> Model:
    """Return `table` as a `model`; text is never taken for a number, nor 1 for true.

    The detour over JSON is what makes pydantic strict about numbers and yet take a list for a
    tuple and a word for an enumeration, in the settings of every driver alike.

    Raises
    ------
    ValidationError
        As pydantic does.
    """
    return model.model_validate_json(json.dumps(table, default=_plain), strict=True)


def reasons(
    error: ValidationError, model: type[BaseModel], only: str = ""
) -> list[tuple[KeyPath, str]]:
    """Return path and words of each complaint of `error`, or of those of one type."""
    told = []
    for each in error.errors(include_url=False):
        if only not in ("", each["type"]):
            continue
        path = keys_to(each)
        if each["type"] == "value_error":  # of a whole table: its text begins with the key it means
            text = str(each["msg"]).removeprefix("Value error, ")
            written = each["input"] if isinstance(each["input"], Mapping) else ()
            meant = blamed(ValueError(text), {*known_keys(model, path), *written})
            told.append((path + meant.path, meant.text))
        else:
            told.append((path, _reason(each, path, known_keys(model, path[:-1]))))
    return told


def keys_to(error: Any) -> KeyPath:
    """Return the keys that lead to the place of one of pydantic's errors in a table."""
    place = tuple(map(str, error["loc"]))
    unknown = place[-1:] if error["type"] == "extra_forbidden" else ()  # it may look like a tag
    above = place[: len(place) - len(unknown)]
    return (*(part for part in above if not _TAG.fullmatch(part)), *unknown)


def unknown_key(key: str, known: Iterable[str], value: Any = None) -> str:
    """Return a sentence about an unknown `key`, with the one probably meant."""
    names = list(known)
    return f"unknown key{other_unit(key, value, names) or nearest(key, names)}"


def shown(value: Any) -> str:
    """Return `value` as an error shows it: as written, and not endlessly long."""
    try:
        words = json.dumps(value, default=str, ensure_ascii=False)
    except ValueError:
        words = repr(value)
    return words if len(words) <= _LONGEST else f"{words[:_LONGEST]}..."


def known_keys(model: type[BaseModel], path: KeyPath) -> list[str]:
    """Return the keys of the table at `path` below `model`."""
    annotation: Any = model
    for part in path:
        inner = table_in(annotation)
        if get_origin(annotation) is dict or inner is None:
            annotation = inner  # `part` is the name of one of many tables
        else:
            field = inner.model_fields.get(part)
            annotation = None if field is None else field.annotation
    inner = table_in(annotation)
    return sorted(inner.model_fields) if inner is not None else []


def table_in(annotation: Any) -> type[BaseModel] | None:
    """Return the model inside an annotation, such as ``dict[str, Model]``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for each in get_args(annotation) if (found := table_in(each))), None)


def _reason(error: Any, path: KeyPath, known: list[str]) -> str:
    kind, value = error["type"], error["input"]
    if kind == "extra_forbidden":
        return unknown_key(path[-1], known, value)
    if kind == "missing":
        return "expected a value, got none"
    if kind not in _EXPECTED:
        message = str(error["msg"])
        return f"{message[0].lower()}{message[1:]}, got {shown(value)}"
    expected = _MEMBER.sub(r"\1", _EXPECTED[kind].format(**error.get("ctx", {})))
    return f"expected {expected}, got {shown(value)}{quotes_hint(expected, value)}"


def quotes_hint(expected: str, value: Any) -> str:
    """Return the advice to leave the quotes out, when a number stands in them."""
    if "number" not in expected or not isinstance(value, str):
        return ""
    try:
        finite = is_finite_number(float(value))
    except ValueError:
        return ""
    return " (write it without quotes)" if finite else ""


def _plain(value: Any) -> Any:
    """Return what JSON does not know: a number of another library as such, the rest as text."""
    if isinstance(value, Integral):
        return int(value)
    return float(value) if isinstance(value, Real) else str(value)
