"""What an event says to a person, and which mark it wears."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

from thermoctl.app.live.numbers import quantity
from thermoctl.signals import Event


class Mark(Enum):
    """How much an event matters; the value is its sign."""

    NONE = " "
    WARNING = "△"
    ALARM = "■"
    CHANGE = "◆"


@dataclass(frozen=True, slots=True)
class Sentence:
    """An event as it is shown; or several `steps` of one change, the oldest `first`."""

    t_s: float
    name: str
    text: str
    mark: Mark
    first: Event | None = None
    steps: int = 1


# Richest template first; the first one whose fields are all there is used. Units come with the
# fields: see `thermoctl.app.live.numbers.quantity`.
_SENTENCES: Mapping[str, tuple[Mark, tuple[str, ...]]] = {
    "alarm.acknowledged": (Mark.NONE, ("Acknowledged: {code}", "Alarms acknowledged")),
    "board.lost": (Mark.WARNING, ("Board {board} is lost: {error}", "Board is lost")),
    "board.opened": (Mark.NONE, ("Board {board} answers: {kind} {version}", "Board answers")),
    "board.retry": (Mark.NONE, ("Board {board} asked again", "Board asked again")),
    "board.silent": (Mark.WARNING, ("Board {board} is silent: {error}", "Board is silent")),
    "board.wrong": (Mark.ALARM, ("Not board {board}: {error}", "Another device answers")),
    "clock.stepped": (Mark.NONE, ("Wall clock stepped by {step_s}", "Wall clock stepped")),
    "config.coarse": (Mark.WARNING, ("Coarse readings: {text}", "Readings are coarse")),
    "config.narrow": (Mark.WARNING, ("Near a trip: {text}", "Set point near a trip")),
    "config.loaded": (Mark.NONE, ("Settings loaded: {path}", "Settings loaded")),
    "config.unstated": (Mark.WARNING, ("Litres not told: {text}", "Litres not told")),
    "controller.changed": (
        Mark.NONE,
        ("Controller {after}, was {before}", "Controller changed"),
    ),
    "controller.failed": (
        Mark.ALARM,
        ("Controller failed: {text}", "Controller failed, heater off"),
    ),
    "cycle.failed": (Mark.ALARM, ("Cycle failed, heater off: {error}", "Cycle failed, heater off")),
    "cycle.late": (Mark.NONE, ("Woke {late_s} late", "Woke late")),
    "cycle.missed": (Mark.WARNING, ("Cycles missed: {cycles}, in all {total}", "Cycles missed")),
    "estimator.rejected": (Mark.NONE, ("Estimator refused a sample",)),
    "estimator.reset": (Mark.WARNING, ("Back to the last good belief",)),
    "heater.answered": (Mark.NONE, ("The heater answers: {text}", "The heater answers")),
    "heater.no_response": (
        Mark.ALARM,
        ("Heater without effect: {text}", "Heater without effect, off"),
    ),
    "heater.questioned": (Mark.WARNING, ("Heater in doubt: {text}", "Heater in doubt, cut")),
    "heater.reversed": (Mark.ALARM, ("Power cools: {text}", "Power cools, heater off")),
    "heater.stuck_on": (Mark.ALARM, ("Heats without power: {text}", "Heats without power")),
    "history.drops": (Mark.WARNING, ("History leaves samples out",)),
    "history.set_aside": (Mark.WARNING, ("Damaged history set aside, a new one begun",)),
    "loop.started": (Mark.NONE, ("Loop started at {temperature_c}", "Loop started")),
    "loop.stopped": (Mark.NONE, ("Loop stopped, heater off",)),
    "mode.changed": (Mark.NONE, ("Mode {after}, was {before}", "Mode changed")),
    "output.changed": (
        Mark.NONE,
        ("Power {after_power} by hand, was {before_power}", "Power by hand changed"),
    ),
    "output.in_order": (Mark.NONE, ("Output in order after {after_s}", "Output in order again")),
    "output.nan": (Mark.WARNING, ("No number from {controller}: power 0", "No number: power 0")),
    "output.readback": (Mark.WARNING, ("Output differs: {text}", "Output differs from command")),
    "output.refused": (Mark.WARNING, ("Output refused: {text}", "Output refused")),
    "plant.changed": (Mark.CHANGE, ("{text}", "The plant has changed")),
    "plant.drift": (Mark.WARNING, ("{text}", "The plant has drifted")),
    "plant.driven": (Mark.WARNING, ("Driven by something else: {text}", "Something else heats")),
    "request.refused": (Mark.WARNING, ("Refused: {why}", "Request refused")),
    "sensor.missing": (Mark.WARNING, ("No sample: {text}", "No sample from the sensor")),
    "sensor.open": (Mark.WARNING, ("Sensor open: {text}", "Sensor open")),
    "sensor.short": (Mark.WARNING, ("Sensor shorted: {text}", "Sensor shorted")),
    "sensor.spike": (
        Mark.WARNING,
        ("One bad reading, {temperature_c}, ignored", "One bad reading"),
    ),
    "sensor.stale": (Mark.WARNING, ("Old sample: {text}", "Old sample")),
    "setpoint.unreachable": (
        Mark.WARNING,
        ("Set point out of reach: {text}", "Set point out of reach"),
    ),
    "setpoint.changed": (Mark.NONE, ("Set point {after_c}, was {before_c}", "Set point changed")),
    "setpoint.resumed": (
        Mark.NONE,
        ("Set point {setpoint_c} as before, {configured_c} is configured", "Set point as before"),
    ),
    "shadow.failed": (
        Mark.WARNING,
        ("Shadow {controller} failed and was dropped: {text}", "Shadow failed and was dropped"),
    ),
    "sim.disturbed": (Mark.NONE, ("{text}", "Plant disturbed")),
    "state.changed": (
        Mark.NONE,
        ("State {after}, was {before}: {why}", "State {after}, was {before}", "State changed"),
    ),
    "trip.over_temperature": (Mark.ALARM, ("Too hot: {text}", "Too hot, heater off")),
    "trip.under_temperature": (Mark.ALARM, ("Too cold: {text}", "Too cold, heater off")),
}

_STATE_MARKS = {
    "safe": Mark.ALARM,
    "latched": Mark.ALARM,
    "ride": Mark.WARNING,
    "hold": Mark.WARNING,
}


STEPWISE = frozenset({"setpoint.changed", "output.changed"})
"""What is changed in steps, by a key that is held down for instance."""

TOGETHER_S = 30.0
"""Steps that are no farther apart are one change."""

_BEFORE = "before"
_PLAIN_WORDS = frozenset({"text", "why", "error"})


def _described(event: Event, fields: Mapping[str, str]) -> str:
    """Return words for an event no sentence is known for."""
    head = event.name.replace("_", " ").replace(".", " ")
    tail = ", ".join(
        value if name in _PLAIN_WORDS else f"{name} {value}" for name, value in fields.items()
    )
    words = f"{head}: {tail}" if tail else head
    return words[:1].upper() + words[1:]


def sentence(event: Event) -> Sentence:
    """Return `event` as a person reads it; an unknown one with its fields."""
    fields = {name: quantity(name, value) for name, value in event.fields.items()}
    unlisted = Mark.WARNING if event.name.startswith("alarm.") else Mark.NONE
    mark, templates = _SENTENCES.get(event.name, (unlisted, ()))
    if event.name == "state.changed":
        mark = _STATE_MARKS.get(fields.get("after", ""), mark)
    elif event.name == "plant.drift" and event.fields.get("active") is False:
        mark, templates = Mark.NONE, ("No longer: {text}", "The plant is as it was")
    for template in templates:
        try:
            words = template.format_map(fields)
            return Sentence(event.t_s, event.name, words[:1].upper() + words[1:], mark, event)
        except KeyError:
            continue
    return Sentence(event.t_s, event.name, _described(event, fields), mark, event)


def continued(last: Sentence, event: Event) -> Sentence | None:
    """Return `last` and `event` as one change, None where they are two.

    It comes from where the first step began, and the journal has every one of them.
    """
    near = event.t_s - last.t_s <= TOGETHER_S
    first, steps = last.first, last.steps + 1
    if event.name not in STEPWISE or event.name != last.name or not near or first is None:
        return None
    began = {key: value for key, value in first.fields.items() if key.startswith(_BEFORE)}
    whole = sentence(Event(event.t_s, event.name, {**event.fields, **began}))
    return replace(whole, text=f"{whole.text}, in {steps} steps", first=first, steps=steps)
