"""A run as one summary, and as the lines a person reads when it has ended."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any

from thermoctl.app.cycle_record import finite
from thermoctl.app.live import numbers
from thermoctl.signals import TRUE_TEMPERATURE, Cycle, State, Step
from thermoctl.studies.words import duration

SETTLED_K = 0.1
SETTLED_FOR_S = 60.0
_UNSEEN_MAX = 5
"""Readings in a row that may be missing, before nobody can say that the temperature stayed."""


class Summary:
    """Figures of the first loop's run, and how each loop ended, in bounded memory.

    Judged on the true temperature where a simulation knows it. The set point is reached at the
    first moment from which the temperature stays within 0.1 K of it for a minute; deviations count
    from there on. The loop has settled at the one from which it stays there to the end of the run,
    a minute at least, and is seen to: where readings stop it has not. A new set point begins anew.
    """

    def __init__(self) -> None:
        self._wall_s = time.monotonic()
        self._first: Cycle | None = None
        self._last: Cycle | None = None
        self._steps = 0
        self._temperature_c = math.nan
        self._travel = 0.0
        self._power: float | None = None
        self._ended: dict[str, Step] = {}
        self._begin(0.0)

    def _begin(self, t_s: float) -> None:
        self._start_s = t_s
        self._rising: bool | None = None
        self._overshoot_k = 0.0
        self._within_since_s: float | None = None
        self._stays_since_s: float | None = None
        self._seen_s = t_s
        self._unseen = 0
        self._reached_s: float | None = None
        self._squares = self._largest_k = 0.0
        self._counted = 0

    def add(self, cycle: Cycle) -> None:
        """Take one finished cycle; of any but the first loop only how it ends counts."""
        step = self._ended[cycle.loop] = cycle.step
        if self._first is None:
            self._first = cycle
        elif cycle.loop != self._first.loop:
            return
        if self._last is None or step.setpoint_c != self._last.step.setpoint_c:
            self._begin(step.t_s)
        self._last = cycle
        self._steps += 1
        if math.isfinite(cycle.accepted_power):
            if self._power is not None:
                self._travel += abs(cycle.accepted_power - self._power)
            self._power = cycle.accepted_power
        temperature_c = cycle.truth.get(TRUE_TEMPERATURE, step.measurement.temperature_c)
        if math.isfinite(temperature_c):
            self._temperature_c = temperature_c
            self._judge(temperature_c - step.setpoint_c, step.t_s)
            return
        self._unseen += 1
        if self._unseen > _UNSEEN_MAX:
            self._stays_since_s = None

    def _judge(self, deviation_k: float, t_s: float) -> None:
        self._seen_s, self._unseen = t_s, 0
        if self._rising is None:
            self._rising = deviation_k < 0.0
        self._overshoot_k = max(self._overshoot_k, deviation_k if self._rising else -deviation_k)
        if abs(deviation_k) > SETTLED_K:
            self._within_since_s = self._stays_since_s = None
        else:
            self._within_since_s = t_s if self._within_since_s is None else self._within_since_s
            self._stays_since_s = t_s if self._stays_since_s is None else self._stays_since_s
        if self._reached_s is None:
            self._reached_s = self._settled_s(self._within_since_s)
            return
        self._squares += deviation_k**2
        self._largest_k = max(self._largest_k, abs(deviation_k))
        self._counted += 1

    def _settled_s(self, since_s: float | None) -> float | None:
        """Return how long after the set point was given it came to stay, if from `since_s` on."""
        if since_s is None or self._seen_s - since_s < SETTLED_FOR_S:
            return None
        return since_s - self._start_s

    def as_dict(self) -> dict[str, Any]:
        """Return the figures; None for what has not happened."""
        first, last = self._first, self._last
        duration_s = last.step.t_s - first.step.t_s if first and last else 0.0
        reached = self._counted > 0
        return {
            "duration_s": round(duration_s, 3),
            "steps": self._steps,
            "missed": last.missed if last else 0,
            "overshoot_k": round(self._overshoot_k, 4),
            "settled_s": self._reached_s,
            "settled_for_good_s": self._settled_s(self._stays_since_s),
            "deviation_mk": round(1e3 * math.sqrt(self._squares / self._counted), 2)
            if reached
            else None,
            "max_deviation_mk": round(1e3 * self._largest_k, 2) if reached else None,
            "travel_per_min": round(60.0 * self._travel / duration_s, 3) if duration_s else None,
            "final_temperature_c": finite(self._temperature_c),
            "latched": any(step.state is State.LATCHED for step in self._ended.values()),
            "ended": {name: _end(step) for name, step in self._ended.items()},
            "wall_s": round(time.monotonic() - self._wall_s, 3),
        }


def _end(step: Step) -> dict[str, Any]:
    """Return how a loop was left."""
    alarms = [alarm.code for alarm in step.alarms]
    return {"mode": step.mode.value, "state": step.state.value, "alarms": alarms}


def off_lines(figures: Mapping[str, Any]) -> list[str]:
    """Return a line for each loop that a fault had switched off when the run ended."""
    until = {
        State.LATCHED.value: "off until acknowledged",
        State.SAFE.value: "off until readings are good",
    }
    return [
        f"{name} ended {end['state'].upper()}, {until[end['state']]}: {', '.join(end['alarms'])}"
        for name, end in figures["ended"].items()
        if end["state"] in until
    ]


def closing_lines(figures: Mapping[str, Any]) -> list[str]:
    """Return what a person wants to know of a run that has ended, line by line.

    Parameters
    ----------
    figures : mapping
        As `Summary.as_dict` gives them.
    """
    steps = figures["steps"]
    if not steps:
        return ["Ran       no cycle was finished"]
    took = f"{duration(figures['duration_s'])} simulated in {duration(figures['wall_s'])}"
    missed = f", {figures['missed']:,} missed" if figures["missed"] else ""
    final = numbers.temperature(figures["final_temperature_c"])
    moved = numbers.number(figures["travel_per_min"], 1)
    overshoot = f"overshoot {numbers.difference(figures['overshoot_k']).lstrip('+')}"
    return [
        f"Ran       {took}, {steps:,} cycles{missed}",
        f"Settled   {_settled(figures)}, {overshoot}",
        f"Held      {_held(figures)}",
        f"Ended at  {final}; power moved {moved} full ranges a minute",
        *(f"Off       {line}" for line in off_lines(figures)),
    ]


def _settled(figures: Mapping[str, Any]) -> str:
    """Return when the set point in force was reached, and from when on it was kept."""
    reached_s, settled_s = figures["settled_s"], figures["settled_for_good_s"]
    if reached_s is None:
        return f"never: not within ±{SETTLED_K:g} K of the set point for {SETTLED_FOR_S:g} s"
    settled = "never" if settled_s is None else f"after {duration(settled_s)}"
    if settled_s == reached_s:
        return settled
    return f"{settled}; first there after {duration(reached_s)}"


def _held(figures: Mapping[str, Any]) -> str:
    """Return how well it held once it had been reached."""
    if figures["deviation_mk"] is None:
        return "not judged before it was reached"
    deviation, largest = (
        numbers.difference(1e-3 * figures[name]).lstrip("+")
        for name in ("deviation_mk", "max_deviation_mk")
    )
    return f"the set point with an rms deviation of {deviation}, at most {largest}"
