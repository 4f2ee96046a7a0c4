"""What a shell offers after TAB: modes, kinds of laws, what a daemon knows.

Nothing here may fail or take long: where no daemon answers, nothing is offered.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, Final

import click

from thermoctl.app import plugins
from thermoctl.errors import ThermoctlError
from thermoctl.services.control_client import ControlClient

MODES: Final = ("off", "manual", "auto")
"""Modes that may be asked for."""


def modes(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """Return the modes that begin as `typed`."""
    return _beginning(typed, MODES)


def laws(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """Return the kinds of controllers that begin as `typed`, and ``none``."""
    return _beginning(typed, (*plugins.kinds(plugins.CONTROLLERS), "none"))


def shadows(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """Return who is in the shadow of a loop of the running daemon."""
    meant = [loop["shadow"] for loop in _loops(context) if loop.get("shadow")]
    return _beginning(typed, meant)


def loops(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """Return the loops of the running daemon."""
    return _beginning(typed, [loop["loop"] for loop in _loops(context)])


def codes(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """Return the alarms of the running daemon."""
    return _beginning(typed, [code for loop in _loops(context) for code in loop.get("alarms", ())])


def keys(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """Return what ``get`` may be asked for."""
    return _beginning(typed, [key for loop in _loops(context) for key in loop])


def _beginning(typed: str, words: Iterable[str]) -> list[str]:
    return sorted({word for word in words if word.startswith(typed)})


def _loops(context: click.Context) -> list[Mapping[str, Any]]:
    """Return the status of each loop of the daemon that is meant; none where none answers."""
    try:
        with ControlClient(context.params.get("socket")) as client:
            return list(client.ask("status")["loops"])
    except (ThermoctlError, OSError, json.JSONDecodeError):
        return []
