"""The two rows at the top: who, in which state, how old; and the values now."""

from __future__ import annotations

import math

from rich.text import Text

from thermoctl.app.live import numbers
from thermoctl.app.live.look import Look, Role, printable
from thermoctl.app.live.model import View
from thermoctl.app.live.outlook import outlook
from thermoctl.app.live.rows import Part, fitted, parted
from thermoctl.signals import Alarm, Quality, State

ROOMY = 100
"""Width from which words are written out."""

_ON_RAMP_K = 0.005
"""A ramp this near its set point reads like it."""

_QUALITY_WORDS = {
    Quality.GOOD: "reading is no number",
    Quality.MISSING: "no sample",
    Quality.OPEN: "sensor open",
    Quality.SHORT: "sensor short",
    Quality.STALE: "old sample",
}


def _speed(view: View) -> str:
    """Return how fast simulated time goes; empty on a real plant."""
    if not view.facts.simulated:
        return ""
    if view.paused:
        return "SIM PAUSED"
    speed = view.facts.speed
    return "SIM max" if speed is None else f"SIM ×{speed:g}"


def _mode(view: View) -> str:
    """Return the mode, and the controller where it is the one that decides."""
    if view.step is None:
        return ""
    mode = view.step.mode.value
    return f"{mode} · {view.step.controller}" if view.steered else mode


def _age(view: View) -> str:
    return "no data yet" if math.isnan(view.age_s) else f"data {numbers.age(view.age_s)} old"


def _clock(view: View) -> str:
    return numbers.wall_time(view.facts.zero, view.now_s)


def _told(view: View, look: Look, width: int) -> Text | None:
    """Return the first row as a banner, when the state asks for one."""
    state = view.step.state if view.step else State.RUN
    words = []
    if state is State.LATCHED:
        words.append("■ LATCHED")
    elif state is State.SAFE:
        words.append("■ SAFE")
    if view.stale:
        since = numbers.wall_time(view.facts.zero, view.last_good_s)
        words.append("STALE" if since == numbers.UNKNOWN else f"STALE since {since}")
    if not words:
        return None
    bar = Role.RED_BAR if state in (State.LATCHED, State.SAFE) else Role.STALE_BAR
    if view.lost:
        words.append("daemon gone · heater not known")
    else:
        words.append(_heater(view.accepted_power))
    left = "   ".join(filter(None, (view.facts.loop, _speed(view), " · ".join(words))))
    right = f"{_age(view)}   {_clock(view)}"
    if len(left) + len(right) >= width:
        right = _clock(view)  # since when is said already
    return parted(look, [(left, bar)], [(right, bar)], width, ground=bar)


def _heater(power: float) -> str:
    """Return what the heater does, or the cooler; NaN is nothing that was taken."""
    if power < 0.0:
        return f"cooler {numbers.power(-power)}"
    return f"heater {numbers.power(power)}" if power > 0.0 else "heater off"


def state_row(view: View, look: Look, width: int) -> Text:
    """Return the first row; inverted when stale, red when latched or safe."""
    told = _told(view, look, width)
    if told is not None:
        return told
    left: list[Part] = [("thermoctl ", Role.MUTE), (view.facts.loop, Role.STRONG)]
    if view.facts.simulated:
        left += [("   ", Role.PAGE), (f" {_speed(view)} ", Role.CHIP)]
    if view.step is None:
        left += [("   waiting for the first sample", Role.TEXT)]
    else:
        left += [
            ("   ", Role.PAGE),
            (view.step.state.value.upper(), Role.STRONG),
            (f" {_mode(view)}", Role.TEXT),
        ]
    right = [(_age(view), Role.MUTE), ("   ", Role.PAGE), (_clock(view), Role.STRONG)]
    if sum(len(string) for string, _ in (*left, *right)) >= width:
        left = left[1:]  # who made it is the first to go
    return parted(look, left, right, width)


def _worst(alarms: tuple[Alarm, ...], *, latched: bool) -> Alarm | None:
    asked = [alarm for alarm in alarms if (alarm.latched if latched else alarm.active)]
    return min(asked, key=lambda alarm: (alarm.priority, alarm.since_s), default=None)


def why(view: View, look: Look, room: int) -> str:
    """Return why the heater is off and what is awaited; empty if obvious.

    In little room the cause is cut, and what is awaited stays.
    """
    step = view.step
    if step is None or step.state not in (State.LATCHED, State.SAFE):
        return ""
    latched = step.state is State.LATCHED
    alarm = _worst(step.alarms, latched=latched)
    cause = numbers.sentence(f"{alarm.code}: {alarm.text}" if alarm else step.command.reason)
    cause = printable(cause, utf8=look.utf8)  # before it is cut: ASCII is longer
    waits = " · a acknowledges" if latched else " · returns by itself after good data"
    if len(cause) + len(waits) > room:
        cause = f"{cause[: max(0, room - len(waits) - 1)]}…"
    return f"{cause}{waits}"


def _alarms(view: View, width: int) -> list[Part]:
    """Return what the right end of the second row says of alarms."""
    acknowledge = "acknowledge" if width >= ROOMY else "ack"
    alarms = view.step.alarms if view.step else ()
    active = [alarm for alarm in alarms if alarm.active]
    if active:
        urgent = min(alarm.priority for alarm in active) <= 1
        sign = ("■ ", Role.RED) if urgent else ("▲ ", Role.AMBER)
        return [sign, (f"{len(active)} active", Role.TEXT)]
    waiting = sum(not alarm.acknowledged for alarm in alarms)
    return [("△ ", Role.AMBER), (f"{waiting} to {acknowledge}", Role.TEXT)] if waiting else []


def values_row(view: View, look: Look, width: int) -> Text:
    """Return the second row: the values now, or why the heater is off."""
    value = printable(numbers.temperature(view.temperature_c), utf8=look.utf8)
    reason = why(view, look, width - len(value) - len("  ■ "))
    if reason:
        role = Role.MUTE if view.stale else Role.STRONG
        return fitted(look.text((value, role), ("  ■ ", Role.RED), (reason, Role.RED)), width)
    step = view.step
    if step is None:
        return fitted(look.text((f"{numbers.UNKNOWN} no sample yet", Role.MUTE)), width)
    value_c = view.temperature_c
    if math.isnan(value_c):
        words = _QUALITY_WORDS[step.measurement.quality]
        left: list[Part] = [(numbers.UNKNOWN, Role.STRONG), (f" {words}", Role.TEXT)]
    else:
        # A value that is old is quiet: it is not what the water has now.
        role = Role.MUTE if view.stale else Role.STRONG
        change = f"  {numbers.difference(view.deviation_k):>8}"
        left = [(value, role), (change, Role.TEXT)]
    left += [("    set ", Role.MUTE), (numbers.temperature(view.setpoint_c), Role.STRONG)]
    if abs(view.followed_c - view.setpoint_c) >= _ON_RAMP_K:
        left += [(" ramp at ", Role.MUTE), (numbers.temperature(view.followed_c), Role.TEXT)]
    left += [("    power ", Role.MUTE)]
    if math.isnan(view.accepted_power):
        left += [(numbers.UNKNOWN, Role.STRONG), (" nothing accepted", Role.TEXT)]
    else:
        left += [(numbers.power(view.accepted_power), Role.STRONG)]
    right = _alarms(view, width)
    left += _outlook(view, look, width - len(look.text(*left, *right)))
    return parted(look, left, right, width)


def _outlook(view: View, look: Look, room: int) -> list[Part]:
    """Return what is to come of the set point, if there is room: an alarm comes first."""
    for parts in outlook(view):
        if len(look.text(*parts)) < room:
            return parts
    return []


def one_line(view: View, look: Look, width: int) -> Text:
    """Return all that a terminal too small for the charts gets.

    The way out stands at the right and is the last to go; a question that is open comes first.
    """
    step, leave = view.step, "  q quits"
    room = width - len(leave) if width > 2 * len(leave) else width
    if view.prompt:
        words = [view.prompt]
    elif step is None:
        words = ["waiting for the first sample"]
    else:
        words = [_clock(view), f"{step.state.value.upper()} {step.mode.value}"]
        words += ["PAUSED"] if view.paused else []
        words += ["STALE"] if view.stale else []
        words += ["daemon gone"] if view.lost else []
        words += [numbers.temperature(view.temperature_c)]
        used = len("  ".join(words)) + 2
        reason = why(view, look, room - used)
        words += [reason] if reason else _steered_values(view)
    left = look.text(("  ".join(words), Role.TEXT))
    if room == width:
        return fitted(left, width)
    left.truncate(room, overflow="ellipsis" if look.utf8 else "crop", pad=True)
    left.append_text(look.text((leave, Role.MUTE)))
    return fitted(left, width)


def _steered_values(view: View) -> list[str]:
    """Return the deviation, the set point and the power, as words."""
    return [
        numbers.difference(view.deviation_k),
        f"set {numbers.temperature(view.setpoint_c)}",
        numbers.power(view.accepted_power),
    ]
