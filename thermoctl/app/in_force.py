"""A configuration with the options of its laws written out, defaults included."""

from __future__ import annotations

import dataclasses
from typing import Any

from thermoctl.app import plugins
from thermoctl.app.catalogue import INJECTED
from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.parts import plan_for
from thermoctl.app.settings import Settings


def in_force(settings: Settings) -> dict[str, Any]:
    """Return every key with its value, options of laws too, as `load` takes it.

    An option is what the law was built with: where a loop's table decides it, that is its value.
    So is the gain of a model what follows from watts and litres.
    """
    content = settings.in_force()
    for name, table in settings.loops.items():
        for key, law in _laws(table).items():
            content["loops"][name][key] |= _options(law)
        content["loops"][name]["model"]["gain_k_per_s"] = table.gain_k_per_s
        if "jump_k" not in table.model_fields_set:
            del content["loops"][name]["jump_k"]  # written down, it would no longer widen by itself
    return content


def _laws(table: LoopTable) -> dict[str, Any]:
    """Return the laws of a loop by the key of their table, built as the loop builds them."""
    plan, chosen = plan_for(table), table.estimator
    estimator = plugins.build(plugins.find(plugins.ESTIMATORS, chosen.kind), chosen.options)
    laws = {"controller": plan.controller, "shadow": plan.shadow, "estimator": estimator}
    return {key: law for key, law in laws.items() if law is not None}


def _options(law: Any) -> dict[str, Any]:
    """Return what `law` was built with, as far as a configuration can say it."""
    options: dict[str, Any] = {}
    for name in plugins.option_names(type(law), INJECTED):
        value = getattr(law, name)
        if dataclasses.is_dataclass(value):
            options[name] = _options(value)
        elif _is_plain(value):
            options[name] = list(value) if isinstance(value, tuple) else value
    return options


def _is_plain(value: Any) -> bool:
    """Return whether `value` is text, a number, true, false or a list of such."""
    if isinstance(value, tuple):
        return all(map(_is_plain, value))
    return isinstance(value, bool | int | float | str)
