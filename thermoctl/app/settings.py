"""Reads a configuration: TOML in, typed and frozen `Settings` out, or one clear `ConfigError`.

Nothing here switches anything on: a configuration is read, checked as a whole and only then used.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, get_args, get_origin

from pydantic import (
    BaseModel,
    Field,
    SerializeAsAny,
    ValidationError,
    field_validator,
    model_validator,
)

from thermoctl.app import plugins
from thermoctl.app.tables import HistoryTable, LoopTable, ServiceTable, Table
from thermoctl.app.toml_places import line_of, places
from thermoctl.errors import ConfigError

ETC = Path("/etc/thermoctl")


class Settings(Table):
    """A whole configuration: named loops and boards."""

    loops: dict[str, LoopTable] = Field(min_length=1, description="What is held, by name.")
    boards: dict[str, SerializeAsAny[BaseModel]] = Field(
        default_factory=dict, description="Hardware, by name; each by the settings of its kind."
    )
    history: HistoryTable = Field(default_factory=HistoryTable)
    service: ServiceTable = Field(default_factory=ServiceTable)

    @field_validator("loops")
    @classmethod
    def _names_are_plain(cls, value: dict[str, LoopTable]) -> dict[str, LoopTable]:
        for name in value:
            if not name.replace("-", "_").isidentifier():
                raise ValueError(f"a loop is named with letters, digits, - and _, got {name!r}")
        return value

    @model_validator(mode="after")
    def _boards_that_loops_name_exist(self) -> Settings:
        for name, loop in self.loops.items():
            for part in (loop.sensor, loop.actuator):
                if part is not None and part.board not in self.boards:
                    raise ValueError(
                        f"loop {name!r} names board {part.board!r}, but there is no such table"
                        f"{plugins.nearest(part.board, self.boards)}"
                    )
        return self

    def loop(self, name: str | None = None) -> tuple[str, LoopTable]:
        """Return a loop with its name: the one called `name`, or the first."""
        name = next(iter(self.loops)) if name is None else name
        if name not in self.loops:
            raise ConfigError(f"no loop is called {name!r}{plugins.nearest(name, self.loops)}")
        return name, self.loops[name]

    def as_json(self) -> str:
        """Return the configuration in force, defaults included, as JSON."""
        return json.dumps(self.model_dump(mode="json", exclude_none=True), sort_keys=True)


def load(source: str | Path | Mapping[str, Any]) -> Settings:
    """Return the settings in `source`: the path of a TOML file, or its content as a dict.

    Raises
    ------
    ConfigError
        With file, line and key, what was expected and what came; for an unknown key, the nearest
        known one.
    """
    if isinstance(source, Mapping):
        return _validated(dict(source), "configuration", "")
    path = Path(source)
    text = _text(path)
    return _validated(_parsed(path, text), str(path), text)


def load_all(paths: Iterable[str | Path]) -> Settings:
    """Return the settings of several files taken together; a name may stand in only one of them."""
    merged: dict[str, Any] = {}
    files = [Path(path) for path in paths]
    if len(files) == 1:
        return load(files[0])
    for path in files:
        for key, table in _parsed(path, _text(path)).items():
            known = merged.setdefault(key, {})
            twice = sorted(set(known) & set(table)) if isinstance(table, dict) else [key]
            if twice:
                raise ConfigError(f"{path}: {key}.{twice[0]} stands in an earlier file as well")
            known.update(table)
    return _validated(merged, ", ".join(map(str, files)), "")


def default_files() -> list[Path]:
    """Return the configuration files of the machine; raise `ConfigError` if there are none."""
    files = sorted(ETC.glob("*.toml"))
    if not files:
        raise ConfigError(f"expected -c FILE or a configuration {ETC}/*.toml, found none")
    return files


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: no such file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"{path}: expected a readable TOML file in UTF-8, got: {error}"
        ) from error


def _parsed(path: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: no valid TOML: {error}") from error


def _validated(content: dict[str, Any], source: str, text: str) -> Settings:
    found = places(text)

    def where(path: tuple[str, ...]) -> str:
        line = line_of(found, path)
        return f"{source}:{line}: " if line else f"{source}: "

    boards, lines = _boards(content.get("boards", {}), where)
    try:
        settings = Settings.model_validate({**content, "boards": boards})
    except ValidationError as error:
        lines += _explain(error, Settings, (), where)
    if lines:
        raise ConfigError("\n".join(dict.fromkeys(lines)))
    return settings


Where = Callable[[tuple[str, ...]], str]


def _boards(tables: Any, where: Where) -> tuple[dict[str, BaseModel], list[str]]:
    """Return each board's settings by the model of its kind, and a line for each that is bad."""
    boards: dict[str, BaseModel] = {}
    lines: list[str] = []
    if not isinstance(tables, Mapping):
        return {}, [f"{where(('boards',))}expected tables [boards.NAME], got {tables!r}"]
    for name, table in tables.items():
        path = ("boards", str(name))
        kind = table.get("kind") if isinstance(table, Mapping) else None
        boards[name] = Table()  # so that a loop that names it is not reproached as well
        if not isinstance(kind, str):
            known = ", ".join(plugins.kinds(plugins.DRIVERS))
            lines.append(f"{where(path)}{'.'.join(path)} needs a kind; known: {known}")
            continue
        try:
            model = plugins.find(plugins.DRIVERS, kind).Settings
            boards[name] = model.model_validate(table)
        except ValidationError as error:
            lines += _explain(error, model, path, where)
        except ConfigError as error:
            lines.append(f"{where((*path, 'kind'))}{'.'.join(path)}: {error}")
    return boards, lines


def _explain(
    error: ValidationError, model: Any, prefix: tuple[str, ...], where: Where
) -> list[str]:
    """Return one line an error: file, line, key, what was expected and what came."""
    lines = []
    for each in error.errors():
        below = tuple(str(part) for part in each["loc"])
        path = prefix + below
        lines.append(f"{where(path)}{_sentence(each, path, _known_keys(model, below[:-1]))}")
    return lines


def _sentence(each: Any, path: tuple[str, ...], known: list[str]) -> str:
    key = ".".join(path)
    if each["type"] == "extra_forbidden":
        return f"unknown key {key!r}{plugins.nearest(path[-1], known)}"
    if each["type"] == "missing":
        return f"{key} is missing"
    message = each["msg"].removeprefix("Value error, ")
    if each["type"] == "value_error":
        return f"{key}: {message}" if key else message
    return f"{key}: {message[0].lower()}{message[1:]}, got {each['input']!r}"


def _known_keys(model: Any, path: tuple[str, ...]) -> list[str]:
    """Return the keys of the table at `path` below `model`, by walking the annotations."""
    annotation: Any = model
    for part in path:
        inner = _tables_in(annotation)
        if get_origin(annotation) is dict or inner is None:
            annotation = inner  # `part` is the name of one of many tables
        else:
            field = inner.model_fields.get(part)
            annotation = None if field is None else field.annotation
    inner = _tables_in(annotation)
    return sorted(inner.model_fields) if inner is not None else []


def _tables_in(annotation: Any) -> type[BaseModel] | None:
    """Return the model inside an annotation such as ``dict[str, Model]`` or ``Model | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for each in get_args(annotation) if (found := _tables_in(each))), None)
