"""``thermoctl off``: power 0 to every board, when no daemon is there to do it.

Meant for the service manager, after any end of the daemon, and for an operator in doubt.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import click
from pydantic import BaseModel

from thermoctl.app.commands.options import config_option, state_option
from thermoctl.app.commands.service import settings_of
from thermoctl.app.compose import board_builder
from thermoctl.app.daemon.daemon import locks_of, state_for
from thermoctl.errors import DriverError
from thermoctl.runtime.clock import MonotonicClock
from thermoctl.services.lock import STOP_IT
from thermoctl.services.places import make_private

OPEN_S = 3.0
_ASK_IT = f"thermoctl mode off ends its heat, or {STOP_IT}"


@click.command()
@config_option
@state_option
def off(configs: tuple[Path, ...], state: Path | None) -> int:
    """Write power 0 to every board; refused while a daemon is running.

    Exits 1 when a board did not confirm; its dead-man then has to.
    """
    settings = settings_of(configs)
    with ExitStack() as stack:
        for lock in locks_of(settings, make_private(state_for(settings, state)), _ASK_IT):
            stack.enter_context(lock)
        told = [_switch_off(name, board) for name, board in settings.boards.items()]
    return 0 if all(told) else 1


def _switch_off(name: str, settings: BaseModel) -> bool:
    """Open the board, which writes power 0 before anything else, and let it go."""
    clock = MonotonicClock()
    try:
        board = board_builder(settings, clock)()
        try:
            identity = board.open(clock.now_s() + OPEN_S)
        finally:
            board.close()
    except DriverError as error:
        click.echo(f"thermoctl: {name}: expected a board that takes power 0: {error}", err=True)
        return False
    click.echo(f"{name}: power 0, {identity.kind} {identity.name}")
    return True
