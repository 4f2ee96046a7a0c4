"""Boards from the outside: ``drivers``, ``doctor`` and ``simulate``."""

from __future__ import annotations

import json
import signal
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from thermoctl.app import plugins
from thermoctl.app.commands.options import (
    DURATION,
    Commands,
    config_option,
    json_option,
    state_option,
)
from thermoctl.errors import ConfigError

if TYPE_CHECKING:
    from thermoctl.app.simulate import Wiring
    from thermoctl.plant.parameters import TankParameters

_GAP = "  "
_SEED = 1


# -- what can be connected -------------------------------------------------------------------------


@click.group(cls=Commands, invoke_without_command=True)
@json_option
@click.pass_context
def drivers(ctx: click.Context, as_json: bool) -> None:
    """List the kinds of boards; `drivers show KIND` lists the settings of one."""
    if ctx.invoked_subcommand is not None:
        return
    told = [_driver(kind, entry) for kind, entry in plugins.kinds(plugins.DRIVERS).items()]
    if as_json:
        click.echo(json.dumps(told))
        return
    head = {"kind": "kind", "dead_man": "dead-man", "origin": "from", "text": ""}
    for line in _aligned([head, *told], ("kind", "dead_man", "origin", "text")):
        click.echo(line)


def _driver(kind: str, entry: EntryPoint) -> dict[str, Any]:
    """Return what is said of a kind; one that cannot be loaded says why."""
    from thermoctl.app.catalogue import first_line

    origin = f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else entry.value
    try:
        driver = plugins.find(plugins.DRIVERS, kind)
    except ConfigError as error:
        return {"kind": kind, "dead_man": None, "origin": origin, "text": str(error)}
    dead_man = driver.capabilities.dead_man
    return {"kind": kind, "dead_man": dead_man, "origin": origin, "text": first_line(driver)}


@drivers.command()
@click.argument("kind")
@json_option
def show(kind: str, as_json: bool) -> None:
    """List the settings of a KIND: type, unit, bounds, default and what it is for."""
    from thermoctl.app.catalogue import first_line, rows_of_model

    try:
        driver = plugins.find(plugins.DRIVERS, kind)
    except plugins.BadOption as error:
        raise click.UsageError(error.text) from error
    if as_json:
        click.echo(json.dumps(driver.Settings.model_json_schema()))
        return
    click.echo(first_line(driver))
    head = {"key": "key", "type": "type", "bounds": "bounds", "default": "default", "text": ""}
    rows = [
        {
            "key": row.key,
            "type": f"{row.type}, {row.unit}" if row.unit else row.type,
            "bounds": row.bounds,
            "default": row.default or "-",
            "text": row.text,
        }
        for row in rows_of_model(driver.Settings)
    ]
    for line in _aligned([head, *rows], tuple(head)):
        click.echo(line)


def _aligned(rows: list[dict[str, Any]], columns: tuple[str, ...]) -> list[str]:
    """Return a line for each row, its columns one below the other."""
    cells = [[_cell(row[column]) for column in columns] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        _GAP.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    ]


def _cell(value: Any) -> str:
    if value is None:
        return "?"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value)


# -- what is wrong with this machine ---------------------------------------------------------------


@click.command()
@config_option
@state_option
@json_option
@click.pass_context
def doctor(
    ctx: click.Context, configs: tuple[Path, ...], state: Path | None, as_json: bool
) -> None:
    """Look at ports, boards, clock and service, and say what to do; never heats."""
    from thermoctl.app.doctor import FAIL, examine

    findings = examine(list(configs), state)
    failed = any(finding.status == FAIL for finding in findings)
    if as_json:
        told = [{"status": f.status, "check": f.check, "text": f.text} for f in findings]
        click.echo(json.dumps({"ok": not failed, "findings": told}))
    else:
        width = max(len(finding.check) for finding in findings)
        for finding in findings:
            click.echo(f"{finding.status:<4}  {finding.check.ljust(width)}  {finding.text}")
    ctx.exit(1 if failed else 0)


# -- a board without hardware ----------------------------------------------------------------------


@click.command()
@click.argument("kind", metavar="KIND", type=click.Choice(["thermodaq"]))
@click.option(
    "--link",
    required=True,
    type=click.Path(path_type=Path),
    metavar="PATH",
    help="Where the board's port shall be.",
)
@config_option
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    help="Seed of the simulation; that of the board in FILE, or 1, when not given.",
)
@click.option(
    "--firmware",
    type=click.Choice(["auto", "simavr", "python"]),
    default="auto",
    help="The real firmware on a simulated chip, the board in Python, or the first that works.",
)
@click.option("--duration", type=DURATION, default=float("inf"), help="End after this: 10m, 1h.")
def simulate(
    kind: str,
    link: Path,
    configs: tuple[Path, ...],
    seed: int | None,
    firmware: Any,
    duration: float,
) -> None:
    """Put a simulated board of a KIND, wired to a simulated tank, behind a port.

    KIND is thermodaq.

    A board of kind "simulated" in FILE says what tank and wires are like, and no loop is needed
    there; else the tank is that of Özbek (2021). Converter and dead-man are those of the board.
    """
    from thermoctl.app.simulate import simulate_thermodaq

    parameters, wiring, seed, notes = _described(configs, seed)
    for note in notes:
        click.echo(f"thermoctl: {note}", err=True)
    ended: list[int] = []
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, lambda number, frame: ended.append(number))
    simulate_thermodaq(
        link,
        parameters=parameters,
        wiring=wiring,
        seed=seed,
        firmware=firmware,
        stop=lambda: bool(ended),
        duration_s=duration,
        report=lambda text: click.echo(f"thermoctl: {text}", err=True),
    )


def _described(
    configs: tuple[Path, ...], seed: int | None
) -> tuple[TankParameters | None, Wiring, int, list[str]]:
    """Return tank, wires and seed of the first simulated board, and what is to be said of it."""
    from thermoctl.app.settings import boards_in
    from thermoctl.app.simulate import Wiring, left_out
    from thermoctl_drivers.simulated import SimulatedSettings, tank_parameters

    for name, board in boards_in(configs).items() if configs else ():
        if isinstance(board, SimulatedSettings):
            board = board if seed is None else board.model_copy(update={"seed": seed})
            try:
                parameters = tank_parameters(board)
            except ValueError as error:
                raise ConfigError(f"boards.{name}: {error}") from error
            wiring = Wiring(board.noise_mv, board.pickup_mv, board.mains_hz)
            return parameters, wiring, board.seed, left_out(name, board)
    missing = ["no board of kind simulated there: the tank is that of Özbek (2021)"]
    return None, Wiring(), _SEED if seed is None else seed, missing if configs else []
