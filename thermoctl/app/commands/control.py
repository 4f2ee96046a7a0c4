"""Verbs for a running daemon: ``status``, ``get``, ``set``, ``mode`` and others.

Each is one call through the control socket; the daemon decides, and the words it refuses with are
shown as they come.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from string import ascii_letters
from typing import Any, Final

import click

from thermoctl.app.commands.completion import MODES, keys, laws, modes, shadows
from thermoctl.app.commands.endings import EXIT_ALARM, EXIT_FAILED
from thermoctl.app.commands.options import (
    Duration,
    Parsed,
    examples,
    json_option,
    loop_option,
    socket_option,
)
from thermoctl.app.configuration.units import celsius
from thermoctl.app.daemon.insight_words import insight_lines
from thermoctl.app.live import numbers
from thermoctl.app.live.score import shadow_words
from thermoctl.errors import Refused
from thermoctl.services.control_client import ControlClient
from thermoctl.signals import ShadowScore

_LATE_PERIODS: Final = 3.0
_LATE_S: Final = 3.0
_MINUTE_S: Final = 60.0
_SAME_K: Final = 0.005  # closer than two decimals show
_OVER_S: Final = 1.0  # a load of 0 ends the one before, however long it lasts itself
_MINUTES: Final = {"min": 1.0, "h": 60.0}


def _temperature(text: str) -> float:
    """Return a temperature in degC, written ``65``, ``65C`` or ``149F``; else ``ValueError``."""
    digits = text.rstrip("°" + ascii_letters)
    try:
        value_c = celsius(float(digits), text[len(digits) :])
    except ValueError:
        value_c = math.nan
    if not math.isfinite(value_c):
        raise ValueError(f"expected a temperature in degC such as 65.0, 65C or 149F, got {text!r}")
    return value_c


def _power(text: str) -> float:
    """Return a power in [-1, 1], written ``30%`` or ``0.3``; ``ValueError`` if it is none.

    Which of them a loop takes, its regulator says.
    """
    percent = text.strip().endswith("%")
    try:
        power = float(text.strip().removesuffix("%")) / (100.0 if percent else 1.0)
    except ValueError:
        power = math.nan
    if not -1.0 <= power <= 1.0:
        raise ValueError(f"expected a power such as 30% or 0.3, from -1 to 1, got {text!r}")
    return power


def _mode(text: str) -> str:
    """Return the name of a mode that may be asked for; ``ValueError`` if it is none."""
    if text not in MODES:
        raise ValueError(f"expected one of {', '.join(MODES)}, got {text!r}")
    return text


def _rate(text: str) -> float:
    """Return a rate in K/min, written ``2/min``, ``2K/min`` or ``30/h``; else ``ValueError``."""
    match = re.fullmatch(
        r"\s*((?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)\s*(?:K|°C|degC)?\s*/\s*(min|h)\s*", text
    )
    rate_k_per_min = math.nan if match is None else float(match[1]) / _MINUTES[match[2]]
    if not 0.0 < rate_k_per_min < math.inf:
        raise ValueError(
            f"expected a rate above 0 in K per minute or hour, such as 2/min or 30K/h, got {text!r}"
        )
    return rate_k_per_min


_TEMPERATURE = Parsed("temperature", lambda text: (text, _temperature(text)))
_POWER = Parsed("power", _power)
_RATE = Parsed("rate", _rate)


@click.command(epilog=examples("thermoctl status", "thermoctl status --check --json"))
@loop_option
@socket_option
@click.option("--check", is_flag=True, help="Exit 4 when an alarm is active, 1 when cycles stop.")
@json_option
def status(loop: str | None, socket: Path | None, check: bool, as_json: bool) -> int:
    """Show what the daemon's loops are doing."""
    with ControlClient(socket) as client:
        told = client.ask("status", loop=loop)
        rows = client.ask("alarms", loop=loop)["alarms"] if check else []
    loops = told["loops"]
    if as_json:
        click.echo(json.dumps(_content(told)))
    else:
        click.echo("\n\n".join(_described(each) for each in loops), nl=bool(loops))
    for name in told["waiting"]:
        click.echo(f"thermoctl: {name} has not finished a cycle yet", err=True)
    if any(row["active"] or row["latched"] for row in rows):
        return EXIT_ALARM
    late = [each["loop"] for each in loops if each["age_s"] > _patience_s(each["period_s"])]
    for name in late if check else ():
        click.echo(f"thermoctl: expected {name} to finish cycles, but its last is old", err=True)
    return EXIT_FAILED if check and (late or told["waiting"]) else 0


def _patience_s(period_s: float) -> float:
    return _LATE_PERIODS * period_s + _LATE_S


@click.command(epilog=examples("thermoctl get temperature_c", "thermoctl get power --loop tank"))
@click.argument("key", shell_complete=keys)
@loop_option
@socket_option
@json_option
def get(key: str, loop: str | None, socket: Path | None, as_json: bool) -> None:
    """Show one value of `status --json`, bare."""
    with ControlClient(socket) as client:
        value = client.ask("get", key=key, loop=loop)["value"]
    if as_json or isinstance(value, dict):
        click.echo(json.dumps(value))
    elif value is None:
        raise Refused(f"expected {key} to be known, and it is not at this moment")
    else:
        click.echo(" ".join(value) if isinstance(value, list) else value)


@click.command(
    "set",
    context_settings={"ignore_unknown_options": True},  # -5 is a temperature
    epilog=examples(
        "thermoctl set 65.0", "thermoctl set 149F", "thermoctl set 65 --ramp 2/min --loop tank"
    ),
)
@click.argument("value", metavar="TEMPERATURE", type=_TEMPERATURE)
@click.option("--ramp", type=_RATE, help="Go there at this rate: 2/min, 30K/h.")
@loop_option
@socket_option
@json_option
def set_command(
    value: tuple[str, float],
    ramp: float | None,
    loop: str | None,
    socket: Path | None,
    as_json: bool,
) -> None:
    """Hold another temperature, in °C; at once, unless a rate limits it."""
    typed, value_c = value
    try:
        told = _asked(socket, "set", loop=loop, value_c=value_c, rate_k_per_min=ramp)
    except Refused as error:
        if typed.strip().upper().endswith(("K", "F")):
            raise Refused(f"{error}; {typed} is {value_c:g} °C") from error
        raise
    at = "" if ramp is None else f", at {ramp:.3g} K/min"
    words = f"set point {numbers.plain(numbers.temperature(told['setpoint_c']))}{at}"
    _tell(told, as_json, lambda: words)


@click.command(epilog=examples("thermoctl mode auto", "thermoctl mode off --loop tank"))
@click.argument("mode", metavar="MODE", type=Parsed("mode", _mode), shell_complete=modes)
@loop_option
@socket_option
@json_option
def mode(mode: str, loop: str | None, socket: Path | None, as_json: bool) -> None:
    """Switch off, hand the power to the operator, or to the controller.

    MODE is off, manual or auto.
    """
    told = _asked(socket, "mode", loop=loop, mode=mode)
    _tell(told, as_json, lambda: f"mode {told['mode']}")


@click.command(
    epilog=examples("thermoctl output 30%", "thermoctl output -30% --loop tank"),
    context_settings={"ignore_unknown_options": True},  # a power below 0 is none
)
@click.argument("power", type=_POWER)
@loop_option
@socket_option
@json_option
def output(power: float, loop: str | None, socket: Path | None, as_json: bool) -> None:
    """Give this power while the mode is manual; below 0 it is a cooler's."""
    told = _asked(socket, "output", loop=loop, power=power)
    _tell(told, as_json, lambda: f"power {numbers.plain(numbers.power(told['power']))}")


@click.command(
    context_settings={"ignore_unknown_options": True},  # -10% is a load
    epilog=examples("thermoctl load 20% --for 10m", "thermoctl load 0"),
)
@click.argument("power", type=_POWER)
@click.option(
    "--for", "duration_s", type=Duration(), help="How long: 10m, 1h; a load of 0 needs none."
)
@loop_option
@socket_option
@json_option
def load(
    power: float, duration_s: float | None, loop: str | None, socket: Path | None, as_json: bool
) -> None:
    """Say what the plant is about to lose beside its usual loss."""
    if duration_s is None and power:
        raise click.UsageError(
            f"expected --for DURATION with a load of {100.0 * power:g} %, got none"
        )
    duration_s = duration_s or _OVER_S
    told = _asked(socket, "load", loop=loop, power=power, duration_s=duration_s)
    lasting = f" for {told['duration_s']:g} s" if power else ""
    _tell(told, as_json, lambda: f"load {numbers.plain(numbers.power(told['power']))}{lasting}")


@click.command(epilog=examples("thermoctl controller self-tuning-mv"))
@click.argument("name", shell_complete=shadows)
@loop_option
@socket_option
@json_option
def controller(name: str, loop: str | None, socket: Path | None, as_json: bool) -> None:
    """Put the shadow in charge, and who was in charge in its shadow."""
    told = _asked(socket, "controller", loop=loop, name=name)
    _tell(told, as_json, lambda: f"controller {told['controller']}")


@click.command(epilog=examples("thermoctl shadow pid", "thermoctl shadow none"))
@click.argument("name", shell_complete=laws)
@loop_option
@socket_option
@json_option
def shadow(name: str, loop: str | None, socket: Path | None, as_json: bool) -> None:
    """Let another law learn in the shadow, from now on; or none."""
    told = _asked(socket, "shadow", loop=loop, name=name)
    _tell(told, as_json, lambda: f"shadow {told['shadow'] or 'none'}")


@click.command(
    epilog=examples("thermoctl watch", "thermoctl watch --lines", "thermoctl watch --json")
)
@loop_option
@socket_option
@click.option("--lines", is_flag=True, help="A line a cycle, on a terminal too.")
@json_option
def watch(loop: str | None, socket: Path | None, lines: bool, as_json: bool) -> int:
    """Show every cycle as it is finished, until Ctrl-C.

    On a terminal this is the live view of the loop, whose keys ask the daemon; elsewhere it is a
    line a cycle.
    """
    try:
        if as_json or lines or not sys.stdout.isatty() or not _shown_live(socket, loop):
            with ControlClient(socket) as client:
                for cycle in client.watch(loop):
                    click.echo(json.dumps(cycle) if as_json else _line(cycle))
    except KeyboardInterrupt:
        pass  # the one way to end it, and no failure
    return 0


def _shown_live(socket: Path | None, loop: str | None) -> bool:
    """Show the live view until the user leaves; return False where several loops are meant."""
    from thermoctl.app.live.daemon_line import meet
    from thermoctl.app.live.watch_view import watch_live

    met = meet(socket, loop)
    if isinstance(met, list):
        click.echo(f"thermoctl: --loop NAME shows one of {', '.join(met)} in a view", err=True)
        return False
    watch_live(socket, met)
    return True


# -- asking ----------------------------------------------------------------------------------------


def _asked(socket: Path | None, do: str, **keys: Any) -> Mapping[str, Any]:
    """Return the reply to a request."""
    with ControlClient(socket) as client:
        return client.ask_loop(do, **keys)


def _content(told: Mapping[str, Any]) -> dict[str, Any]:
    """Return a reply without what only the protocol needs."""
    return {name: value for name, value in told.items() if name not in ("v", "id", "ok")}


def _tell(told: Mapping[str, Any], as_json: bool, words: Callable[[], str]) -> None:
    click.echo(json.dumps(_content(told)) if as_json else f"{told['loop']}: {words()}")


# -- words -----------------------------------------------------------------------------------------


def _described(record: Mapping[str, Any]) -> str:
    """Return the status of one loop, a line a value, the colons below each other."""
    rows: dict[str, Any] = {
        "Loop": record["loop"],
        "Temperature": numbers.temperature(record["temperature_c"]),
        "Reading": record["quality"],
        "Set point": numbers.temperature(record["setpoint_c"]) + _on_the_way(record),
        **_foretold(record),
        "Deviation": _deviation(record),
        "Power": numbers.power(record["power"]),
        "Power taken": numbers.power(record["accepted_power"]),
        "Mode": record["mode"],
        "State": record["state"],
        "Controller": record["controller"],
        **_shadow(record),
        "Alarms": " ".join(record["alarms"]) or "none",
        "Last cycle": f"{numbers.age(record['age_s'])} ago",
        "Cycles missed": record["missed"],
    }
    lines = [*rows.items(), *insight_lines(record.get("insight"))]
    width = max(len(name) for name, _ in lines)
    return numbers.plain("\n".join(f"{name:<{width}} : {value}" for name, value in lines))


def _ramp_c(record: Mapping[str, Any]) -> float | None:
    """Return where the ramp to the set point is; None without one."""
    told: float | None = record["reference_c"]
    if record["mode"] != "auto" or told is None or abs(told - record["setpoint_c"]) < _SAME_K:
        return None
    return told


def _on_the_way(record: Mapping[str, Any]) -> str:
    """Return where the ramp to the set point is, in words; empty without one."""
    ramp_c = _ramp_c(record)
    return "" if ramp_c is None else f", ramp at {numbers.temperature(ramp_c)}"


def _deviation(record: Mapping[str, Any]) -> str:
    """Return the distance from what is followed, the ramp while there is one, and which it is."""
    ramp_c, told = _ramp_c(record), record["temperature_c"]
    if told is None:
        return numbers.UNKNOWN
    if ramp_c is None:
        return f"{numbers.difference(told - record['setpoint_c'])} from the set point"
    return f"{numbers.difference(told - ramp_c)} from the ramp"


def _foretold(record: Mapping[str, Any]) -> dict[str, str]:
    """Return the lines about what is to come: arrival and a load, where there are any."""
    told, lines = record["feasible"], {}
    if told["arrival_s"]:
        minutes = max(1.0, 2.0 * (told["arrival_sd_s"] or 0.0) / _MINUTE_S)
        error = numbers.with_unit(numbers.number(minutes, 0), "min")
        lines["Arrives"] = f"in {numbers.span(told['arrival_s'])} ± {error}"
    if record["load"]:
        lines["Load told"] = numbers.power(record["load"])
    return lines


def _shadow(record: Mapping[str, Any]) -> dict[str, str]:
    """Return the lines about the controller in shadow; none without one."""
    if record["shadow"] is None:
        return {}
    told = record["shadow_score"]
    score = None if told is None else ShadowScore(**told)
    over = "" if score is None else f"over {numbers.span(score.span_s)} "
    return {
        "Shadow": f"{record['shadow']} {numbers.power(record['shadow_power'])}",
        "Shadow score": over + ", ".join(shadow_words(score)),
    }


def _line(record: Mapping[str, Any]) -> str:
    """Return a finished cycle as one line."""
    alarms = f"  {' '.join(record['alarms'])}" if record["alarms"] else ""
    return numbers.plain(
        f"{datetime.now():%H:%M:%S}  {record['loop']}  "
        f"{numbers.temperature(record['temperature_c']):>9}  "
        f"set {numbers.temperature(record['setpoint_c']):>9}{_on_the_way(record)}  "
        f"power {numbers.power(record['power']):>7}  "
        f"{record['mode']} {record['state']}{alarms}"
    )
