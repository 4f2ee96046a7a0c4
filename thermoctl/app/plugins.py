"""Finds drivers and laws by entry point, and builds laws from their options.

A third party adds one by declaring it in its own package; only the kind that a configuration names
is loaded.
"""

from __future__ import annotations

import dataclasses
import difflib
import sys
from collections.abc import Iterable, Mapping
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final, get_origin, get_type_hints

from pydantic import TypeAdapter, ValidationError

from thermoctl.errors import ConfigError

DRIVERS = "thermoctl.drivers"
CONTROLLERS = "thermoctl.controllers"
ESTIMATORS = "thermoctl.estimators"


class BadOption(ConfigError):  # noqa: N818 - as its siblings in errors
    """An option of a kind, or the kind itself, is wrong.

    Parameters
    ----------
    text : str
        What was expected and what came.
    path : tuple of str
        The key it stands under, from the table that is being built; empty when it is the whole.
    """

    def __init__(self, text: str, path: tuple[str, ...] = ()) -> None:
        self.text, self.path = text, path
        super().__init__(": ".join(part for part in (".".join(path), text) if part))


def kinds(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of `group` by kind, in alphabetical order."""
    return {each.name: each for each in _declared(group, tuple(sys.path))}


@lru_cache
def _declared(group: str, path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return what the packages on `path` declare, by name; it reads the metadata of every one."""
    return tuple(sorted(entry_points(group=group), key=lambda each: each.name))


def find(group: str, kind: str) -> Any:
    """Return the class of `kind`.

    Raises
    ------
    BadOption
        There is none, with the known ones; or the package that declares it cannot be imported.
    """
    known = kinds(group)
    what = group.rpartition(".")[2].removesuffix("s")
    if kind not in known:
        raise BadOption(f"no {what} is called {kind!r}{nearest(kind, known)}", ("kind",))
    try:
        return known[kind].load()
    except (ImportError, AttributeError) as error:
        raise BadOption(f"{what} {kind!r} cannot be loaded: {error}", ("kind",)) from error


def nearest(name: str, known: Iterable[str]) -> str:
    """Return words that offer what was probably meant by `name`."""
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=3, cutoff=0.6)
    if close:  # the likest, but above all one with the same letters: swapped ones are common
        meant = max(close, key=lambda each: sorted(each) == sorted(name))
        return f"; did you mean {meant!r}?"
    return f"; known: {', '.join(names)}" if names else ""


def option_names(law: type, injected: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the names of a frozen law's options, without those in `injected`."""
    return tuple(
        field.name
        for field in dataclasses.fields(law)
        if field.init and field.name not in set(injected)
    )


def build(law: type, options: Mapping[str, Any], **injected: Any) -> Any:
    """Return ``law(**options, **injected)``, after checking the options.

    Raises
    ------
    BadOption
        Naming the option, and what it should have been.
    """
    known = option_names(law, injected)
    accepted = {name: _accepted(law, known, name, value) for name, value in options.items()}
    for field in dataclasses.fields(law):
        if field.name in known and field.name not in accepted and _is_required(field):
            raise BadOption("expected a value, got none", (field.name,))
    try:
        return law(**accepted, **injected)
    except (TypeError, ValueError) as error:
        raise blamed(error, known) from error


def blamed(error: Exception, known: Iterable[str]) -> BadOption:
    """Return `error` as a `BadOption` of the key its text begins with, if known.

    The constructors of laws name their argument first: ``R2 must be positive, got -1``.
    """
    text = str(error)
    first, _, rest = text.partition(" ")
    return BadOption(_expected(rest), (first,)) if first in set(known) else BadOption(text)


_MUST: Final = (
    ("must lie in ", "a number in "),
    ("must lie ", ""),
    ("must be positive and finite", "a finite number above 0"),
    ("must be positive", "a number above 0"),
    ("must be finite", "a finite number"),
    ("must be ", ""),
)


def _expected(text: str) -> str:
    """Return what a law says of its argument in the words of a configuration."""
    for said, told in _MUST:
        if text.startswith(said):
            return f"expected {told}{text.removeprefix(said)}"
    return text


def _within(name: str, group: Any, options: Any) -> Any:
    """Return the options of `group` that stand in the table `name`, within that of the law."""
    if not isinstance(options, Mapping):
        raise BadOption(f"expected a table, got {options!r}", (name,))
    try:
        return build(group, options)
    except BadOption as error:
        raise BadOption(error.text, (name, *error.path)) from error


def _is_required(field: dataclasses.Field[Any]) -> bool:
    return field.default is field.default_factory is dataclasses.MISSING


def _accepted(law: type, known: Iterable[str], name: str, value: Any) -> Any:
    """Return the option `name` of `law` when its type is right; a list becomes a tuple."""
    if name not in known:
        raise BadOption(f"unknown key{nearest(name, known)}", (name,))
    hint = get_type_hints(law)[name]
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return value if isinstance(value, hint) else _within(name, hint, value)
    given = tuple(value) if isinstance(value, list) and get_origin(hint) is tuple else value
    try:
        return TypeAdapter(hint, config={"arbitrary_types_allowed": True}).validate_python(
            given, strict=True
        )
    except ValidationError as error:
        message = error.errors()[0]["msg"].removeprefix("Input should be ")
        raise BadOption(f"expected {message}, got {value!r}", (name,)) from error
