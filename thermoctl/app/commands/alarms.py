"""``alarms`` and ``alarms ack``: through the daemon, else in the files it left."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from thermoctl.app.advice import advice_for
from thermoctl.app.commands.completion import codes
from thermoctl.app.commands.options import (
    Commands,
    config_option,
    examples,
    json_option,
    loop_option,
    socket_option,
    state_option,
)
from thermoctl.app.commands.service import settings_of, state_of_daemon
from thermoctl.app.cycle_record import latch_row
from thermoctl.app.live import numbers
from thermoctl.app.settings import ETC, Settings
from thermoctl.errors import NotPermitted, NotRunning, Refused, Unavailable
from thermoctl.services.control_client import ControlClient
from thermoctl.services.lock import DaemonLock
from thermoctl.services.places import runtime_dir
from thermoctl.services.store import Latch, LatchStore

_ANSWER_S = 2.5
_GONE = {"active": False, "latched": False, "acknowledged": True}


@click.group(cls=Commands, invoke_without_command=True)
@config_option
@state_option
@socket_option
@json_option
@click.pass_context
def alarms(
    ctx: click.Context,
    configs: tuple[Path, ...],
    state: Path | None,
    socket: Path | None,
    as_json: bool,
) -> None:
    """List alarms, or what is latched when no daemon runs; `alarms ack` clears it.

    Exits 0 whether or not there are any; --json gives a list, empty when there are none.
    """
    if ctx.invoked_subcommand is not None:
        return
    client = _daemon(configs, state, socket)
    if client is None:
        settings = _left_settings(configs)
        latches = _latches(settings, state_of_daemon(settings, state))
        rows = [latch_row(name, latch) for name, (latch, _) in latches.items()]
    else:
        with client:
            rows = client.ask("alarms")["alarms"]
    if as_json:
        click.echo(json.dumps(rows))
        return
    if not rows:
        click.echo("no loop is latched" if client is None else "no alarm")
    for row in rows:
        for line in _described(row):
            click.echo(line)


def _described(row: Mapping[str, Any]) -> list[str]:
    """Return what is wrong in one line, and what it means in another."""
    over = "" if row["active"] else " (over, not acknowledged)"
    since = row["since"] or "unknown"
    advice = advice_for(row["code"])
    text = numbers.plain(numbers.sentence(row["text"]))
    told = f"{row['loop']}: {row['code']} since {since}: {text}{over}"
    return [told, f"    {advice}"] if advice else [told]


@alarms.command(epilog=examples("thermoctl alarms ack", "thermoctl alarms ack sensor.disagree"))
@click.argument("code", required=False, shell_complete=codes)
@config_option
@state_option
@socket_option
@loop_option
@json_option
def ack(
    code: str | None,
    configs: tuple[Path, ...],
    state: Path | None,
    socket: Path | None,
    loop: str | None,
    as_json: bool,
) -> None:
    """Acknowledge, and let a latched loop heat again once its cause is gone.

    CODE is one that `alarms` lists; all of them when left out.
    """
    client = _daemon(configs, state, socket)
    if client is not None:
        with client:
            rows = _acknowledged(client, code, loop)
        _tell([{**row, "acknowledged": True} for row in rows], "no alarm", as_json)
        return
    settings = _left_settings(configs)
    if loop is not None:
        settings.loop(loop)
    directory = state_of_daemon(settings, state)
    latches = {n: v for n, v in _latches(settings, directory).items() if loop in (None, n)}
    latched = [latch.code for latch, _ in latches.values()]
    if code is not None and code not in latched:
        raise _no_such(code, latched)
    latches = {n: v for n, v in latches.items() if code in (None, v[0].code)}
    for name, (latch, store) in latches.items():
        store.clear(name)
        if _running(directory) and _comes_back(store, name):
            raise Refused(
                f"the daemon did not clear {latch.code} of {name}: its cause still stands"
            )
    rows = [latch_row(name, latch) | _GONE for name, (latch, _) in latches.items()]
    _tell(rows, "no loop is latched", as_json)


def _acknowledged(
    client: ControlClient, code: str | None, loop: str | None
) -> list[Mapping[str, Any]]:
    """Return the alarms that were acknowledged, by the loops that have them."""
    if code is None:
        return list(client.ask_loop("ack", loop=loop)["acknowledged"])
    rows = client.ask("alarms", loop=loop)["alarms"]
    meant = dict.fromkeys(row["loop"] for row in rows if row["code"] == code)
    if not meant:
        raise _no_such(code, [row["code"] for row in rows])
    asked = (client.ask_loop("ack", code=code, loop=name) for name in meant)
    return [row for reply in asked for row in reply["acknowledged"]]


def _no_such(code: str, known: Sequence[str]) -> Refused:
    there = f"one of {', '.join(dict.fromkeys(known))}" if known else "none, for there is no alarm"
    return Refused(f"expected {there}, got {code!r}")


def _tell(rows: Sequence[Mapping[str, Any]], none: str, as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps(rows))
    elif not rows:
        click.echo(none, err=True)
    for row in () if as_json else rows:
        click.echo(f"{row['loop']}: {row['code']} acknowledged")


# -- a daemon that runs ----------------------------------------------------------------------------


def _daemon(
    configs: tuple[Path, ...], state: Path | None, socket: Path | None
) -> ControlClient | None:
    """Return a connection to the daemon that is meant; None where it does not run.

    Options that name another state folder mean another daemon than the one that answers.
    """
    named = bool(configs) or state is not None
    try:
        client = ControlClient(socket)
    except NotRunning:
        if socket is not None:
            raise
        return None
    except NotPermitted:
        if socket is not None or not named:
            raise
        return None
    if socket is not None or not named:
        return client
    try:
        meant = state_of_daemon(settings_of(configs), state).resolve()
        told = Path(client.ask("status")["state_directory"]).resolve()
    except BaseException:
        client.close()
        raise
    if told == meant:
        return client
    client.close()
    return None


def _left_settings(configs: tuple[Path, ...]) -> Settings:
    """Return the settings of a daemon that is gone; `NotRunning` where nobody names them."""
    if not configs and not any(ETC.glob("*.toml")):
        raise NotRunning("expected a running daemon, or -c FILE to see what one has left")
    return settings_of(configs)


# -- what a daemon left ----------------------------------------------------------------------------


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
    """Return whether a daemon without a socket writes the latch again: it does, then clears it."""
    time.sleep(_ANSWER_S)
    return store.exists(loop)
