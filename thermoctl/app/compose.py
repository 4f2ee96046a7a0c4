"""Puts the rooms together: from settings to a regulator, or a loop with boards.

The only place that knows which class stands behind a port, and where boards are built.
"""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final

import serial
from pydantic import BaseModel

from thermoctl.app import plugins
from thermoctl.app.cascades import cascade_errors
from thermoctl.app.configuration.device_tables import CascadeTable, SensorTable
from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.parts import law_for, plan_for, sensor_for
from thermoctl.app.plugins import BadOption
from thermoctl.app.settings import Settings
from thermoctl.errors import ConfigError, LinkError
from thermoctl.model.actuator import Linear
from thermoctl.ports import Board, Clock, Remembered
from thermoctl.regulator import Regulator
from thermoctl.regulator.recollection import NOTHING
from thermoctl.runtime.connection import Connection
from thermoctl.runtime.lead import Lead
from thermoctl.runtime.loop import Loop, Publish
from thermoctl.runtime.wiring import Input, Output, Wiring
from thermoctl.signals import Alarm, Mode

ACCEPTANCE: Final = "service.accept_no_dead_man = true"
"""What is written where a board that cannot switch off by itself is run all the same."""

_WRITE_TIMEOUT_S = 0.5


# -- the regulator --------------------------------------------------------------------------------


def regulator_for(
    settings: Settings,
    loop: str | None = None,
    latched: Alarm | None = None,
    remembered: Mapping[str, Remembered] = NOTHING,
) -> Regulator:
    """Return the regulator of a loop: pure, without I/O and without a clock.

    Parameters
    ----------
    settings : Settings
        From `thermoctl.app.settings.load`.
    loop : str, optional
        Name of the loop; the first one when not given.
    latched : Alarm, optional
        A latch of an earlier run.
    remembered : mapping, optional
        What controllers of an earlier run have learnt, by their names.

    Raises
    ------
    ConfigError
        An option of a law is unknown or bad; the text names loop and key.
    """
    name, table = settings.loop(loop)
    try:
        return Regulator(plan_for(table), latched, remembered)
    except BadOption as error:
        raise ConfigError(f"loop {name!r}: {error}") from error


# -- boards ----------------------------------------------------------------------------------------


def driver_of(settings: BaseModel) -> Any:
    """Return the class of the board that `settings` describe."""
    return plugins.find(plugins.DRIVERS, settings.kind)  # type: ignore[attr-defined]


def board_builder(settings: BaseModel, clock: Clock) -> Callable[[], Board]:
    """Return a function that builds the board of `settings` anew.

    Its link is opened, but not used. A board is built again after every loss, because a device
    that comes back is a new one.
    """
    driver = driver_of(settings)

    def build() -> Board:
        wired = getattr(driver, "transport", "none") == "serial"
        link = _serial_link(settings) if wired else None
        board: Board = driver(settings, link, clock)
        return board

    return build


def _serial_link(settings: Any) -> serial.Serial:
    try:
        return serial.serial_for_url(
            settings.port,
            baudrate=settings.baud,
            timeout=0.0,
            write_timeout=_WRITE_TIMEOUT_S,
            exclusive=True,
        )
    except (serial.SerialException, OSError, ValueError) as error:
        number = getattr(error, "errno", None)  # the library says the same thing three times over
        why = os.strerror(number) if number else str(error)
        if number == errno.EWOULDBLOCK:  # of the lock that exclusive=True takes
            why = "another program holds it"
        raise LinkError(f"expected a serial port at {settings.port}: {why}") from error


# -- the loop --------------------------------------------------------------------------------------


def loop_for(
    settings: Settings,
    clock: Clock,
    publish: Publish,
    *,
    beside: bool = True,
    latched: Mapping[str, Alarm] = MappingProxyType({}),
    remembered: Mapping[str, Mapping[str, Remembered]] = MappingProxyType({}),
    completed: Callable[[], None] = lambda: None,
) -> Loop:
    """Return the loop over every loop of `settings`, with its boards not yet opened.

    Raises
    ------
    ConfigError
        A loop has no sensor or actuator, or one that its board does not have, periods differ, two
        loops drive one output, or a board without a dead-man is not accepted.
    """
    wrong = list(wiring_errors(settings))
    if wrong:
        raise ConfigError("\n".join(f"{'.'.join(key)}: {text}" for key, text in wrong))
    period_s = next(iter(settings.loops.values())).period_s
    reports: list[Callable[..., None]] = []

    def report(name: str, **fields: object) -> None:
        reports[0](name, **fields)

    boards = {}
    for name, board in settings.boards.items():
        boards[name] = Connection(name, board_builder(board, clock), clock, report, beside=beside)
    wirings = []
    for name, table in settings.loops.items():
        models = remembered.get(name, NOTHING)
        regulator = regulator_for(settings, name, latched.get(name), models)
        wirings.append(_wiring(name, table, boards, regulator))
    loop = Loop(wirings, clock, period_s, publish, completed)
    reports.append(loop.report)
    return loop


def wiring_errors(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield key and reason for all that keeps these loops from running together.

    Such a configuration may still be studied, or run on simulated boards; nothing is opened here.
    """
    for below, text in cascade_errors(settings.loops):
        yield ("loops", *below), text
    periods = sorted({table.period_s for table in settings.loops.values()})
    for name, table in settings.loops.items():
        for part in ("sensor", "actuator"):
            if getattr(table, part) is None:
                yield ("loops", name), f"needs a table [loops.{name}.{part}] to run"
        if len(periods) > 1:
            yield ("loops", name, "period_s"), f"expected one for all loops, got {periods}"
        yield from _channel_errors(settings, name, table)
    driven = _outputs(settings)
    for (used, output), names in driven.items():
        if len(names) > 1:
            text = f"expected one loop for output {output!r} of {used!r}, got {', '.join(names)}"
            part = "actuator"
            if names[0] == names[1]:
                text = f"expected another output than the heater's, got {output!r} of {used!r} too"
                part = "cooler"
            yield ("loops", names[1], part), text
    for name, board in settings.boards.items():
        dead_man_s = getattr(board, "dead_man_s", math.inf)
        if dead_man_s <= max(periods):
            text = f"{dead_man_s:g} would end before the next command, after {max(periods):g} s"
            yield ("boards", name, "dead_man_s"), text
        driver = driver_of(board)
        if not driver.capabilities.dead_man and not settings.service.accept_no_dead_man:
            yield (
                ("boards", name),
                f"{driver.__name__} cannot switch its output off by itself; add an independent "
                f"thermostat and say {ACCEPTANCE} to run it",
            )


def _channel_errors(
    settings: Settings, name: str, table: LoopTable
) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield each channel of a loop that its board says it does not have.

    Unfound, a wrong input is a sensor that never answers, and a wrong output the first refusal.
    """
    parts = {
        "sensor": table.sensor,
        "second_sensor": table.second_sensor,
        "actuator": table.actuator,
        "cooler": table.cooler,
    }
    for part, channel in parts.items():
        if channel is None or isinstance(channel, CascadeTable):
            continue
        key = "input" if isinstance(channel, SensorTable) else "output"
        known = getattr(settings.boards[channel.board], f"{key}s", None)
        wanted = getattr(channel, key)
        if known is not None and wanted not in known:
            hint = plugins.nearest(wanted, known)
            text = f"board {channel.board!r} has no {key} {wanted!r}{hint}"
            yield ("loops", name, part, key), text


def _outputs(settings: Settings) -> dict[tuple[str, str], list[str]]:
    """Return the loops that drive each output of each board."""
    driven: dict[tuple[str, str], list[str]] = {}
    for name, table in settings.loops.items():
        for each in table.outputs:
            driven.setdefault((each.board, each.output), []).append(name)
    return driven


def _wiring(
    name: str, table: LoopTable, boards: dict[str, Connection], regulator: Regulator
) -> Wiring:
    sensor, actuator, cooler = table.sensor, table.actuator, table.cooler
    other = table.second_sensor
    if sensor is None or actuator is None:
        raise ConfigError(f"loop {name!r} needs a sensor and an actuator to run")
    read = name, regulator, boards[sensor.board], sensor.input, sensor_for(sensor)
    second = None if other is None else Input(boards[other.board], other.input, sensor_for(other))
    if isinstance(actuator, CascadeTable):
        lead = Lead(actuator.loop, actuator.low_c, actuator.high_c)
        return Wiring(*read, None, "", Linear(), lead=lead, second=second)
    return Wiring(
        *read,
        boards[actuator.board],
        actuator.output,
        law_for(actuator),
        None if cooler is None else Output(boards[cooler.board], cooler.output, law_for(cooler)),
        second=second,
    )


def started_as(settings: Settings, starts: Mapping[str, tuple[Mode, float]]) -> Settings:
    """Return `settings` with some loops starting in another mode and set point."""
    loops = dict(settings.loops)
    for name, (mode, setpoint_c) in starts.items():
        loops[name] = loops[name].model_copy(update={"mode": mode, "setpoint_c": setpoint_c})
    return settings.model_copy(update={"loops": loops})
