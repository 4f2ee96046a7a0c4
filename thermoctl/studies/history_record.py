"""Read a record from the history a daemon has written."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from thermoctl.quantities import Array
from thermoctl.services.history import COLUMNS, read_history
from thermoctl.studies.record import (
    MAX_ROWS,
    Collector,
    Columns,
    Record,
    RecordError,
    choose_columns,
)

MAGIC = b"SQLite format 3\0"
"""How every SQLite file begins."""

_APART_PERIODS = 10.0
"""Between two runs that overlap by the wall clock: a gap, and short enough for a figure."""

_MOVED = "runs put behind the one before, because they overlap by the wall clock: {}"

_NUMBERS = tuple(column.name for column in COLUMNS if column.kind == "REAL")


def is_history(path: Path) -> bool:
    """Return whether `path` is an SQLite file; raise `OSError` if it cannot be read."""
    with path.open("rb") as stream:
        return stream.read(len(MAGIC)) == MAGIC


def read_history_record(path: Path, wanted: Columns, loop: str | None = None) -> Record:
    """Return the record of one loop in the history at `path`.

    Time is the loop's own; between two runs of the daemon it goes on by the wall clock. A run that
    began before the one before it had ended, as bench tests do that are faster than the clock, is
    put behind it. Cycles without a temperature or an accepted power are left out and counted.

    Parameters
    ----------
    path : Path
        A history of thermoctl.
    wanted : Columns
        By default temperature and accepted power; any column of numbers may be named.
    loop : str, optional
        Which loop; needed where the history holds several.

    Raises
    ------
    RecordError
        If a column is not there, several loops are, or fewer than two cycles are sound.
    Unavailable
        If the file is no readable history or holds no such loop.
    """
    names, notes = choose_columns(path.name, _NUMBERS, wanted)
    read = dict.fromkeys(str(name) for name in (names.time, names.input, names.output))
    kept = read_history(
        path, loop=loop, columns=("loop", "run", "wall_utc_s", "t_s", *read)
    ).columns
    loops = sorted(set(kept["loop"].tolist()))
    if len(loops) > 1:
        raise RecordError(f"{path.name}: expected --loop, one of {', '.join(loops)}")
    time = kept[str(names.time)]
    if names.time == "t_s":
        order = np.argsort(kept["run"], kind="stable")  # two writers may have taken turns
        kept = {name: column[order] for name, column in kept.items()}
        time, moved = _through_runs(kept["run"], kept["wall_utc_s"], kept["t_s"])
        notes += [_MOVED.format(moved)] if moved else []
    collector = Collector(path.name, names, notes)
    rows = zip(
        time.tolist(),
        kept[str(names.input)].tolist(),
        kept[str(names.output)].tolist(),
        strict=True,
    )
    for number, (t_s, u, y) in enumerate(rows, start=1):
        if collector.full:
            collector.notes.append(
                f"reading ended in cycle {number}: at most {MAX_ROWS:,} are read"
            )
            break
        _take(collector, number, t_s, u, y)
    return collector.finish()


def _take(collector: Collector, number: int, t_s: float, u: float, y: float) -> None:
    """Add a cycle, or count it with the first thing that is missing in it."""
    names = collector.names
    for name, value in ((names.time, t_s), (names.output, y), (names.input, u)):
        if not math.isfinite(value):
            collector.skip(f"cycle {number}", f"{name} is not known")
            return
    collector.add(f"cycle {number}", t_s, u, y)


def _through_runs(run: Array, wall_s: Array, t_s: Array) -> tuple[Array, int]:
    """Return the loop's time through all runs, and how many were put behind the one before.

    Runs stand one after the other; each begins when the wall clock saw it begin, but never before
    the one before it has ended.
    """
    starts = np.flatnonzero(np.diff(run, prepend=math.nan) != 0.0)
    time, moved, free_s = np.empty(len(t_s)), 0, -math.inf
    for begin, end in zip(starts, [*starts[1:], len(t_s)], strict=True):
        own_s = t_s[begin:end]
        begin_s = max(wall_s[begin], free_s)
        moved += bool(begin_s > wall_s[begin])
        time[begin:end] = begin_s + (own_s - own_s[0])
        period_s = float(np.median(np.diff(own_s))) if len(own_s) > 1 else 1.0
        free_s = time[end - 1] + _APART_PERIODS * period_s
    return time, moved
