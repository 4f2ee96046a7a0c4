"""Whether the set point can be held, with which power, and when it is reached."""

from __future__ import annotations

import math

from thermoctl.app.live import numbers
from thermoctl.app.live.look import Role
from thermoctl.app.live.model import View, to_hold
from thermoctl.app.live.rows import Part
from thermoctl.signals import Mode, Step

UNREACHABLE = "setpoint.unreachable"
_VAGUE = 0.1
"""A power whose two standard deviations are a larger share of all there is waits in the panel."""


def outlook(view: View) -> list[list[Part]]:
    """Return ways to say it, the richest first; none while nobody knows."""
    step = view.step
    if step is None or step.mode is Mode.OFF:
        return []
    if any(alarm.code == UNREACHABLE and alarm.active for alarm in step.alarms):
        return [[(f" · {words}", Role.AMBER)] for words in _out_of_reach(step)]
    power, sd = to_hold(step, view.insight)
    percent = numbers.plus_minus(100.0 * power, 200.0 * sd, 0)
    vague = numbers.UNKNOWN in percent or 2.0 * sd > _VAGUE
    held: list[Part] = [] if vague else [(numbers.with_unit(percent, "%"), Role.BLUE)]
    when = _arrival(view)
    if not when:
        return [[(" · holds with ", Role.MUTE), *held]] if held else []
    arrives: list[Part] = [(" · arrives ", Role.MUTE), (when, Role.BLUE)]
    return [[(" · needs ", Role.MUTE), *held, *arrives], arrives] if held else [arrives]


def _out_of_reach(step: Step) -> list[str]:
    """Return ways to say what can be held instead; in little room only that, without its error."""
    highest_c, sd_k = step.feasible.highest_c, step.feasible.highest_sd_k
    most = numbers.plus_minus(highest_c, 2.0 * sd_k, 1)
    if numbers.UNKNOWN in most:
        return ["out of reach"]
    side = "least" if step.setpoint_c < step.measurement.temperature_c else "most"
    told = f"at {side} {numbers.with_unit(most, '°C')}"
    short = f"at {side} {numbers.with_unit(numbers.number(highest_c, 1), '°C')}"
    return [f"out of reach: {told}", told, short, "out of reach"]


def _arrival(view: View) -> str:
    """Return when the set point is reached, such as ``14:26 ± 2 min``; empty when it is, or not."""
    if view.step is None or not 0.0 < view.step.feasible.arrival_s < math.inf:
        return ""
    feasible = view.step.feasible
    at = numbers.wall_time(view.facts.zero, view.step.t_s + feasible.arrival_s, "%H:%M")
    minutes = 2.0 * feasible.arrival_sd_s / 60.0
    if at == numbers.UNKNOWN or not math.isfinite(minutes):
        return ""
    return f"{at} ± {numbers.with_unit(numbers.number(max(1.0, minutes), 0), 'min')}"
