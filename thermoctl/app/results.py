"""Where a command puts what it found, and how it shows how far it is.

Tables and JSON go to stdout, messages and the progress bar to stderr, figures into files.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click
from rich.console import Console
from rich.progress import Progress

from thermoctl.studies.record import RecordError

T = TypeVar("T")

PLAIN_WIDTH = 120
"""Columns of a table that goes into a file or a pipe."""


def console() -> Console:
    """Return where tables go: as wide as the terminal, or as a line in a file may be."""
    stdout = Console(highlight=False)
    return stdout if stdout.is_terminal else Console(highlight=False, width=PLAIN_WIDTH)


def print_json(content: Mapping[str, Any]) -> None:
    """Write one object to stdout."""
    click.echo(json.dumps(content, allow_nan=False, ensure_ascii=False))


def say(messages: Iterable[str]) -> None:
    """Write messages to stderr, one a line."""
    for message in messages:
        click.echo(f"thermoctl: {message}", err=True)


def watched(
    items: Iterable[T], doing: str, total: float, done: Callable[[T], float]
) -> Iterator[T]:
    """Yield `items`; a terminal on stderr sees how far they are, for as long.

    Parameters
    ----------
    items : iterable
        What is computed while it is iterated over.
    doing : str
        Word beside the bar.
    total : float
        What `done` says of the last item.
    done : callable
        Says how far an item is.
    """
    stderr = Console(stderr=True)
    with Progress(console=stderr, transient=True, disable=not stderr.is_terminal) as bar:
        task = bar.add_task(doing, total=total)
        for item in items:
            bar.update(task, completed=done(item))
            yield item


def make_folder(folder: Path) -> None:
    """Make `folder` where it is missing, and say so.

    Called before a long computation, it spares the user to lose its results.

    Raises
    ------
    PermissionError
        This user may not make it, or not write into it.
    RecordError
        It cannot be made for another reason.
    """
    missing = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except PermissionError:
        raise
    except OSError as error:
        raise RecordError(
            f"{folder}: expected a folder for figures, got: {error.strerror}"
        ) from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(folder))
    if missing:
        say([f"folder {folder} made"])


def write_figures(files: Sequence[Path], draw: Callable[[], Iterable[Path]]) -> None:
    """Draw, and say on stderr which folder was made and what was written.

    Raises
    ------
    PermissionError
        This user may not write there.
    RecordError
        A file cannot be written for another reason.
    """
    missing = dict.fromkeys(file.parent for file in files if not file.parent.exists())
    try:
        written = list(draw())
        say(f"folder {folder} made" for folder in missing)
        say(f"figure written to {path}" for path in written)
    except PermissionError:
        raise
    except OSError as error:
        raise RecordError(
            f"{error.filename}: expected a place for a figure, got: {error.strerror}"
        ) from error
