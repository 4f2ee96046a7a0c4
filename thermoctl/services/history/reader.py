"""Read a history back: columns for a study, CSV for everybody else.

Both open the file read-only and stream it, so that an export beside a running daemon neither
disturbs the recording nor needs memory for more than a few rows.
"""

from __future__ import annotations

import csv
import errno
import json
import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final, TextIO

import numpy as np
import numpy.typing as npt

from thermoctl.errors import NotPermitted, Unavailable
from thermoctl.quantities import Array
from thermoctl.services.history.schema import (
    APPLICATION_ID,
    COLUMNS,
    SCHEMA_VERSION,
    Kind,
    RunInfo,
    readable_from,
)

ROWS_AT_ONCE: Final = 4096
EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
KINDS: Final[Mapping[str, Kind]] = {
    "run": "INTEGER",
    "wall_utc_s": "REAL",
    **{column.name: column.kind for column in COLUMNS},
}

EVER_S: Final = 1e18
_SPAN: Final = """
    SELECT min(id), max(id) FROM cycles INDEXED BY cycles_by_wall
    WHERE wall_utc_s >= :since AND wall_utc_s < :until
"""
_SELECT: Final = """
    SELECT {} FROM cycles WHERE id BETWEEN :first AND :last
    AND wall_utc_s >= :since AND wall_utc_s < :until AND loop = coalesce(:loop, loop) ORDER BY id
"""
"""In the order of recording, even where the wall clock went back; the index finds the span, or a
day would cost the reading of a year."""


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A part of a history.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (rows,)
        In the order of recording. Numbers are float64 with NaN where nothing was recorded; words
        are objects, `None` where nothing was recorded. The names carry the units.
    configuration : mapping
        Configuration of the newest run in it.
    runs : mapping of int to RunInfo
        The runs the rows belong to; column ``run`` holds the key.
    clock_steps : ndarray, shape (steps, 2)
        Wall clock in s since 1970 UTC after each step of the host's clock, and its size in s.
    """

    columns: Mapping[str, npt.NDArray[Any]]
    configuration: Mapping[str, Any] = field(default_factory=dict)
    runs: Mapping[int, RunInfo] = field(default_factory=dict)
    clock_steps: Array = field(default_factory=lambda: np.empty((0, 2)))


def read_history(
    path: Path,
    loop: str | None = None,
    since: datetime | None = None,
    until: datetime | None = None,
    columns: Sequence[str] = tuple(KINDS),
) -> Recording:
    """Return the cycles at `path` from `since` (inclusive) to `until` (exclusive).

    Parameters
    ----------
    loop : str or None
        Only this loop; None: every loop, told apart by the column ``loop``.
    since, until : datetime or None
        Wall clock with a time zone; None: no limit.
    columns : sequence of str
        What to read; all of it by default.

    Raises
    ------
    Unavailable
        No such file, not a history, of a newer schema, damaged, or without such cycles.
    NotPermitted
        This user may not read it.
    ValueError
        A time without a zone, or an unknown column.
    """
    if unknown := set(columns) - set(KINDS):
        raise ValueError(f"columns must be some of {', '.join(KINDS)}, got {sorted(unknown)}")
    names = tuple(dict.fromkeys((*columns, "run")))
    which = _Range(loop, since, until)
    with _readable(path) as connection:
        whole = _columns(names, _rows(connection, path, names, which))
        numbers = [int(number) for number in np.unique(whole["run"])]
        runs = {number: _run(connection, number) for number in numbers}
        steps = [step for number in numbers for step in _clock_steps(connection, number)]
    return Recording(
        columns={name: whole[name] for name in columns},
        configuration=json.loads(runs[numbers[-1]].configuration),
        runs=runs,
        clock_steps=np.array(steps, dtype=np.float64).reshape(-1, 2),
    )


def export(
    path: Path,
    out: Path | TextIO,
    since: datetime | None = None,
    until: datetime | None = None,
    loop: str | None = None,
) -> int:
    """Write cycles as CSV to `out` and return how many.

    The first column, ``time_utc``, is ISO 8601 with its offset; the names carry the units; an
    empty cell is a value that was not known. A file is written beside its final name and renamed
    when it is whole, so that a failed export leaves none behind; a link stays one, and what is no
    file, such as a pipe or a device, is written to as it is.

    Raises
    ------
    Unavailable, NotPermitted
        As `read_history`, and no file is written then.
    ValueError
        A time without a zone.
    OSError
        `out` cannot be written.
    """
    which = _Range(loop, since, until)
    if not isinstance(out, Path):
        return _export(path, out, which)
    try:
        return _export_whole(path, out, which)
    except OSError as error:  # of the file that was asked for, not of the one beside it
        raise OSError(error.errno, error.strerror, str(out)) from error


def _export_whole(path: Path, out: Path, which: _Range) -> int:
    """Write to a file that is there once it is whole, or straight into what is none."""
    if out.exists() and not out.is_file():
        with out.open("w", newline="", encoding="utf-8") as stream:
            return _export(path, stream, which)
    final = Path(os.path.realpath(out))
    if not final.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, f"there is no folder {final.parent}", str(out))
    partial = final.with_name(f".{final.name}.partial")
    try:
        with open(partial, "w", newline="", encoding="utf-8", opener=_no_link) as stream:
            count = _export(path, stream, which)
        partial.replace(final)
    finally:
        partial.unlink(missing_ok=True)
    return count


def _no_link(path: str, flags: int) -> int:
    """Open a file of our own; a link that somebody laid there would lead to one of theirs."""
    return os.open(path, flags | os.O_NOFOLLOW, 0o666)


class _Range:
    """Which cycles: the values of `_SPAN` and `_SELECT`, and words for a message."""

    def __init__(self, loop: str | None, since: datetime | None, until: datetime | None) -> None:
        self.loop = loop
        self.since_s = -EVER_S if since is None else _utc_s("since", since)
        self.until_s = EVER_S if until is None else _utc_s("until", until)
        words = ["cycles", "" if loop is None else f"of loop {loop!r}"]
        words += ["" if since is None else f"since {since.isoformat()}"]
        words += ["" if until is None else f"until {until.isoformat()}"]
        self.words = " ".join(filter(None, words))


def _export(path: Path, stream: TextIO, which: _Range) -> int:
    names = tuple(column.name for column in COLUMNS)
    writer = csv.writer(stream, lineterminator="\n")
    count = 0
    with _readable(path) as connection:
        for rows in _rows(connection, path, ("wall_utc_s", *names), which):
            if count == 0:  # only now is it known that there is something to write
                writer.writerow(("time_utc", *names))
            writer.writerows((_iso(wall_utc_s), *values) for wall_utc_s, *values in rows)
            count += len(rows)
    return count


def _rows(
    connection: sqlite3.Connection, path: Path, names: Sequence[str], which: _Range
) -> Iterator[list[tuple[Any, ...]]]:
    """Yield the rows in bunches, in the order of recording; raise when there are none."""
    values = {"loop": which.loop, "since": which.since_s, "until": which.until_s}
    first, last = connection.execute(_SPAN, values).fetchone()
    values |= {"first": first, "last": last}
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    selected = ", ".join(readable_from(name, version) for name in names)
    cursor = connection.execute(_SELECT.format(selected), values)
    rows = cursor.fetchmany(ROWS_AT_ONCE)
    if not rows:
        raise Unavailable(f"{path} should hold {which.words}, but {_contents(connection)}")
    while rows:
        yield rows
        rows = cursor.fetchmany(ROWS_AT_ONCE)


def _columns(
    names: Sequence[str], bunches: Iterator[list[tuple[Any, ...]]]
) -> dict[str, npt.NDArray[Any]]:
    """Turn bunches of rows into whole columns, one bunch at a time."""
    parts: list[list[npt.NDArray[Any]]] = [[] for _ in names]
    for rows in bunches:
        for part, name, values in zip(parts, names, zip(*rows, strict=True), strict=True):
            part.append(_as_array(KINDS[name], values))
    return {name: np.concatenate(part) for name, part in zip(names, parts, strict=True)}


def _contents(connection: sqlite3.Connection) -> str:
    """Say what the file holds instead."""
    count, first, last = connection.execute(
        "SELECT count(*), min(wall_utc_s), max(wall_utc_s) FROM cycles"
    ).fetchone()
    if not count:
        return "it holds no cycle at all"
    loops = [loop for (loop,) in connection.execute("SELECT DISTINCT loop FROM cycles")]
    return f"it holds {count} of {', '.join(loops)} from {_iso(first)} to {_iso(last)}"


@contextmanager
def _readable(path: Path) -> Iterator[sqlite3.Connection]:
    """Open the history read-only; every way it can fail becomes one sentence."""
    if not path.is_file():
        raise Unavailable(f"no history at {path}")
    if not os.access(path, os.R_OK):
        raise NotPermitted(f"{path} should be a history that user {os.geteuid()} may read")
    connection = None
    try:
        connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
        owner = connection.execute("PRAGMA application_id").fetchone()[0]
        version = connection.execute("PRAGMA user_version").fetchone()[0]
        if owner != APPLICATION_ID:
            raise Unavailable(f"{path} should be a thermoctl history, but is none")
        if version > SCHEMA_VERSION:
            raise Unavailable(
                f"{path} should have schema {SCHEMA_VERSION} or older, but has {version}: "
                "it was written by a newer thermoctl"
            )
        yield connection
    except sqlite3.Error as error:
        raise Unavailable(f"{path} should be a readable thermoctl history: {error}") from error
    finally:
        if connection is not None:
            connection.close()


def _run(connection: sqlite3.Connection, number: int) -> RunInfo:
    query = "SELECT version, configuration, started_utc_s FROM runs WHERE id = ?"
    version, configuration, started_utc_s = connection.execute(query, (number,)).fetchone()
    try:
        return RunInfo(version, configuration, started_utc_s)
    except ValueError as error:
        raise Unavailable(f"the configuration of run {number} is no JSON: {error}") from error


def _clock_steps(connection: sqlite3.Connection, number: int) -> list[tuple[float, float]]:
    query = "SELECT wall_utc_s, step_s FROM clock_steps WHERE run = ? ORDER BY id"
    return connection.execute(query, (number,)).fetchall()


def _as_array(kind: Kind, values: Sequence[Any]) -> npt.NDArray[Any]:
    if kind != "TEXT":
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)
    known: dict[Any, Any] = {}  # one object per word instead of one per row
    return np.array([known.setdefault(value, value) for value in values], dtype=object)


def _utc_s(name: str, when: datetime) -> float:
    if when.tzinfo is None:
        raise ValueError(f"{name} should have a time zone, got {when.isoformat()}")
    return (when - EPOCH) / timedelta(seconds=1)


def _iso(utc_s: float) -> str:
    """Return milliseconds with an offset; adding to the epoch works on either side of 1970."""
    return (EPOCH + timedelta(seconds=utc_s)).isoformat(timespec="milliseconds")
