"""Configuration files as written: content, lines, and what is wrong with them.

The rule on rights: whoever may write a configuration decides what heats. One that everybody may
write to is refused when root reads it; one that anybody else than root and the reading user may
write to is reported by `exposures`, for the command or the daemon to warn about.
"""

from __future__ import annotations

import os
import re
import stat
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from thermoctl.app.configuration.toml_places import KeyPath, line_of, places, written_at
from thermoctl.errors import ConfigError, NotPermitted

_HINTS = (
    (re.compile(r"=\s*[+-]?\d+,\d"), "write a decimal point, not a comma"),
    (re.compile(r"=\s*[A-Za-z]"), "write true or false in small letters, and text in quotes"),
)
_AT_LINE = re.compile(r"\s*\(at line (?P<line>\d+), column (?P<column>\d+)\)")


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong: its place, its key, and what was expected."""

    file: str
    line: int | None
    key: KeyPath
    text: str

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        return ": ".join(part for part in (place, ".".join(self.key), self.text) if part)

    def as_json(self) -> dict[str, Any]:
        """Return the problem as an object for ``--json``."""
        key = ".".join(self.key)
        return {"file": self.file, "line": self.line, "key": key, "text": self.text}


class BadConfiguration(ConfigError):  # noqa: N818 - as its siblings in errors
    """Everything that is wrong with a configuration, found in one go.

    Parameters
    ----------
    problems : sequence of Problem
        At least one; repetitions are dropped.
    read : any, optional
        What could be read of it all the same; None where a table is missing or bad.
    note : str
        What was not looked at, in a line of its own; "" for nothing.
    """

    def __init__(self, problems: Sequence[Problem], read: Any = None, note: str = "") -> None:
        self.problems = tuple(dict.fromkeys(problems))
        self.read = read
        super().__init__("\n".join([*map(str, self.problems), *filter(None, [note])]))


@dataclass(frozen=True, slots=True)
class Document:
    """The content of one or several configuration files, with the line of every key.

    Parameters
    ----------
    content : mapping
        The tables, parsed but not yet checked.
    name : str
        What a problem without a line is attributed to.
    lines : mapping
        By file, the line of every table and key in it.
    """

    content: Mapping[str, Any]
    name: str = "configuration"
    lines: Mapping[str, dict[KeyPath, int]] = field(default_factory=dict)

    def problem(self, key: KeyPath, text: str) -> Problem:
        """Return a problem with `key`, placed at the line of it or its nearest table."""
        for depth in range(len(key), 0, -1):
            for file, found in self.lines.items():
                if (line := written_at(found, key[:depth])) is not None:
                    return Problem(file, line, key, text)
        return Problem(self.name, None, key, text)


def read_document(files: Iterable[Path]) -> Document:
    """Return several files taken together; a table may stand in only one of them.

    Raises
    ------
    NotPermitted
        This user may not read a file.
    ConfigError
        A file cannot be read, is no TOML, repeats what an earlier one says, or is open to
        everybody while root reads it.
    """
    merged: dict[str, Any] = {}
    lines: dict[str, dict[KeyPath, int]] = {}
    problems: list[Problem] = []
    for file in files:
        text = _text(file)
        found = lines[str(file)] = places(text)
        for key, value in _parsed(file, text).items():
            for path in _repeated(key, value, merged):
                told = f"stands in {_earlier(lines, str(file), path)} as well"
                problems.append(Problem(str(file), line_of(found, path), path, told))
            both_tables = isinstance(value, dict) and isinstance(merged.get(key), dict)
            merged[key] = {**merged[key], **value} if both_tables else value
    if problems:
        raise BadConfiguration(problems)
    return Document(merged, ", ".join(lines), lines)


def exposures(files: Iterable[Path]) -> list[str]:
    """Return a sentence for each file that somebody else may write to."""
    return [words for file in files if (words := _exposure(file)) is not None]


def _exposure(file: Path) -> str | None:
    try:
        status = file.stat()
        folder = file.resolve().parent.stat()
    except OSError:
        return None  # whoever reads it reports why it cannot
    mode = stat.S_IMODE(status.st_mode)
    if mode & (stat.S_IWGRP | stat.S_IWOTH):
        whose = "everybody" if mode & stat.S_IWOTH else f"group {status.st_gid}"
        return f"{file}: {whose} may write to it (mode {mode:04o}); chmod go-w {file}"
    if status.st_uid not in (0, os.geteuid()):
        return f"{file}: belongs to user {status.st_uid}, who may change what heats; chown it"
    if folder.st_mode & stat.S_IWOTH and not folder.st_mode & stat.S_ISVTX:
        return f"{file}: everybody may replace it; chmod o-w {file.resolve().parent}"
    return None


def _repeated(key: str, value: Any, merged: Mapping[str, Any]) -> list[KeyPath]:
    """Return the paths of `value` that are already in `merged`."""
    if key not in merged:
        return []
    if isinstance(value, dict) and isinstance(merged[key], dict):
        return [(key, each) for each in value if each in merged[key]]
    return [(key,)]


def _earlier(lines: Mapping[str, dict[KeyPath, int]], file: str, path: KeyPath) -> str:
    """Return which other file says something at `path`."""
    others = (name for name in lines if name != file and line_of(lines[name], path) is not None)
    return next(others, "an earlier file")


def _text(file: Path) -> str:
    try:
        with open(file, encoding="utf-8-sig", opener=_without_waiting) as stream:
            mode = os.fstat(stream.fileno()).st_mode
            if not stat.S_ISREG(mode):
                kind = "a pipe" if stat.S_ISFIFO(mode) else "a device"
                raise ConfigError(f"{file}: expected a regular file, got {kind}")
            if mode & stat.S_IWOTH and os.geteuid() == 0:
                raise ConfigError(
                    f"{file}: expected a file that only its owner may write to, got mode "
                    f"{stat.S_IMODE(mode):04o}, and root would obey it; chmod go-w {file}"
                )
            return stream.read()
    except FileNotFoundError as error:
        raise ConfigError(f"{file}: no such file") from error
    except PermissionError as error:
        raise NotPermitted(f"{file}: expected the right to read it, got none") from error
    except (OSError, UnicodeDecodeError) as error:
        got = getattr(error, "strerror", None) or error
        raise ConfigError(f"{file}: expected a readable TOML file in UTF-8, got: {got}") from error


def _without_waiting(path: str, flags: int) -> int:
    """Open a file; a pipe that nobody writes to would be waited for otherwise."""
    return os.open(path, flags | os.O_NONBLOCK)


def _parsed(file: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also a number of 5,000 digits, [[[[...
        words, line = str(error), None
        if at := _AT_LINE.search(words):
            line = int(at["line"])
            words = f"{_AT_LINE.sub('', words)} in column {at['column']}"
        elif "at end of document" in words:
            line = max(1, len(text.splitlines()))
        words += "" if line is None else _hint(text.splitlines()[line - 1 : line])
        problem = Problem(str(file), line, (), f"no valid TOML: {words}")
        raise BadConfiguration([problem]) from error


def _hint(lines: Sequence[str]) -> str:
    """Return what was probably meant by a line that is no TOML."""
    found = (hint for line in lines for pattern, hint in _HINTS if pattern.search(line))
    return "".join(f"; {hint}" for hint in list(found)[:1])
