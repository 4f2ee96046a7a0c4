"""``thermoctl config``: check, show, describe and begin a configuration."""

from __future__ import annotations

import json
from pathlib import Path

import click

from thermoctl.app.commands.options import Commands, config_option, json_option
from thermoctl.app.commands.service import settings_of
from thermoctl.app.compose import wiring_errors
from thermoctl.app.configuration.document import (
    BadConfiguration,
    Problem,
    exposures,
    read_document,
)
from thermoctl.app.configuration.in_force import in_force
from thermoctl.app.configuration.new import new
from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.configuration.toml_text import toml_text
from thermoctl.app.doubts import doubts
from thermoctl.app.settings import Settings, default_files, settings_in

_REST = "how loops and boards go together is checked once this is mended"


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


def runnable(files: list[Path]) -> Settings:
    """Return the settings in `files`, tried out as far as that needs no hardware.

    Raises
    ------
    ConfigError
        `BadConfiguration`, with everything that is wrong, the wiring included.
    """
    document = read_document(files)
    wrong: list[Problem] = []
    settings: Settings | None
    try:
        settings = settings_in(document)
    except BadConfiguration as error:
        wrong += error.problems
        settings = error.read
    note = _REST if settings is None else ""
    if settings is not None:
        wrong += [document.problem(key, text) for key, text in wiring_errors(settings)]
    if wrong or settings is None:
        raise BadConfiguration(wrong, note=note)
    return settings


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
    from thermoctl.app.configuration.catalogue import schema as json_schema

    click.echo(json.dumps(json_schema(), indent=None if as_json else 2, ensure_ascii=False))


def _loop_words(name: str, table: LoopTable) -> str:
    return (
        f"{name} ({table.setpoint_c:g} °C, off above {table.trip_above_c:g} °C, "
        f"{table.controller.kind}, every {table.period_s:g} s)"
    )
