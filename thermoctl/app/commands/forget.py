"""``thermoctl forget``: what was learnt of a plant, where it is another one now."""

from __future__ import annotations

from pathlib import Path

import click

from thermoctl.app.commands.options import config_option, examples, state_option
from thermoctl.app.commands.service import settings_of
from thermoctl.app.daemon.daemon import state_for
from thermoctl.services.learned import LearnedStore
from thermoctl.services.lock import DaemonLock
from thermoctl.services.places import make_private


@click.command(epilog=examples("thermoctl forget tank", "thermoctl forget tank -c tank.toml"))
@click.argument("loop")
@config_option
@state_option
def forget(loop: str, configs: tuple[Path, ...], state: Path | None) -> int:
    """Forget what was learnt of LOOP, so that its next start begins with nothing.

    Refused while a daemon is running: it would store again what it knows. Seldom needed, as a model
    that foresees worse than none is dropped within minutes.
    """
    settings = settings_of(configs)
    name, _ = settings.loop(loop)
    directory = make_private(state_for(settings, state))
    with DaemonLock(directory / "daemon.lock"):
        store = LearnedStore(directory)
        there = store.forget(name)
    path = store.path_of(name)
    click.echo(f"{name}: forgotten; {path} is gone" if there else f"{name}: no model in {path}")
    return 0
