"""What outlives a restart of what controllers and the heater check have learnt.

A model that cannot be taken up costs nothing but itself: its law begins with nothing, as the first
time, and an event says why.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, Final

from thermoctl.ports import Remembered
from thermoctl.regulator.guard import Failure, attempt
from thermoctl.regulator.heater import memory as heater_memory
from thermoctl.regulator.heater.response import Gain
from thermoctl.regulator.heater.sides import Named, Watch, named
from thermoctl.regulator.mind import Mind
from thermoctl.regulator.supervisor import Emit

NOTHING: Final[Mapping[str, Remembered]] = MappingProxyType({})
"""What is remembered at a first start."""

Models = Mapping[str, Mapping[str, Any]]


def recall(minds: Iterable[Mind | None], remembered: Mapping[str, Remembered], emit: Emit) -> None:
    """Let each of `minds` begin with what is remembered of its law."""
    for mind in minds:
        kept = None if mind is None else remembered.get(mind.name)
        if mind is None or kept is None:
            continue
        begun = attempt(mind.recall, kept)
        if isinstance(begun, Failure):
            emit("model.ignored", controller=mind.name, why=begun.text)
        elif begun:
            emit("model.recalled", controller=mind.name, age_s=round(kept.age_s))


def recall_heater(watch: Watch | None, remembered: Mapping[str, Remembered], emit: Emit) -> None:
    """Let the `watch` over a heater, or two, begin with what is remembered."""
    for name, each in named(watch).items():
        kept = remembered.get(name)
        if kept is None:
            continue
        try:
            each.recall(heater_memory.recall(kept.model))
        except ValueError as error:
            emit("model.ignored", controller=name, why=str(error))


def origin(mind: Mind) -> str | None:
    """Return how the model of `mind` began; None of a law without a memory."""
    if mind.remembers is None:
        return None
    told = attempt(mind.remembers.origin, mind.belief)
    return told if isinstance(told, str) else None


def remembering(minds: Sequence[Mind | None], watches: Named) -> Callable[[], Models]:
    """Return a function that says what `minds` and `watches` would like kept now."""
    beliefs, heaters = [], {}
    for mind in minds:
        beliefs.append(None if mind is None else mind.belief)
    for name, each in watches.items():
        heaters[name] = each.known
    return partial(_remembered, minds, beliefs, heaters)


def _remembered(
    minds: Sequence[Mind | None], beliefs: Sequence[Any], heaters: Mapping[str, Gain | None]
) -> Models:
    """Return what each law makes of its belief, nothing of one that fails; and the heaters."""
    models: dict[str, Mapping[str, Any]] = {}
    for mind, belief in zip(minds, beliefs, strict=True):
        if mind is None or mind.remembers is None:
            continue
        told = attempt(mind.remembers.remember, belief)
        if told is not None and not isinstance(told, Failure):
            models[mind.name] = told
    for name, heater in heaters.items():
        if heater is not None:
            models[name] = heater_memory.remember(heater)
    return models
