"""What an event says to a person, and which mark it wears."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
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
    """An event as it is shown."""

    t_s: float
    name: str
    text: str
    mark: Mark


# Richest template first; the first one whose fields are all there is used. Units come with the
# fields: see `thermoctl.app.live.numbers.quantity`.
_SENTENCES: Mapping[str, tuple[Mark, tuple[str, ...]]] = {
    "loop.started": (Mark.NONE, ("Loop started at {temperature_c}", "Loop started")),
    "loop.stopped": (Mark.NONE, ("Loop stopped, heater off",)),
    "mode.changed": (Mark.NONE, ("Mode {mode}, was {before}", "Mode {mode}", "Mode changed")),
    "setpoint.changed": (
        Mark.NONE,
        ("Set point {setpoint_c}, was {before_c}", "Set point {setpoint_c}", "Set point {value_c}"),
    ),
    "state.changed": (
        Mark.NONE,
        ("State {state}, was {before}: {reason}", "State {state}: {reason}", "State {state}"),
    ),
    "sensor.open": (Mark.WARNING, ("Sensor open: broken wire or loose plug",)),
    "sensor.short": (Mark.WARNING, ("Sensor short-circuited",)),
    "sensor.missing": (Mark.WARNING, ("No sample from the sensor",)),
    "sensor.stale": (Mark.WARNING, ("Sensor value is old: {age_s}", "Sensor value is old")),
    "sensor.frozen": (Mark.WARNING, ("Sensor value stands still",)),
    "sensor.spike": (
        Mark.WARNING,
        ("One reading out of line, {temperature_c}, ignored", "One reading out of line, ignored"),
    ),
    "sensor.recovered": (Mark.NONE, ("Sensor is back",)),
    "trip.over_temperature": (
        Mark.ALARM,
        ("Too hot: {temperature_c}, heater off above {limit_c}", "Too hot: heater off"),
    ),
    "trip.under_temperature": (
        Mark.ALARM,
        ("Too cold: {temperature_c}, heater off below {limit_c}", "Too cold: heater off"),
    ),
    "alarm.acknowledged": (Mark.NONE, ("Acknowledged: {code}", "Alarms acknowledged")),
    "alarm.deviation": (Mark.WARNING, ("Deviation beyond {limit_k}", "Deviation beyond the limit")),
    "latch.cleared": (Mark.NONE, ("Latch cleared: {code}", "Latch cleared")),
    "estimator.reset": (Mark.WARNING, ("Estimator back to its last good belief",)),
    "estimator.rejected": (Mark.NONE, ("Estimator refused a sample",)),
    "learning.paused": (Mark.NONE, ("Learning paused: nothing to learn",)),
    "learning.resumed": (Mark.NONE, ("Learning again",)),
    "controller.failed": (
        Mark.ALARM,
        ("Controller failed, heater off: {error}", "Controller failed, heater off"),
    ),
    "control.settled": (
        Mark.NONE,
        ("Settled: {setpoint_c}, overshoot {overshoot_k}", "Settled at the set point"),
    ),
    "control.recovered": (Mark.NONE, ("Back within {band_k} after {after_s}", "Back at set point")),
    "change.detected": (Mark.CHANGE, ("{text}", "The water has jumped")),
    "output.nan": (Mark.WARNING, ("The law gave no number: power 0",)),
    "output.refused": (Mark.WARNING, ("The board refused the power: {error}", "Power refused")),
    "output.readback": (Mark.WARNING, ("Power read back differs from the command",)),
    "board.opened": (Mark.NONE, ("Board answers: {board}", "Board answers")),
    "board.lost": (Mark.WARNING, ("Board does not answer: {error}", "Board does not answer")),
    "board.retry": (Mark.NONE, ("Asked the board again", "Asked the board again")),
    "board.wrong": (Mark.ALARM, ("Another device answers: {error}", "Another device answers")),
    "cycle.late": (Mark.NONE, ("Woke late by {late_s}", "Woke late")),
    "cycle.missed": (Mark.WARNING, ("Cycles missed: {missed}", "A cycle was missed")),
    "cycle.failed": (Mark.ALARM, ("Cycle failed, heater off: {error}", "Cycle failed, heater off")),
    "history.set_aside": (Mark.WARNING, ("History was damaged, a new one is begun",)),
    "history.drops": (Mark.WARNING, ("History left out samples: {dropped}", "History drops")),
    "clock.stepped": (Mark.NONE, ("Wall clock stepped by {step_s}", "Wall clock stepped")),
    "config.loaded": (Mark.NONE, ("Settings loaded: {path}", "Settings loaded")),
    "sim.disturbed": (Mark.NONE, ("{text}", "Disturbed")),
}

_STATE_MARKS = {
    "safe": Mark.ALARM,
    "latched": Mark.ALARM,
    "ride": Mark.WARNING,
    "hold": Mark.WARNING,
}


def _described(event: Event, fields: Mapping[str, str]) -> str:
    """Return words for an event no sentence is known for."""
    head = event.name.replace("_", " ").replace(".", ": ", 1).replace(".", " ")
    tail = ", ".join(f"{name} {value}" for name, value in fields.items())
    words = f"{head} ({tail})" if tail else head
    return words[:1].upper() + words[1:]


def sentence(event: Event) -> Sentence:
    """Return `event` as a person reads it; an unknown name is spelt out with its fields."""
    fields = {name: quantity(name, value) for name, value in event.fields.items()}
    mark, templates = _SENTENCES.get(event.name, (Mark.NONE, ()))
    if event.name == "state.changed":
        mark = _STATE_MARKS.get(fields.get("state", ""), mark)
    for template in templates:
        try:
            return Sentence(event.t_s, event.name, template.format_map(fields), mark)
        except KeyError:
            continue
    return Sentence(event.t_s, event.name, _described(event, fields), mark)
