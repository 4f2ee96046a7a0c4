"""The history's database file: opened or set aside, and appended to.

Everything here may block for seconds and may raise `sqlite3.Error` or `OSError`; only the writer's
thread calls it.
"""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable, Iterable
from contextlib import closing, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from thermoctl.services.history.schema import (
    APPLICATION_ID,
    FIND_RUN,
    INSERT_CYCLE,
    INSERT_RUN,
    SCHEMA,
    SCHEMA_VERSION,
    RunInfo,
    Value,
    migration,
)

BUSY_S: Final = 1.0
"""How long a commit waits for another process's lock before it is tried again later."""

DAMAGED: Final = frozenset({sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB})
"""Primary result codes that no retry will cure."""

COMPANIONS: Final = ("-wal", "-shm")

LOOK_AGAIN: Final = 60
"""Commits between two looks at the file with fresh eyes; one takes about a millisecond."""

FORGET_AT_ONCE: Final = 5000
"""Rows deleted per commit at most, so that a lowered limit does not make one commit endless."""

FORGET: Final = (
    "DELETE FROM cycles WHERE id <= (SELECT max(id) FROM cycles) - ? "
    f"AND id < (SELECT min(id) FROM cycles) + {FORGET_AT_ONCE}"
)

Row = tuple[str, tuple[Value, ...]]
"""An INSERT whose first placeholder is the run, and the values of the others."""


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A database ready for rows, and where a useless one before it went."""

    connection: sqlite3.Connection
    set_aside: Path | None = None
    why: str = ""


def open_history(
    path: Path,
    *,
    check: bool = True,
    condemned: str = "",
    wall_clock: Callable[[], float] = time.time,
) -> Opened:
    """Return the history at `path`, new where there is none.

    One of an older schema gets the columns it lacks, and keeps its rows; SQLite only notes that
    there are more columns, so that gigabytes take no longer. A file that is damaged, not a
    database, another program's or of a newer schema is renamed, and a new one is begun: losing
    sight of the past is better than losing the future too.

    Parameters
    ----------
    check : bool
        Read the whole file for damage. It takes seconds for gigabytes, so not at every retry.
    condemned : str
        Why the file is of no use, where a write has already shown that it is damaged.

    Raises
    ------
    sqlite3.Error, OSError
        The file cannot be opened now, and another attempt may succeed: locked, read-only, full.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    connection = _connect(path)
    why = condemned or _unusable(connection, check)
    if not why:
        return Opened(connection)
    connection.close()
    aside = _set_aside(path, wall_clock())
    connection = _connect(path)
    if still := _unusable(connection, check):
        connection.close()
        raise OSError(f"{path} should be new after setting the old one aside, but {still}")
    return Opened(connection, aside, why)


class HistoryFile:
    """One database through failures, set-asides and deletions."""

    def __init__(
        self, path: Path, run: RunInfo, wall_clock: Callable[[], float], max_cycles: int
    ) -> None:
        self._path, self._run = path, run
        self._wall_clock, self._max_cycles = wall_clock, max_cycles
        self._opened: Opened | None = None
        self._inode: int | None = None
        self._run_id: int | None = None
        self._started_utc_s = run.started_utc_s
        self._condemned = ""
        self._size = self._looks = 0

    def ensure_open(self) -> Opened:
        """Open the file unless it is; `Opened.set_aside` is only told once."""
        if self._opened is not None and self._is_still_ours() and self._looks_whole():
            self._opened = Opened(self._opened.connection)
            return self._opened
        self.close()
        opened = open_history(
            self._path,
            check=not self._is_still_ours(),
            condemned=self._condemned,
            wall_clock=self._wall_clock,
        )
        self._condemned, self._run_id = "", None
        self._opened, self._inode, self._size, self._looks = opened, self._path.stat().st_ino, 0, 0
        return opened

    def append(self, rows: Iterable[Row]) -> int:
        """Commit `rows`, all or none; return how many of them are cycles."""
        if self._opened is None:
            raise OSError(f"{self._path} is not open")
        connection, run_id, cycles = self._opened.connection, self._run_id, 0
        connection.execute("BEGIN IMMEDIATE")
        if run_id is None:
            run_id = self._begin_run(connection)
        for statement, values in rows:
            connection.execute(statement, (run_id, *values))
            cycles += statement is INSERT_CYCLE
        connection.execute(FORGET, (self._max_cycles,))
        connection.execute("COMMIT")
        self._run_id = run_id
        return cycles

    def give_up(self, error: BaseException) -> None:
        """Let the connection go after `error`; damage condemns the file."""
        if _is_damage(error) and self._path.exists():
            self._condemned = str(error)
        self.close()

    def close(self) -> None:
        """Let the file go; an open transaction is rolled back."""
        opened, self._opened = self._opened, None
        if opened is not None:
            with suppress(sqlite3.Error):  # whatever fails here has been, or will be, met again
                opened.connection.close()

    def _is_still_ours(self) -> bool:
        """An operator may delete or move the file while we write into it."""
        try:
            return self._path.stat().st_ino == self._inode
        except FileNotFoundError:
            return False

    def _looks_whole(self) -> bool:
        """Condemn a file that was damaged under an open connection.

        SQLite would go on writing into its log for hours, and nobody could read a row of it.
        """
        size, before = self._path.stat().st_size, self._size
        self._size = size
        if size < before:  # it never shrinks by itself: nothing here vacuums
            self._condemned = f"it has shrunk from {before} to {size} bytes"
        self._looks += 1
        if self._looks % LOOK_AGAIN == 0:
            self._condemned = self._condemned or _seen_anew(self._path)
        return not self._condemned

    def _begin_run(self, connection: sqlite3.Connection) -> int:
        if self._started_utc_s is None:
            self._started_utc_s = self._wall_clock()
        begun = (self._started_utc_s, self._run.version, self._run.configuration)
        if known := connection.execute(FIND_RUN, begun).fetchone():
            return int(known[0])  # the same start, and the file was only opened again
        run_id = connection.execute(INSERT_RUN, begun).lastrowid
        assert run_id is not None  # an INSERT always has one; for the type checker
        return run_id


def _is_damage(error: BaseException) -> bool:
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in DAMAGED


def _connect(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)


def _unusable(connection: sqlite3.Connection, check: bool) -> str:
    """Make the schema where there is none; return why the file is of no use, or ''."""
    try:
        tables = connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0]
        owner = connection.execute("PRAGMA application_id").fetchone()[0]
        version = connection.execute("PRAGMA user_version").fetchone()[0]
        if tables and owner != APPLICATION_ID:
            return f"it is another program's database (application_id {owner:#x})"
        if version > SCHEMA_VERSION:
            return f"schema {version} is newer than {SCHEMA_VERSION}, the newest known here"
        if tables and check:
            verdict = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
            if verdict != "ok":
                return f"it is damaged: {verdict}"
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = NORMAL")  # WAL stays whole; fsync at checkpoints
        if not tables:
            connection.executescript(f"BEGIN IMMEDIATE; {SCHEMA} COMMIT;")
        elif version < SCHEMA_VERSION:
            _migrate(connection)
    except sqlite3.Error as error:
        if _is_damage(error):
            return str(error)
        connection.close()
        raise
    return ""


def _migrate(connection: sqlite3.Connection) -> None:
    """Make an older file one of today, as a whole or not at all."""
    connection.execute("BEGIN IMMEDIATE")
    # Asked again behind the lock: another process may have come first.
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    for statement in migration(version):
        connection.execute(statement)
    connection.execute("COMMIT")


def _seen_anew(path: Path) -> str:
    """Read a little through a connection without cached pages; return what is wrong, or ''.

    Only SQLite may open the file here: closing any other descriptor of it would drop the locks
    that this process holds on it.
    """
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as anew:
            for end in ("min", "max"):  # one at a time: only so does SQLite not read every row
                anew.execute(f"SELECT {end}(id), loop FROM cycles").fetchone()
    except sqlite3.Error as error:
        return str(error) if _is_damage(error) else ""
    return ""


def _set_aside(path: Path, wall_utc_s: float) -> Path:
    """Rename the database and its companions, so that they stay readable together."""
    stamp = datetime.fromtimestamp(wall_utc_s, UTC).strftime("%Y%m%dT%H%M%SZ")
    aside = path.with_name(f"{path.stem}-set-aside-{stamp}{path.suffix}")
    number = 1
    while aside.exists():
        number += 1
        aside = path.with_name(f"{path.stem}-set-aside-{stamp}-{number}{path.suffix}")
    path.rename(aside)
    for companion in COMPANIONS:
        with suppress(FileNotFoundError):
            Path(f"{path}{companion}").rename(f"{aside}{companion}")
    return aside
