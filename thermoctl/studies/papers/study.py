"""What every repeated study offers, so that one command can run any of them.

A study is a frozen object that holds its settings. `Study.run` yields what is known so far after
every batch of replications, and the whole at the end: whoever stops it early keeps what is
finished. Replication r draws from `generator(seed, r)` alone, so that fewer replications are the
beginning of more, in batches of any size.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np

Cell = str | float | int | bool | None
Row = Mapping[str, Cell]


@dataclass(frozen=True, slots=True)
class Column:
    """How one key of a table's rows is shown to people.

    Parameters
    ----------
    key : str
        Key of the rows, as it stands in JSON.
    heading : str
        Words above the column.
    shown : str
        Format specification of its numbers; words are shown as they are.
    """

    key: str
    heading: str
    shown: str = ".3g"


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a study has found so far.

    Parameters
    ----------
    replications : int
        How many are finished.
    table : sequence of mappings
        Rows of numbers under the keys of JSON; every row has all of them, None: not known.
    figures : mapping
        For every figure its title and numbers, ready for JSON: lists, not arrays; no NaN. The key
        is the number the figure has in the paper, or a word where the paper has none.
    """

    replications: int
    table: Sequence[Row]
    figures: Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True, slots=True)
class Repeated:
    """The settings of every study.

    Parameters
    ----------
    replications : int
        Independent runs, at least 1.
    seed : int
        Of all noise, at least 0.

    Raises
    ------
    ValueError
        `replications` is no integer of at least 1, or `seed` none of at least 0.
    """

    replications: int
    seed: int = 1

    def __post_init__(self) -> None:
        _integer("replications", self.replications, 1)
        _integer("seed", self.seed, 0)


@dataclass(frozen=True, slots=True)
class Batched(Repeated):
    """The settings of a study whose replications are computed together.

    Parameters
    ----------
    batch : int
        How many at once, at least 1; it changes nothing but the time taken. More are hardly
        faster, and Ctrl-C has to wait for them.

    Raises
    ------
    ValueError
        As for `Repeated`, or `batch` is no integer of at least 1.
    """

    batch: int = 250

    def __post_init__(self) -> None:
        Repeated.__post_init__(self)
        _integer("batch", self.batch, 1)


class Study(Protocol):
    """A study of a paper, with its settings."""

    title: ClassVar[str]
    columns: ClassVar[tuple[Column, ...]]
    replications: int
    seed: int

    def run(self) -> Iterator[Outcome]:
        """Yield what is known after each batch of replications; the last is the whole."""
        ...

    def draw(self, outcome: Outcome, files: Sequence[Path]) -> list[Path]:
        """Draw the page of the paper's figures into `files` and return what was written."""
        ...


def generator(seed: int, replication: int) -> np.random.Generator:
    """Return the source of all randomness of one replication."""
    return np.random.default_rng((seed, replication))


def _integer(name: str, value: int, least: int) -> None:
    """Raise ``ValueError`` unless `value` is an integer of `least` or more."""
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ValueError(f"{name} must be an integer of at least {least}, got {value!r}")
