"""``thermoctl config``: check, show, describe and begin a configuration."""

from __future__ import annotations

import json
from pathlib import Path

import click

from thermoctl.app.commands.config_new import new
from thermoctl.app.commands.options import Commands, config_option, json_option
from thermoctl.app.commands.service import settings_of
from thermoctl.app.configuration.document import exposures
from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.configuration.toml_text import toml_text
from thermoctl.app.doubts import doubts
from thermoctl.app.in_force import in_force
from thermoctl.app.runnable import runnable
from thermoctl.app.settings import default_files


@click.group(cls=Commands)
def config() -> None:
    """Check, show, describe or begin a configuration."""


config.add_command(new)


@config.command()
@config_option
@json_option
def check(configs: tuple[Path, ...], as_json: bool) -> None:
    """Say whether a configuration can run, or everything that is wrong with it."""
    files = list(configs) or default_files()
    settings = runnable(files)
    warnings = [*exposures(files), *map(str, doubts(settings))]
    for warning in warnings:
        click.echo(f"thermoctl: {warning}", err=True)
    boards = {name: str(getattr(each, "kind", "")) for name, each in settings.boards.items()}
    if as_json:
        told = {"ok": True, "loops": list(settings.loops), "boards": boards, "warnings": warnings}
        click.echo(json.dumps(told))
        return
    loops = ", ".join(_loop_words(name, table) for name, table in settings.loops.items())
    hardware = ", ".join(f"{name} ({kind})" for name, kind in boards.items())
    click.echo(f"{', '.join(map(str, files))}: ok; loops: {loops}; boards: {hardware}")


@config.command()
@config_option
@json_option
def show(configs: tuple[Path, ...], as_json: bool) -> None:
    """Print the configuration in force, defaults included, as TOML."""
    content = in_force(settings_of(configs))
    click.echo(json.dumps(content, sort_keys=True) if as_json else toml_text(content), nl=as_json)


@config.command()
@click.option("--json", "as_json", is_flag=True, help="Accepted for symmetry; it is JSON anyway.")
def schema(as_json: bool) -> None:
    """Print the JSON schema of a configuration, for editors and other programs."""
    from thermoctl.app.catalogue import schema as json_schema

    click.echo(json.dumps(json_schema(), indent=None if as_json else 2, ensure_ascii=False))


def _loop_words(name: str, table: LoopTable) -> str:
    return (
        f"{name} ({table.setpoint_c:g} °C, off above {table.trip_above_c:g} °C, "
        f"{table.controller.kind}, every {table.period_s:g} s)"
    )
