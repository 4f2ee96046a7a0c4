"""Option types and words that several commands share."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from thermoctl.app.commands.completion import loops

_UNITS_S = {"": 1.0, "s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
F = TypeVar("F", bound=Callable[..., Any])


class Duration(click.ParamType):  # type: ignore[type-arg]  # no parameter before click 8.2
    """A duration in s, written ``90``, ``90s``, ``10m``, ``1h`` or ``2d``."""

    name = "duration"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not isinstance(value, str):
            return value
        match = re.fullmatch(r"\s*(\d+(?:\.\d*)?)\s*([a-z]*)\s*", value)
        duration_s = math.nan
        if match is not None:
            duration_s = float(match[1]) * _UNITS_S.get(match[2], math.nan)
        if not 0.0 < duration_s < math.inf:
            self.fail(f"expected a duration such as 90s, 10m or 1h, got {value!r}", param, ctx)
        return duration_s


class Speed(click.ParamType):  # type: ignore[type-arg]
    """Simulated seconds a second: a positive number, or ``max`` for infinite."""

    name = "speed"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value == "max":
            return math.inf
        try:
            speed = float(value)
        except ValueError:
            speed = math.nan
        if not 0.0 < speed <= 1e6:
            self.fail(f"expected a number above 0, up to 1e6, or max, got {value!r}", param, ctx)
        return speed


class Parsed(click.ParamType):  # type: ignore[type-arg]
    """A word that `parse` understands, or refuses with a ValueError that says why."""

    def __init__(self, name: str, parse: Callable[[str], Any]) -> None:
        self.name = name
        self._parse = parse

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not isinstance(value, str):
            return value
        try:
            return self._parse(value)
        except ValueError as problem:
            self.fail(str(problem), param, ctx)


def positive_number(text: str) -> float:
    """Return a number greater than zero; ``ValueError`` if it is none."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise ValueError(f"expected a number greater than zero, got {text!r}")
    return value


DURATION, SPEED = Duration(), Speed()
FILE = click.Path(path_type=Path, readable=False)
"""A file that whoever reads it reports on; click would call a missing right wrong usage."""


class Commands(click.Group):
    """A group that lists its commands with their whole first sentence."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write one row for each command, none of them cut."""
        rows = []
        for name in self.list_commands(ctx):
            command = self.get_command(ctx, name)
            if command is not None and not command.hidden:
                paragraph = inspect.cleandoc(command.help or "").split("\n\n")[0]
                rows.append((name, " ".join(paragraph.split())))
        if rows:
            with formatter.section("Commands"):
                formatter.write_dl(rows)


def examples(*lines: str) -> str:
    """Return the end of a help page: commands as they are typed, one a line."""
    return "\n".join(("\b", "Examples:", *(f"  {line}" for line in lines)))


def config_option(function: F) -> F:
    """Add ``-c FILE``, which may be given several times."""
    return click.option(
        "-c",
        "--config",
        "configs",
        multiple=True,
        type=FILE,
        metavar="FILE",
        help="Configuration; /etc/thermoctl/*.toml when not given.",
    )(function)


def state_option(function: F) -> F:
    """Add ``--state DIR``."""
    return click.option(
        "--state",
        type=click.Path(path_type=Path, file_okay=False, readable=False),
        metavar="DIR",
        help="Folder of what survives a restart; else $STATE_DIRECTORY, else the user's.",
    )(function)


def socket_option(function: F) -> F:
    """Add ``--socket PATH``."""
    return click.option(
        "--socket",
        type=click.Path(path_type=Path, dir_okay=False, readable=False),
        metavar="PATH",
        help="The daemon's control socket; in its runtime folder when not given.",
    )(function)


def loop_option(function: F) -> F:
    """Add ``--loop NAME``."""
    return click.option("--loop", metavar="NAME", shell_complete=loops, help="Only this loop.")(
        function
    )


def json_option(function: F) -> F:
    """Add ``--json``."""
    return click.option("--json", "as_json", is_flag=True, help="Machine-readable output.")(
        function
    )
