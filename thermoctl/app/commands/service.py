"""The daemon and what it leaves: ``run`` and ``history``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import click

from thermoctl.app.commands.options import (
    DURATION,
    FILE,
    Commands,
    config_option,
    examples,
    socket_option,
    state_option,
)
from thermoctl.app.settings import Settings, default_files, load_all
from thermoctl.services.places import SERVICE_STATE, state_dir


@click.command(
    epilog=examples("thermoctl run", "thermoctl run -c tank.toml --state ./state"),
)
@config_option
@state_option
@socket_option
def run(configs: tuple[Path, ...], state: Path | None, socket: Path | None) -> int:
    """Run the daemon until it is told to stop."""
    from thermoctl.app.daemon.daemon import Daemon

    return 0 if Daemon(configs, state, socket).run() else 1


def settings_of(configs: Sequence[Path]) -> Settings:
    """Return the settings of the files that were given, else of the machine's."""
    return load_all(list(configs) or default_files())


def state_of_daemon(settings: Settings | None, given: Path | None) -> Path:
    """Return the folder a daemon with these settings keeps its state in."""
    configured = settings.service.state_directory if settings else None
    if given is not None or configured:
        return given or Path(str(configured))
    usual = state_dir()
    return SERVICE_STATE if not usual.is_dir() and SERVICE_STATE.is_dir() else usual


@click.group(cls=Commands)
def history() -> None:
    """What has been recorded."""


@history.command()
@config_option
@state_option
@click.option("--file", type=FILE, help="A history file, instead of -c.")
@click.option("-o", "--out", type=FILE, help="CSV file; stdout if not given.")
@click.option(
    "--since", metavar="AGE|TIME", help="24h ago, or an ISO 8601 time; local without a zone."
)
@click.option("--until", metavar="AGE|TIME", help="As --since.")
@click.option("--loop", metavar="NAME", help="Only this loop.")
def export(
    configs: tuple[Path, ...],
    state: Path | None,
    file: Path | None,
    out: Path | None,
    since: str | None,
    until: str | None,
    loop: str | None,
) -> None:
    """Write recorded cycles as CSV."""
    from thermoctl.services.history.reader import export as write_csv

    if file is None:
        settings = settings_of(configs) if configs or not state else None
        name = settings.history.file if settings else "history.sqlite"
        file = state_of_daemon(settings, state) / name
    count = write_csv(file, out or sys.stdout, _moment(since), _moment(until), loop)
    if out is not None:
        click.echo(f"{count} cycles written to {out}", err=True)


def _moment(text: str | None) -> datetime | None:
    """Return a time given as an age or in ISO 8601; without a zone it is local."""
    if text is None:
        return None
    try:
        return datetime.fromisoformat(text).astimezone(UTC)
    except (ValueError, OverflowError):  # no time at all, or none of the calendar
        pass
    try:
        return datetime.now(UTC) - timedelta(seconds=DURATION.convert(text, None, None))
    except (click.BadParameter, OverflowError) as error:
        raise click.UsageError(
            f"expected an age such as 24h or a time such as 2026-01-31T12:00+01:00, got {text!r}"
        ) from error
