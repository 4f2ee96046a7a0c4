"""The daemon and what belongs to it: ``run``, ``alarms`` and ``history``."""

from __future__ import annotations

import json
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import click

from thermoctl.app.options import (
    DURATION,
    FILE,
    Commands,
    config_option,
    examples,
    json_option,
    state_option,
)
from thermoctl.app.settings import Settings, default_files, load_all
from thermoctl.errors import Refused, Unavailable
from thermoctl.services.lock import DaemonLock
from thermoctl.services.places import runtime_dir, state_dir
from thermoctl.services.store import Latch, LatchStore

SERVICE_STATE = Path("/var/lib/thermoctl")
_ANSWER_S = 2.5


@click.command(
    epilog=examples("thermoctl run", "thermoctl run -c tank.toml --state ./state"),
)
@config_option
@state_option
def run(configs: tuple[Path, ...], state: Path | None) -> int:
    """Run the daemon until it is told to stop."""
    from thermoctl.app.daemon import Daemon

    return 0 if Daemon(configs, state).run() else 1


def _settings(configs: tuple[Path, ...]) -> Settings:
    return load_all(list(configs) or default_files())


def _state_of_daemon(settings: Settings | None, given: Path | None) -> Path:
    """Return the folder a daemon with these settings keeps its state in."""
    configured = settings.service.state_directory if settings else None
    if given is not None or configured:
        return given or Path(str(configured))
    usual = state_dir()
    return SERVICE_STATE if not usual.is_dir() and SERVICE_STATE.is_dir() else usual


@click.group(cls=Commands, invoke_without_command=True)
@config_option
@state_option
@json_option
@click.pass_context
def alarms(
    ctx: click.Context, configs: tuple[Path, ...], state: Path | None, as_json: bool
) -> None:
    """List what is latched; `alarms ack` clears it.

    Exits 0 whether or not something is latched; --json gives a list, empty when nothing is.
    """
    if ctx.invoked_subcommand is not None:
        return
    settings = _settings(configs)
    latches = _latches(settings, _state_of_daemon(settings, state))
    if as_json:
        click.echo(json.dumps([_row(name, latch) for name, (latch, _) in latches.items()]))
    elif not latches:
        click.echo("no loop is latched")
    for name, (latch, _) in latches.items() if not as_json else ():
        click.echo(f"{name} : {latch.code} since {_since(latch) or 'unknown'}: {latch.text}")


@alarms.command()
@config_option
@state_option
@click.option("--loop", metavar="NAME", help="Only this loop.")
@json_option
def ack(configs: tuple[Path, ...], state: Path | None, loop: str | None, as_json: bool) -> None:
    """Acknowledge, and let a latched loop heat again once its cause is gone."""
    settings = _settings(configs)
    if loop is not None:
        settings.loop(loop)
    directory = _state_of_daemon(settings, state)
    latches = {n: v for n, v in _latches(settings, directory).items() if loop in (None, n)}
    if not latches and not as_json:
        click.echo("no loop is latched", err=True)
    for name, (latch, store) in latches.items():
        store.clear(name)
        if _running(directory) and _comes_back(store, name):
            raise Refused(
                f"the daemon did not clear {latch.code} of {name}: its cause still stands"
            )
        if not as_json:
            click.echo(f"{name} : {latch.code} acknowledged")
    if as_json:
        rows = [_row(name, latch) for name, (latch, _) in latches.items()]
        gone = {"active": False, "latched": False, "acknowledged": True}
        click.echo(json.dumps([row | gone for row in rows]))


def _latches(settings: Settings, directory: Path) -> dict[str, tuple[Latch, LatchStore]]:
    store = LatchStore(directory, runtime_dir())
    for name in settings.loops:
        store.check_readable(name)
    return {n: (latch, store) for n in settings.loops if (latch := store.load(n)) is not None}


def _running(directory: Path) -> bool:
    """Return whether a daemon holds the state folder."""
    try:
        with DaemonLock(directory / "daemon.lock"):
            return False
    except Unavailable:
        return True


def _comes_back(store: LatchStore, loop: str) -> bool:
    """Return whether a running daemon writes the latch again: it does at first, and clears it."""
    until_s = time.monotonic() + _ANSWER_S
    while time.monotonic() < until_s:
        time.sleep(0.1)
    return store.exists(loop)


def _row(loop: str, latch: Latch) -> dict[str, Any]:
    return {
        "loop": loop,
        "code": latch.code,
        "fault": latch.fault,
        "priority": 1,
        "since": _since(latch),
        "active": True,
        "latched": True,
        "acknowledged": False,
        "text": latch.text,
    }


def _since(latch: Latch) -> str | None:
    if latch.since_utc_s != latch.since_utc_s:
        return None
    return datetime.fromtimestamp(latch.since_utc_s, UTC).isoformat(timespec="seconds")


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
        settings = _settings(configs) if configs or not state else None
        name = settings.history.file if settings else "history.sqlite"
        file = _state_of_daemon(settings, state) / name
    count = write_csv(file, out or sys.stdout, _moment(since), _moment(until), loop)
    if out is not None:
        click.echo(f"{count} cycles written to {out}", err=True)


def _moment(text: str | None) -> datetime | None:
    """Return a time given as an age or in ISO 8601; without a zone it is local."""
    if text is None:
        return None
    try:
        return datetime.fromisoformat(text).astimezone(UTC)
    except ValueError:
        pass
    try:
        age_s = DURATION.convert(text, None, None)
    except click.BadParameter as error:
        raise click.UsageError(
            f"expected an age such as 24h or a time such as 2026-01-31T12:00+01:00, got {text!r}"
        ) from error
    return datetime.now(UTC) - timedelta(seconds=age_s)
