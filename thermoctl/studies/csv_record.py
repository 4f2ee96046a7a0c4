"""Read a record from CSV, as loggers and spreadsheets write it."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TextIO

from thermoctl.studies.record import (
    MAX_ROWS,
    Collector,
    Columns,
    Record,
    RecordError,
    choose_columns,
)

LONGEST_LINE = 65_536
"""Characters after which a line is cut, so that a file without line ends cannot fill the memory."""

_DELIMITERS = ",;\t"


def read_csv(path: Path, wanted: Columns) -> Record:
    """Return the record in the CSV file `path`.

    The first line that is neither empty nor a comment (``#``) names the columns; fields are
    parted by comma, semicolon or tab, and with semicolons a comma may be the decimal sign. Time is
    in s or ISO 8601. Rows with a missing, non-numeric or non-finite value, or with a time not after
    that of the last sound row, are left out and counted; at most `MAX_ROWS` are read.

    Raises
    ------
    RecordError
        If the file is empty or no text, a column is missing, or fewer than two rows are sound.
    OSError
        If it cannot be read.
    """
    # Undecodable bytes spoil the field they are in, not the file: "°C" in Latin-1 is common.
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
        return _read(path.name, stream, wanted)


def _read(source: str, stream: TextIO, wanted: Columns) -> Record:
    """Read the header, then row after row."""
    skipped_lines, first = _first_line(source, stream)
    delimiter = max(_DELIMITERS, key=first.count)
    header = [name.strip() for name in next(csv.reader([first], delimiter=delimiter))]
    row_text = _RowText(decimal_comma=delimiter == ";")
    if all(_is_number(name) for name in header):
        shown = first.strip()[:60]
        raise RecordError(f"{source}: expected a first line with column names, got {shown!r}")
    names, notes = choose_columns(source, header, wanted)
    places = _Places.of(header, names)
    collector = Collector(source, names, notes)
    rows = csv.reader(_lines(stream), delimiter=delimiter)
    while True:
        where = f"line {skipped_lines + rows.line_num + 1}"
        try:
            row = next(rows, None)
        except csv.Error as error:
            collector.notes.append(f"reading ended in {where}: {error}")
            break
        if row is None:
            break
        if not row or row[0].startswith("#"):
            continue
        if collector.full:
            collector.notes.append(f"reading ended in {where}: at most {MAX_ROWS:,} rows are read")
            break
        row_text.take(collector, places, row, where)
    return collector.finish()


def _lines(stream: TextIO) -> Iterator[str]:
    """Yield lines, cut at `LONGEST_LINE`."""
    return iter(lambda: stream.readline(LONGEST_LINE), "")


def _first_line(source: str, stream: TextIO) -> tuple[int, str]:
    """Return how many lines were read, and the last of them: the first with words in it."""
    for number, line in enumerate(_lines(stream), start=1):
        if "\0" in line:
            raise RecordError(f"{source}: expected a text file, got binary content")
        if line.strip() and not line.startswith("#"):
            return number, line
    raise RecordError(f"{source}: expected a line with column names, got an empty file")


def _is_number(text: str) -> bool:
    """Return whether `text` reads as a number; no word does, not even nan."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


@dataclass(frozen=True, slots=True)
class _Places:
    """Where in a row the columns stand; `time` is None when rows are counted."""

    time: int | None
    input: int
    output: int
    names: Columns

    @classmethod
    def of(cls, header: Sequence[str], names: Columns) -> _Places:
        """Return the places of `names`, all of which stand in `header`."""
        place = {name: index for index, name in reversed(list(enumerate(header)))}
        time = None if names.time is None else place[names.time]
        return cls(time, place[str(names.input)], place[str(names.output)], names)


@dataclass(slots=True)
class _RowText:
    """Turns the words of rows into numbers; remembers only where counting stands."""

    decimal_comma: bool
    counted: int = 0
    epoch: datetime | None = field(default=None)

    def take(self, collector: Collector, places: _Places, row: list[str], where: str) -> None:
        """Give the row to `collector`, or tell it why not."""
        self.counted += 1
        try:
            t_s = float(self.counted)
            if places.time is not None:
                t_s = self._time(row, places.time, places.names.time)
            u = self._number(row, places.input, places.names.input)
            y = self._number(row, places.output, places.names.output)
        except ValueError as problem:
            collector.skip(where, str(problem))
        else:
            collector.add(where, t_s, u, y)

    def _number(self, row: list[str], place: int, name: str | None) -> float:
        """Return a finite number, or raise ValueError saying what stands there."""
        if place >= len(row):
            raise ValueError(f"no {name} in a row of {len(row)}")
        text = row[place].strip()
        try:
            value = float(text.replace(",", ".") if self.decimal_comma else text)
        except ValueError:
            raise ValueError(f"{name} is {text[:40]!r}") from None
        if not math.isfinite(value):
            raise ValueError(f"{name} is {text[:40]!r}")
        return value

    def _time(self, row: list[str], place: int, name: str | None) -> float:
        """Return seconds, from a number or from a date since the first one."""
        if self.epoch is None:
            try:
                return self._number(row, place, name)
            except ValueError:
                if place >= len(row):
                    raise
        try:
            moment = datetime.fromisoformat(row[place].strip())
        except (ValueError, IndexError):
            came = row[place][:40] if place < len(row) else ""
            raise ValueError(f"{name} is {came!r}, neither seconds nor ISO 8601") from None
        moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        self.epoch = self.epoch or moment
        return (moment - self.epoch).total_seconds()
