"""Where in a TOML file a key stands, so that an error can name its line.

The standard library's parser forgets lines. This scan knows table headers and keys at the start of
a line, which is how configurations are written; for anything else the line of the table is named.
"""

from __future__ import annotations

import re

_PART = r"(?:[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')"
_PATH = rf"(?P<path>{_PART}(?:\s*\.\s*{_PART})*)"
_HEADER = re.compile(rf"^\s*\[\[?\s*{_PATH}\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(rf"^\s*{_PATH}\s*=")
_LONG_STRING = re.compile(r"\"\"\"|'''")

KeyPath = tuple[str, ...]


def places(text: str) -> dict[KeyPath, int]:
    """Return the line number, from 1, of every table and key of `text` by its path."""
    found: dict[KeyPath, int] = {}
    table: KeyPath = ()
    closing = ""  # the quotes that end a string over several lines, while inside one
    for number, line in enumerate(text.splitlines(), 1):
        inside = closing
        for quotes in _LONG_STRING.findall(line):
            closing = {"": quotes, quotes: ""}.get(closing, closing)
        if inside:
            continue
        if header := _HEADER.match(line):
            table = _split(header["path"])
            found.setdefault(table, number)
        elif key := _KEY.match(line):
            found.setdefault(table + _split(key["path"]), number)
    return found


def line_of(found: dict[KeyPath, int], path: KeyPath) -> int | None:
    """Return the line of `path`, or of the nearest table written around it."""
    while path:
        if (line := written_at(found, path)) is not None:
            return line
        path = path[:-1]
    return None


def written_at(found: dict[KeyPath, int], path: KeyPath) -> int | None:
    """Return the line of `path`, or of the first below it: `[a.b]` makes an `a`."""
    if path in found:
        return found[path]
    return min((line for key, line in found.items() if key[: len(path)] == path), default=None)


def _split(path: str) -> KeyPath:
    return tuple(part.strip("\"'") for part in re.findall(_PART, path))
