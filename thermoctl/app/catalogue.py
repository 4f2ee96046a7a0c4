"""What can be configured: type, unit, bounds, default and text of every key.

Drawn from the settings models and from the signatures and docstrings of the laws, so that what is
listed is what is accepted.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, get_args, get_type_hints

from pydantic import BaseModel, TypeAdapter

from thermoctl.app import plugins
from thermoctl.app.configuration.tables import NOISES, EstimatorTable, LoopTable
from thermoctl.app.configuration.toml_text import toml_value
from thermoctl.app.configuration.units import unit_of
from thermoctl.app.settings import Settings

INJECTED = ("period_s", "structure")
"""What the composer gives to a law; never an option."""

_WORDS = {
    "number": "number",
    "integer": "whole number",
    "boolean": "true or false",
    "string": "text",
    "array": "list",
    "object": "table",
}
_LIMITS = {
    "minimum": "≥ {}",
    "exclusiveMinimum": "> {}",
    "maximum": "≤ {}",
    "exclusiveMaximum": "< {}",
}
_SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}\n", re.MULTILINE)
_ARGUMENT = re.compile(r"^(?P<names>\w+(?:, \w+)*)(?: : .*)?$")


@dataclass(frozen=True, slots=True)
class Row:
    """One key that may be set."""

    key: str
    type: str
    unit: str
    bounds: str
    default: str
    text: str


def rows_of_model(model: type[BaseModel]) -> list[Row]:
    """Return a row for each key of a settings model."""
    schema = model.model_json_schema()
    required = schema.get("required", ())
    definitions = schema.get("$defs", {})
    return [
        _row(key, each, definitions, key in required) for key, each in schema["properties"].items()
    ]


def rows_of_law(law: type) -> list[Row]:
    """Return a row for each option of a law, and for each key of its tables."""
    return list(_rows("", option_schemas(law)))


def _rows(above: str, options: Mapping[str, Any]) -> Iterable[Row]:
    for key, each in options.items():
        if "properties" in each:
            yield from _rows(f"{above}{key}.", each["properties"])
        else:
            yield _row(f"{above}{key}", each, {}, "default" not in each)


def option_schemas(law: type) -> dict[str, dict[str, Any]]:
    """Return the JSON schema of each option of a law, documented as in its docstring."""
    texts, hints = parameter_texts(law), get_type_hints(law)
    schemas = {}
    for field in dataclasses.fields(law):
        if field.name in INJECTED or not field.init:
            continue
        hint = float if float in get_args(hints[field.name]) else hints[field.name]
        if dataclasses.is_dataclass(hint):
            schemas[field.name] = _table_schema(hint)
            continue
        schemas[field.name] = TypeAdapter(hint).json_schema() | dict(field.metadata)
        schemas[field.name]["description"] = texts.get(field.name, "")
        if field.default is not dataclasses.MISSING:
            schemas[field.name]["default"] = field.default
    for name, default in _defaults_in_a_loop(law).items():
        schemas[name]["default"] = default
    return schemas


def _defaults_in_a_loop(law: type) -> Mapping[str, Any]:
    """Return the defaults that a configuration has in place of the law's own."""
    for kind, defaults in NOISES.items():
        if plugins.find(plugins.ESTIMATORS, kind) is law:
            return defaults
    return {}


def _table_schema(group: Any) -> dict[str, Any]:
    """Return the JSON schema of options that stand in a table of their own."""
    return {
        "type": "object",
        "description": first_line(group),
        "default": {},
        "properties": option_schemas(group),
        "additionalProperties": False,
    }


def parameter_texts(law: type) -> dict[str, str]:
    """Return what the section "Parameters" of a docstring says of each argument."""
    sections = _SECTION.split(inspect.getdoc(law) or "")
    body = dict(zip(sections[1::2], sections[2::2], strict=True)).get("Parameters", "")
    texts: dict[str, list[str]] = {}
    names: list[str] = []
    for line in body.splitlines():
        if argument := _ARGUMENT.match(line):
            names = argument["names"].split(", ")
        elif line.strip():
            for name in names:
                texts.setdefault(name, []).append(line.strip())
    return {name: " ".join(lines) for name, lines in texts.items()}


def first_line(documented: Any) -> str:
    """Return the first line of a docstring, "" where there is none."""
    return (inspect.getdoc(documented) or "").partition("\n")[0]


def schema() -> dict[str, Any]:
    """Return the JSON schema of a configuration, with all kinds and their options."""
    whole = Settings.model_json_schema()
    definitions = whole["$defs"]
    boards = [_board_schema(kind, definitions) for kind in plugins.kinds(plugins.DRIVERS)]
    whole["properties"]["boards"]["additionalProperties"] = {"oneOf": boards}
    loop = definitions["LoopTable"]["properties"]
    kinds = list(plugins.kinds(plugins.CONTROLLERS))
    controllers = [_law_schema(plugins.CONTROLLERS, kind, {}) for kind in kinds]
    for key in ("controller", "shadow"):
        default = LoopTable.model_fields[key].get_default(call_default_factory=True)
        loop[key] = {
            "description": loop[key]["description"],
            "default": None if default is None else default.model_dump(),
            "anyOf": [{"enum": kinds}, *controllers],
        }
    shared = dict(definitions["EstimatorTable"]["properties"])
    del shared["kind"]
    group = plugins.ESTIMATORS
    estimators = [_law_schema(group, kind, shared) for kind in plugins.kinds(group)]
    loop["estimator"] = {
        "description": first_line(EstimatorTable),
        "default": {"kind": EstimatorTable().kind},
        "anyOf": estimators,
    }
    for unused in ("Options", "EstimatorTable", "BaseModel"):
        definitions.pop(unused, None)
    _add_units(whole)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **whole}


def _board_schema(kind: str, definitions: dict[str, Any]) -> dict[str, Any]:
    board: dict[str, Any] = plugins.find(plugins.DRIVERS, kind).Settings.model_json_schema()
    definitions.update(board.pop("$defs", {}))
    board["required"] = sorted({*board.get("required", ()), "kind"})
    return board


def _law_schema(group: str, kind: str, shared: Mapping[str, Any]) -> dict[str, Any]:
    law = plugins.find(group, kind)
    options = option_schemas(law)
    needed = [name for name, each in options.items() if "default" not in each]
    return {
        "type": "object",
        "description": first_line(law),
        "properties": {"kind": {"const": kind}, **shared, **options},
        "required": ["kind", *needed],
        "additionalProperties": False,
    }


def _add_units(node: Any) -> None:
    """Write the unit that a key wears beside its schema, everywhere below `node`."""
    if isinstance(node, list):
        for each in node:
            _add_units(each)
    if not isinstance(node, dict):
        return
    properties = node.get("properties")
    for key, each in properties.items() if isinstance(properties, dict) else ():
        if isinstance(each, dict) and (unit := unit_of(key)):
            each["x-unit"] = unit
    for each in node.values():
        _add_units(each)


def _row(key: str, field: Mapping[str, Any], definitions: Any, required: bool) -> Row:
    kinds = [_resolved(each, definitions) for each in field.get("anyOf", (field,))]
    kinds = [each for each in kinds if each.get("type") != "null"]
    default = field.get("default")
    text = str(field.get("description") or kinds[0].get("description", ""))
    return Row(
        key=key,
        type=" or ".join(dict.fromkeys(_type(each) for each in kinds)),
        unit=unit_of(key),
        bounds=", ".join(dict.fromkeys(b for each in kinds for b in _bounds(each))),
        default="required" if required else _default(default),
        text=text,
    )


def _default(default: Any) -> str:
    if default is None:
        return ""
    if isinstance(default, Mapping):
        return ", ".join(f"{key} = {_default(each)}" for key, each in default.items())
    return toml_value(default)


def _resolved(field: Mapping[str, Any], definitions: Mapping[str, Any]) -> Mapping[str, Any]:
    reference = str(field.get("$ref", "")).rpartition("/")[2]
    found: Mapping[str, Any] = definitions.get(reference, field)
    return found


def _type(field: Mapping[str, Any]) -> str:
    if "const" in field:
        return toml_value(field["const"])
    if "enum" in field:
        *others, last = map(toml_value, field["enum"])
        return f"{', '.join(others)} or {last}" if others else last
    return _WORDS.get(str(field.get("type")), "table")


def _bounds(field: Mapping[str, Any]) -> Iterable[str]:
    """Return the bounds of a field in words, each once."""
    for name, words in _LIMITS.items():
        if name in field:
            limit = float(field[name])
            yield words.format(int(limit) if limit.is_integer() else limit)
