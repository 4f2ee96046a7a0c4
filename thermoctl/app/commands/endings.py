"""How a command ends: streams closed, full or narrow; errors in one line each.

Exit codes: 1 failed, 2 wrong usage, 3 no daemon runs, 4 an alarm is active, 69 something is
missing or held, 77 not permitted, 78 bad configuration, 130 interrupted, 143 terminated.
"""

from __future__ import annotations

import errno
import io
import json
import os
import re
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Final, TextIO

import click

from thermoctl.errors import ConfigError, NotPermitted, NotRunning, ThermoctlError, Unavailable

EXIT_FAILED, EXIT_USAGE, EXIT_UNAVAILABLE, EXIT_PERMISSION, EXIT_CONFIG = 1, 2, 69, 77, 78
EXIT_NOT_RUNNING, EXIT_ALARM, EXIT_INTERRUPTED, EXIT_TERMINATED = 3, 4, 130, 143

EXPECTED: Final = (click.ClickException, click.Abort, ThermoctlError, OSError)
"""What a command may end with; anything else is a bug and keeps its traceback."""

_STREAMS: Final = ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w"))


# -- streams ---------------------------------------------------------------------------------------


def prepare_streams() -> None:
    """Make the standard streams safe to use, however the command was started.

    One that was closed becomes a stream to nowhere. Its number is taken, too: else the next file
    that is opened, a history say, would get it and whatever is printed. A character that the
    encoding of a stream does not have becomes a question mark.
    """
    for number, name, mode in _STREAMS:
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free is this one
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors != "backslashreplace":
            stream.reconfigure(errors="replace")


def flush() -> None:
    """Write out what is still buffered for stdout.

    Raises
    ------
    OSError
        It cannot be written; nothing will try again, not even the end of the interpreter.
    """
    try:
        sys.stdout.flush()
    except OSError as error:
        _abandon(sys.stdout)
        raise OSError(error.errno, error.strerror, "standard output") from error


def _abandon(stream: TextIO) -> None:
    """Point a stream that cannot be written to nowhere, so that its end is silent."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


# -- signals ---------------------------------------------------------------------------------------


class Terminated(KeyboardInterrupt):
    """SIGTERM came: to be met as Ctrl-C is, and told apart by the exit code."""


@contextmanager
def terminable() -> Iterator[None]:
    """Let SIGTERM end what runs inside as Ctrl-C does; from the main thread only.

    Raises
    ------
    Terminated
        SIGTERM came. Another one changes nothing until the end: `timeout` sends it twice.
    """

    def end(number: int, frame: object) -> None:
        signal.signal(number, signal.SIG_IGN)
        raise Terminated

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


# -- errors ----------------------------------------------------------------------------------------


def exit_code_of(error: BaseException) -> int:
    """Return the exit code that goes with an error."""
    match error:
        case click.Abort():
            return EXIT_TERMINATED if _is_terminated(error) else EXIT_INTERRUPTED
        case click.ClickException():
            return error.exit_code
        case ConfigError():
            return EXIT_CONFIG
        case NotRunning():
            return EXIT_NOT_RUNNING
        case Unavailable():
            return EXIT_UNAVAILABLE
        case NotPermitted() | PermissionError():
            return EXIT_PERMISSION
        case _:
            return EXIT_FAILED


def words_of(error: BaseException) -> str:
    """Return what an error says: no number of the system, and usage in one line."""
    match error:
        case click.Abort():
            if isinstance(error.__context__, EOFError):
                return "expected an answer, got the end of input"
            return "terminated" if _is_terminated(error) else "interrupted"
        case click.ClickException():
            return _usage(error)
        case OSError() if error.strerror:
            where = "" if error.filename is None else f"{os.fsdecode(error.filename)}: "
            return f"{where}{error.strerror}"
        case _:
            return str(error) or type(error).__name__


def _is_terminated(error: click.Abort) -> bool:
    return isinstance(error.__cause__, Terminated)


def _usage(error: click.ClickException) -> str:
    if isinstance(error, click.BadParameter) and not isinstance(error, click.MissingParameter):
        param = error.param
        hint = error.param_hint or (param.get_error_hint(error.ctx) if param else "")
        hint = (hint if isinstance(hint, str) else " / ".join(hint)).replace("'", "")
        told = _expected(error) or error.message
        text = f"{hint}: {told}" if hint else told
    else:
        text = error.format_message()
    text = " ".join(text.split()).removesuffix(".")
    if text[:1].isupper() and text[1:2].islower():
        text = text[0].lower() + text[1:]
    context = error.ctx if isinstance(error, click.UsageError) else None
    if type(error).__name__ == "NoArgsIsHelpError":  # since click 8.2, with a whole page for text
        text = f"expected a command, {_commands(context)}"
    return text if context is None else f"{text}; see {context.command_path} --help"


_TOLD = re.compile(r"(?s)(?P<got>'.*'|[-+.\w]+) is not (?:one of|in the range|'|a valid).*")


def _expected(error: click.BadParameter) -> str:
    """Return what was expected and what came, for the types that click words by itself."""
    kind, told = (error.param.type if error.param else None), _TOLD.fullmatch(error.message)
    if told is None:
        return ""
    match kind:
        case click.Choice():
            expected = f"one of {', '.join(map(str, kind.choices))}"
        case click.IntRange(min=low, max=None) if low is not None:
            expected = f"a whole number from {low} on"
        case click.IntRange():
            expected = f"a whole number from {kind.min} to {kind.max}"
        case _:
            return ""
    return f"expected {expected}, got {told['got']}"


def _commands(context: click.Context | None) -> str:
    """Return the names of the commands of a group."""
    if context is None or not isinstance(context.command, click.Group):
        return "got none"
    return f"one of {', '.join(context.command.list_commands(context))}"


def tell(error: BaseException, arguments: Sequence[str]) -> int:
    """Tell an error on stderr, with ``--json`` on stdout too; return its exit code."""
    code, words = exit_code_of(error), words_of(error)
    if isinstance(error, OSError) and error.errno == errno.EPIPE:
        _abandon(sys.stdout)  # whoever read us has heard enough
        return code
    for line in words.splitlines():
        with suppress(OSError):
            click.echo(f"thermoctl: {line}", err=True)
    if "--json" in arguments:
        told: dict[str, Any] = {"kind": type(error).__name__, "text": words, "exit_code": code}
        if problems := getattr(error, "problems", ()):
            told["problems"] = [problem.as_json() for problem in problems]
        with suppress(OSError):
            click.echo(json.dumps({"error": told}))
    with suppress(OSError):
        flush()
    return code
