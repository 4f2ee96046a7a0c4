"""Reads a configuration: TOML in, frozen `Settings` or a `ConfigError` out.

Nothing here switches anything on: a configuration is read, checked as a whole and only then used.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, SerializeAsAny, ValidationError

from thermoctl.app import plugins
from thermoctl.app.cascades import as_blocks, cascade_errors
from thermoctl.app.configuration.bases import Table
from thermoctl.app.configuration.document import (
    BadConfiguration,
    Document,
    Problem,
    read_document,
)
from thermoctl.app.configuration.repair import (
    repaired,
    without_keys_beside_limits,
    without_unknown_keys,
)
from thermoctl.app.configuration.tables import HistoryTable, LoopTable, ServiceTable
from thermoctl.app.configuration.toml_places import KeyPath
from thermoctl.app.configuration.wording import (
    reasons,
    shown,
    unknown_key,
    validated,
)
from thermoctl.app.parts import part_errors
from thermoctl.errors import ConfigError

ETC = Path("/etc/thermoctl")
_LOOP_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")  # it names files and topics too


class Settings(Table):
    """A whole configuration: named loops and boards."""

    loops: dict[str, LoopTable] = Field(min_length=1, description="What is held, by name.")
    boards: dict[str, SerializeAsAny[BaseModel]] = Field(
        default_factory=dict, description="Hardware, by name; each by the settings of its kind."
    )
    history: HistoryTable = Field(default_factory=HistoryTable)
    service: ServiceTable = Field(default_factory=ServiceTable)

    def loop(self, name: str | None = None) -> tuple[str, LoopTable]:
        """Return a loop with its name: the one called `name`, or the first."""
        name = next(iter(self.loops)) if name is None else name
        if name not in self.loops:
            raise ConfigError(f"no loop is called {name!r}{plugins.nearest(name, self.loops)}")
        return name, self.loops[name]

    def in_force(self) -> dict[str, Any]:
        """Return every key that has a value, defaults included, as `load` takes it."""
        dumped = self.model_dump(mode="python", exclude_none=True)  # JSON mode would lose infinity
        plain: dict[str, Any] = json.loads(json.dumps(dumped, default=str))
        return plain

    def as_json(self) -> str:
        """Return the configuration in force as JSON, equal for equal settings."""
        return json.dumps(self.in_force(), sort_keys=True)


def load(source: str | Path | Mapping[str, Any]) -> Settings:
    """Return the settings in `source`: a TOML file's path, or its content as a dict.

    Raises
    ------
    ConfigError
        `BadConfiguration`, with file, line, key, what was expected and what came for everything
        that is wrong; for an unknown key, the nearest known one.
    """
    if isinstance(source, Mapping):
        return settings_in(Document(dict(source)))
    return load_all([source])


def load_all(paths: Iterable[str | Path]) -> Settings:
    """Return the settings of several files together; raise as `load` does.

    A loop or board, or a key of another table, may stand in only one of them.
    """
    return settings_in(read_document(Path(path) for path in paths))


def default_files() -> list[Path]:
    """Return the machine's configuration files; raise `ConfigError` if none."""
    files = sorted(ETC.glob("*.toml"))
    if not files:
        raise ConfigError(f"expected -c FILE or a configuration {ETC}/*.toml, found none")
    return files


def settings_in(document: Document) -> Settings:
    """Return the settings in `document`; raise `BadConfiguration` with all errors."""
    return _Reading(document).settings()


def boards_in(paths: Iterable[str | Path]) -> dict[str, BaseModel]:
    """Return the boards of several files and nothing else; raise as `load` does."""
    return _Reading(read_document(Path(path) for path in paths)).boards()


class _Reading:
    """One reading of a document, which goes on after an error so that all are told at once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._problems: list[Problem] = []
        self._astray = False  # a channel names a board that is not there

    def settings(self) -> Settings:
        content = self._document.content
        for key in content:
            if key not in Settings.model_fields:
                self._blame((key,), unknown_key(key, Settings.model_fields))
        tables: dict[str, Any] = {"boards": self._boards(), "loops": self._loops()}
        for key, model in (("history", HistoryTable), ("service", ServiceTable)):
            tables[key] = self._table(model, content.get(key, {}), (key,))
        if self._problems:
            raise BadConfiguration(self._problems, self._readable(tables))
        return Settings.model_validate({**tables, "loops": as_blocks(tables["loops"])})

    def _readable(self, tables: Mapping[str, Any]) -> Settings | None:
        """Return what was read, where loops and boards are whole, though not right."""
        parts = (*tables["loops"].values(), *tables["boards"].values())
        if not tables["loops"] or None in parts or self._astray:
            return None
        return Settings.model_validate({key: tables[key] for key in ("loops", "boards")})

    def boards(self) -> dict[str, BaseModel]:
        """Return the boards alone; raise `BadConfiguration` with all that is wrong with them."""
        boards = {name: each for name, each in self._boards().items() if each is not None}
        if self._problems:
            raise BadConfiguration(self._problems)
        return boards

    def _boards(self) -> dict[str, BaseModel | None]:
        """Return each board's settings by the model of its kind."""
        boards: dict[str, BaseModel | None] = {}
        for name, table in self._named("boards"):
            kind, boards[name] = table.get("kind"), None
            known = plugins.kinds(plugins.DRIVERS)
            if kind is None:
                self._blame(
                    ("boards", name), f"expected a kind, got none{plugins.nearest('', known)}"
                )
                continue
            try:
                model = plugins.find(plugins.DRIVERS, str(kind)).Settings
            except plugins.BadOption as error:
                self._blame(("boards", name, *error.path), error.text)
                continue
            boards[name] = self._table(model, table, ("boards", name))
        return boards

    def _loops(self) -> dict[str, BaseModel | None]:
        """Return each loop's table, its laws and channels tried out and its boards looked up."""
        loops: dict[str, BaseModel | None] = {}
        for name, table in self._named("loops"):
            self._board_names(name, table)
            loop = loops[name] = self._table(LoopTable, table, ("loops", name))
            if not _LOOP_NAME.fullmatch(name):
                self._blame(("loops", name), "a loop is named with up to 64 of a-z, A-Z, 0-9, - _")
            whole = isinstance(loop, LoopTable)
            judged = loop if whole else repaired(table)
            if isinstance(judged, LoopTable):
                for error in part_errors(judged, whole=whole):
                    self._blame(("loops", name, *error.path), error.text)
        known = {name: each for name, each in loops.items() if isinstance(each, LoopTable)}
        if len(known) == len(loops):
            for below, text in cascade_errors(known):
                self._blame(("loops", *below), text)
        if not loops and not self._problems:
            self._blame(("loops",), "expected at least one table [loops.NAME], got none")
        return loops

    def _board_names(self, loop: str, table: Mapping[str, Any]) -> None:
        """Blame a channel whose board has no table; a board that is bad is blamed for itself."""
        boards = self._document.content.get("boards", {})
        for part in ("sensor", "second_sensor", "actuator", "cooler"):
            channel = table.get(part)
            board = channel.get("board") if isinstance(channel, Mapping) else None
            if isinstance(board, str) and board not in boards:
                self._astray = True
                hint = plugins.nearest(board, boards)
                self._blame(
                    ("loops", loop, part, "board"), f"no table [boards.{board}] there{hint}"
                )

    def _named(self, key: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
        """Yield name and content of the tables below `key`."""
        tables = self._document.content.get(key, {})
        if not isinstance(tables, Mapping):
            self._blame((key,), f"expected tables [{key}.NAME], got {shown(tables)}")
            return
        for name, table in tables.items():
            if isinstance(table, Mapping):
                yield str(name), table
            else:
                self._blame((key, str(name)), f"expected a table, got {shown(table)}")

    def _table(self, model: type[BaseModel], table: Any, path: KeyPath) -> BaseModel | None:
        """Return `table` as a `model`; None, and all its errors blamed, if it is none."""
        try:
            return validated(model, table)
        except ValidationError as error:
            self._explain(error, model, path)
            pruned = without_unknown_keys(error, table)
            if model is LoopTable:
                pruned = without_keys_beside_limits(error, pruned)
        if pruned != table:  # limits that contradict each other show only in a table without typos
            try:
                validated(model, pruned)
            except ValidationError as error:
                self._explain(error, model, path, contradictions=True)
        return None

    def _explain(
        self,
        error: ValidationError,
        model: type[BaseModel],
        path: KeyPath,
        *,
        contradictions: bool = False,
    ) -> None:
        """Blame what `error` complains of; of a mended table only what contradicts itself."""
        for below, text in reasons(error, model, only="value_error" if contradictions else ""):
            self._blame(path + below, text)

    def _blame(self, key: KeyPath, text: str) -> None:
        self._problems.append(self._document.problem(key, text))
