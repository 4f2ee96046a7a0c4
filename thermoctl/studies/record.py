"""Recorded runs: what a file holds, and what had to be left out.

A file is read row by row into growing arrays of floats, never as a whole. Rows that are not sound
are counted, not guessed; a hole in time starts a new stretch, so that no regressor reaches across.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from thermoctl.errors import ThermoctlError
from thermoctl.quantities import Array

MAX_ROWS = 2_000_000
"""Most rows that are read: 23 days at one sample a second, 48 MB."""

GAP = 1.5
"""An interval longer than this many periods is a gap."""

_JITTER = 0.1
_JITTER_SHARE = 0.01
_AS_AIMED = 0.01
"""A median this near the interval that was aimed at, as a share of it, is that interval."""

TIME_NAMES = ("time_s", "time_utc", "t_s", "time", "timestamp", "datetime", "t")
OUTPUT_NAMES = ("temperature_c",)
INPUT_NAMES = ("accepted_power", "power")

LARGEST = 1e50
"""No reading, power or time is beyond this; within it, sums of squares cannot overflow."""

_NAMES_SHOWN = 12
_NAME_SHOWN = 40


class RecordError(ThermoctlError, ValueError):
    """A record cannot be used; the message says what was expected and what came."""


class ColumnError(RecordError):
    """A column was not named, or is not there; the message says which ones are."""


@dataclass(frozen=True, slots=True)
class Columns:
    """Names of the three columns a replay needs; None: the obvious one."""

    output: str | None = None
    input: str | None = None
    time: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """One output and one input over time.

    Parameters
    ----------
    source : str
        Where it came from, for messages.
    t_s : ndarray, shape (T,)
        Strictly increasing time in s, or the number of the row where the file has no time.
    u, y : ndarray, shape (T,)
        Input in force from this row to the next one, and output; finite, in the file's units.
    names : Columns
        The columns that were read; `time` is None where rows were counted instead.
    skipped : int
        Rows that were left out.
    notes : tuple of str
        What a reader of results should know: guesses, rows left out, gaps, uneven sampling.
    nominal_s : float, optional
        Interval that was aimed at, where it is known.
    """

    source: str
    t_s: Array
    u: Array
    y: Array
    names: Columns
    skipped: int = 0
    notes: tuple[str, ...] = ()
    nominal_s: float | None = None

    @property
    def period_s(self) -> float:
        """Median interval between two samples in s, or what was aimed at if that is met."""
        median_s, nominal_s = float(np.median(np.diff(self.t_s))), self.nominal_s
        if nominal_s is not None and abs(median_s - nominal_s) <= _AS_AIMED * nominal_s:
            return nominal_s  # a wake that is 10 us late is no other period
        return median_s

    @property
    def stretch_start(self) -> npt.NDArray[np.intp]:
        """For every sample, where its stretch without a gap began, shape (T,)."""
        index = np.arange(len(self.t_s))
        fresh = np.concatenate(([True], np.diff(self.t_s) > GAP * self.period_s))
        return np.maximum.accumulate(np.where(fresh, index, 0))


@dataclass(slots=True)
class Collector:
    """Grows a record sample by sample and keeps count of what is left out."""

    source: str
    names: Columns
    notes: list[str] = field(default_factory=list)
    skipped: int = 0
    first_skipped: str = ""
    nominal_s: float | None = None
    _t: array[float] = field(default_factory=lambda: array("d"))
    _u: array[float] = field(default_factory=lambda: array("d"))
    _y: array[float] = field(default_factory=lambda: array("d"))

    @property
    def full(self) -> bool:
        """Whether `MAX_ROWS` are in."""
        return len(self._t) >= MAX_ROWS

    def skip(self, where: str, why: str) -> None:
        """Count a row that is not sound; the first one is remembered with its place."""
        self.skipped += 1
        self.first_skipped = self.first_skipped or f"{where}: {why}"

    def add(self, where: str, t_s: float, u: float, y: float) -> None:
        """Take a row of finite numbers, unless its time does not lie after the last one.

        A number beyond every meaning is a broken row, too.
        """
        wildest = max(t_s, u, y, key=abs)
        if abs(wildest) > LARGEST:
            self.skip(where, f"{wildest:g} is no number that could be meant")
            return
        if self._t and not t_s > self._t[-1]:
            self.skip(where, f"time {t_s:.12g} s does not lie after {self._t[-1]:.12g} s")
            return
        self._t.append(t_s)
        self._u.append(u)
        self._y.append(y)

    def finish(self) -> Record:
        """Return the record; raise `RecordError` when fewer than two rows are sound."""
        if len(self._t) < 2:
            came = f"{len(self._t)} of {len(self._t) + self.skipped} rows are"
            first = f"; first problem in {self.first_skipped}" if self.first_skipped else ""
            raise RecordError(f"{self.source}: expected rows of numbers, {came} sound{first}")
        t_s, u, y = (np.frombuffer(column) for column in (self._t, self._u, self._y))
        notes = [*self.notes, *self._left_out(), *_timing_notes(t_s, self.names.time is not None)]
        t_s = t_s - t_s[0]
        told = (self.names, self.skipped, tuple(notes), self.nominal_s)
        return Record(self.source, t_s, u, y, *told)

    def _left_out(self) -> list[str]:
        """Return the note about rows that were left out, if any were."""
        if not self.skipped:
            return []
        share = 100.0 * self.skipped / (self.skipped + len(self._t))
        rows = "1 row" if self.skipped == 1 else f"{self.skipped:,} rows"
        return [f"{rows} left out ({share:.2g} %), the first in {self.first_skipped}"]


def _timing_notes(t_s: Array, timed: bool) -> list[str]:
    """Return notes about gaps and uneven sampling."""
    intervals = np.diff(t_s)
    period = float(np.median(intervals))
    unit = " s" if timed else " rows"
    holes = intervals[intervals > GAP * period]
    notes = []
    if len(holes):
        count = "1 gap" if len(holes) == 1 else f"{len(holes):,} gaps"
        notes.append(
            f"{count} in time, the longest {holes.max():.4g}{unit} (period {period:.4g}{unit});"
            " no model reaches across a gap"
        )
    steady = intervals[intervals <= GAP * period]
    uneven = float(np.mean(np.abs(steady - period) > _JITTER * period)) if len(steady) else 0.0
    if uneven > _JITTER_SHARE:
        notes.append(
            f"sampling is not uniform: {100 * uneven:.0f} % of the intervals are more than"
            f" {100 * _JITTER:.0f} % off {period:.4g}{unit}; the model counts samples, not seconds"
        )
    return notes


def choose_columns(
    source: str, header: Sequence[str], wanted: Columns
) -> tuple[Columns, list[str]]:
    """Return the columns of `header` to read, with notes on unasked ones.

    Raises
    ------
    ColumnError
        If a column that was asked for, or an obvious one, is not there; it names those that are.
    """
    notes: list[str] = []
    there = f"{source} has {_shown(header)}"

    def pick(role: str, name: str | None, obvious: Sequence[str]) -> str | None:
        if name is not None:
            if name not in header:
                raise ColumnError(f"expected a column {name!r} for the {role}; {there}")
            return name
        found = [column for word in obvious for column in header if column.lower() == word]
        if not found:
            return None
        notes.append(f"{role} taken from column {found[0]!r}")
        return found[0]

    output = pick("output", wanted.output, OUTPUT_NAMES)
    if output is None:
        raise ColumnError(f"expected the name of the output column (--output); {there}")
    entry = pick("input", wanted.input, INPUT_NAMES)
    if entry is None:
        raise ColumnError(f"expected the name of the input column (--input); {there}")
    time = pick("time", wanted.time, TIME_NAMES)
    if time is None:
        notes.append("no column is obviously the time: rows are taken as evenly spaced")
    return Columns(output, entry, time), notes


def _shown(header: Sequence[str]) -> str:
    """Return the first names of `header` for a terminal: short, and nothing that controls it."""
    shown = [name if name.isprintable() else ascii(name) for name in header[:_NAMES_SHOWN]]
    more = [f"and {len(header) - _NAMES_SHOWN} more"] if len(header) > _NAMES_SHOWN else []
    return ", ".join([*(name[:_NAME_SHOWN] for name in shown), *more]) or "none"
