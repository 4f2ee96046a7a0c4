"""A configuration tried out: everything about it that is wrong, told at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from thermoctl.app.compose import wiring_errors
from thermoctl.app.configuration.document import BadConfiguration, Problem, read_document
from thermoctl.app.settings import Settings, settings_in

_REST: Final = "how loops and boards go together is checked once this is mended"


def runnable(files: Sequence[Path]) -> Settings:
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
