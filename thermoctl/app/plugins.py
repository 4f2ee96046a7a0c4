"""Finds drivers, controllers and estimators by entry point, and builds laws from their options.

A third party adds one by declaring it in its own package; only the kind that a configuration names
is loaded.
"""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterable, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any, get_type_hints

from pydantic import TypeAdapter, ValidationError

from thermoctl.errors import ConfigError

DRIVERS = "thermoctl.drivers"
CONTROLLERS = "thermoctl.controllers"
ESTIMATORS = "thermoctl.estimators"


def kinds(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of `group` by kind, in alphabetical order."""
    return {each.name: each for each in sorted(entry_points(group=group), key=lambda e: e.name)}


def find(group: str, kind: str) -> Any:
    """Return the class of `kind`; raise `ConfigError` naming the known ones if there is none."""
    known = kinds(group)
    if kind not in known:
        what = group.rpartition(".")[2].removesuffix("s")
        raise ConfigError(f"no {what} is called {kind!r}{nearest(kind, known)}")
    return known[kind].load()


def nearest(name: str, known: Iterable[str]) -> str:
    """Return words that offer what was probably meant by `name`."""
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; known: {', '.join(names)}" if names else ""


def option_names(law: type, injected: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the names of the options of a frozen law, without those the composer fills in."""
    return tuple(
        field.name
        for field in dataclasses.fields(law)
        if field.init and field.name not in set(injected)
    )


def build(law: type, options: Mapping[str, Any], **injected: Any) -> Any:
    """Return ``law(**options, **injected)``, with unknown, ill-typed and bad options refused.

    Raises
    ------
    ConfigError
        Naming the option, and what it should have been.
    """
    known = option_names(law, injected)
    hints = get_type_hints(law)
    accepted: dict[str, Any] = {}
    for name, value in options.items():
        if name not in known:
            raise ConfigError(f"unknown key {name!r}{nearest(name, known)}")
        try:
            accepted[name] = TypeAdapter(
                hints[name], config={"arbitrary_types_allowed": True}
            ).validate_python(value)
        except ValidationError as error:
            raise ConfigError(f"{name}: {error.errors()[0]['msg']}, got {value!r}") from error
    try:
        return law(**accepted, **injected)
    except (TypeError, ValueError) as error:
        raise ConfigError(str(error)) from error
