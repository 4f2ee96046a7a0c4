"""Puts the rooms together: from settings to a regulator, or to a loop with its boards.

The only place that knows which class stands behind a port, and where boards are built.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import serial
from pydantic import BaseModel

from thermoctl.app import plugins
from thermoctl.app.settings import Settings
from thermoctl.app.tables import ActuatorTable, EstimatorTable, LoopTable, ModelTable, SensorTable
from thermoctl.errors import ConfigError, LinkError
from thermoctl.estimation import Guarded, Identifier, RandomWalkKalman
from thermoctl.estimation.kalman import CorrectedKalman
from thermoctl.model import actuator as laws
from thermoctl.model import sensor as curves
from thermoctl.model.arx import Arx, KnownGain
from thermoctl.ports import Board, Clock, Controller, Estimator
from thermoctl.regulator import Limits, Plan, Regulator
from thermoctl.runtime.connection import Connection
from thermoctl.runtime.loop import Loop, Publish, Wiring
from thermoctl.signals import Alarm, Mode

_ARX_EXCITATION_MIN = 0.1
_WRITE_TIMEOUT_S = 0.5


# -- the regulator --------------------------------------------------------------------------------


def regulator_for(
    settings: Settings, loop: str | None = None, latched: Alarm | None = None
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

    Raises
    ------
    ConfigError
        An option of a law is unknown or bad; the text names loop and key.
    """
    name, table = settings.loop(loop)
    return Regulator(plan_for(name, table), latched)


def plan_for(name: str, table: LoopTable) -> Plan:
    """Return the parts of the loop `name`, each checked; raise `ConfigError` naming the key."""
    structure = _structure(table.model, table.period_s)
    try:
        return Plan(
            limits=_limits(table),
            identifier=_identifier(table.estimator, structure, table.setpoint_c),
            controller=_controller(table, structure),
            setpoint_c=table.setpoint_c,
            mode=table.mode,
        )
    except (ConfigError, ValueError) as error:
        raise ConfigError(f"loop {name!r}: {error}") from error


def _limits(table: LoopTable) -> Limits:
    low_c, high_c = table.setpoint_range_c
    return Limits(
        trip_above_c=table.trip_above_c,
        trip_below_c=table.trip_below_c,
        setpoint_min_c=low_c,
        setpoint_max_c=high_c,
        period_s=table.period_s,
        power_max=table.power_max,
        rise_per_s=table.rise_limit_per_s,
        jump_k=table.jump_k,
    )


def _structure(table: ModelTable, period_s: float) -> Arx | KnownGain:
    if table.structure == "known-gain":
        return KnownGain(table.gain_k_per_s * period_s)
    return Arx(table.n, table.m, y_centre_c=table.centre_c, y_scale_k=table.scale_k)


def _identifier(table: EstimatorTable, structure: Arx | KnownGain, setpoint_c: float) -> Identifier:
    law = plugins.build(plugins.find(plugins.ESTIMATORS, table.kind), table.options)
    theta0 = table.theta0
    if theta0 is None and isinstance(structure, KnownGain):
        theta0 = (1.0,)  # a plant without loss keeps its temperature
    return Identifier(structure, _guarded(law, table, structure, setpoint_c), theta0, table.P0)


def _guarded(
    law: Estimator, table: EstimatorTable, structure: Arx | KnownGain, setpoint_c: float
) -> Estimator:
    guards = table.guards
    if not guards.enabled:
        return law
    excitation_min = guards.excitation_min
    if excitation_min is None and isinstance(structure, Arx):
        excitation_min = _ARX_EXCITATION_MIN
    kalman = isinstance(law, RandomWalkKalman | CorrectedKalman)
    too_simple = isinstance(structure, KnownGain)  # its innovations are lag as much as noise
    return Guarded(
        law,  # type: ignore[arg-type]
        covariance_max=guards.covariance_max or _covariance_max(table, structure, setpoint_c),
        excitation_min=excitation_min,
        robust_R2=guards.robust_R2 and kalman,
        R2_min=getattr(law, "R2", None) if too_simple else None,
    )


def _covariance_max(table: EstimatorTable, structure: Arx | KnownGain, setpoint_c: float) -> float:
    """Return the cap on P when none is set: P0, or for a known gain what physics allows.

    A loss, (1 - a) times the temperature, that is less certain than the heater's full power would
    make no sense; a noisy converter would otherwise keep the pole jumping.
    """
    if isinstance(structure, Arx):
        return table.P0
    return min(table.P0, (structure.b_k / max(abs(setpoint_c), 1.0)) ** 2)


def _controller(table: LoopTable, structure: Arx | KnownGain) -> Controller:
    law = plugins.find(plugins.CONTROLLERS, table.controller.kind)
    takes_structure = "structure" in plugins.option_names(law)
    injected: dict[str, Any] = {"structure": structure} if takes_structure else {}
    try:
        controller: Controller = plugins.build(law, table.controller.options, **injected)
    except ConfigError as error:
        raise ConfigError(f"controller: {error}") from error
    return controller


# -- sensors, actuators and boards -----------------------------------------------------------------


def sensor_for(table: SensorTable) -> curves.Sensor:
    """Return the sensor a table describes; raise `ConfigError` if it describes none."""
    try:
        return curves.Sensor(
            _conversion(table),
            table.reference_v,
            table.open_above,
            table.short_below,
            curves.Calibration(table.calibration_gain, table.calibration_offset_k),
        )
    except ValueError as error:
        raise ConfigError(f"sensor: {error}") from error


def _conversion(table: SensorTable) -> curves.Conversion:
    match table.curve:
        case "lm335":
            return curves.LM335
        case "lm35":
            return curves.LM35
        case "tmp36":
            return curves.TMP36
        case "linear":
            return curves.LinearConversion(table.kelvin_per_v, table.zero_v_c)
        case "ntc":
            resistance: curves.ResistanceCurve = curves.Beta(table.r25_ohm, table.beta_k)
        case _:
            resistance = curves.Platinum(1000.0 if table.curve == "pt1000" else 100.0)
    supply_v = table.reference_v if table.supply_v is None else table.supply_v
    return curves.PullUp(resistance, table.pull_up_ohm or math.nan, supply_v)


def law_for(table: ActuatorTable) -> laws.ActuatorLaw:
    """Return the law from power to the drive the output takes."""
    match table.law:
        case "linear":
            return laws.Linear()
        case "square":
            return laws.SquareLaw()
        case "phase-angle":
            return laws.PhaseAngle()
        case _:
            return laws.WholeCycleBurst(table.cycles)


def board_builder(settings: BaseModel, clock: Clock) -> Callable[[], Board]:
    """Return a function that builds the board of `settings` anew, its link opened but not used.

    A board is built again after every loss, because a device that comes back is a new one.
    """
    driver = plugins.find(plugins.DRIVERS, settings.kind)  # type: ignore[attr-defined]

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
        raise LinkError(f"cannot open {settings.port}: {error}") from error


# -- the loop --------------------------------------------------------------------------------------


def loop_for(
    settings: Settings,
    clock: Clock,
    publish: Publish,
    *,
    beside: bool = True,
    latched: dict[str, Alarm] | None = None,
    completed: Callable[[], None] = lambda: None,
) -> Loop:
    """Return the loop over every loop of `settings`, with its boards not yet opened.

    Raises
    ------
    ConfigError
        A loop has no sensor or actuator, periods differ, or a board without a dead-man is not
        accepted.
    """
    period_s = _common_period(settings)
    reports: list[Callable[..., None]] = []

    def report(name: str, **fields: object) -> None:
        reports[0](name, **fields)

    boards = {}
    for name, board in settings.boards.items():
        _require_dead_man(name, board, settings)
        boards[name] = Connection(name, board_builder(board, clock), clock, report, beside=beside)
    wirings = [
        _wiring(name, table, boards, regulator_for(settings, name, (latched or {}).get(name)))
        for name, table in settings.loops.items()
    ]
    loop = Loop(wirings, clock, period_s, publish, completed)
    reports.append(loop.report)
    return loop


def _wiring(
    name: str, table: LoopTable, boards: dict[str, Connection], regulator: Regulator
) -> Wiring:
    sensor, actuator = table.sensor, table.actuator
    if sensor is None or actuator is None:
        missing = "sensor" if sensor is None else "actuator"
        raise ConfigError(f"loop {name!r} needs a table [loops.{name}.{missing}] to run")
    return Wiring(
        name,
        regulator,
        boards[sensor.board],
        sensor.input,
        sensor_for(sensor),
        boards[actuator.board],
        actuator.output,
        law_for(actuator),
    )


def _common_period(settings: Settings) -> float:
    periods = {table.period_s for table in settings.loops.values()}
    if len(periods) > 1:
        raise ConfigError(f"expected one period_s for all loops, got {sorted(periods)}")
    return periods.pop()


def _require_dead_man(name: str, board: BaseModel, settings: Settings) -> None:
    driver = plugins.find(plugins.DRIVERS, board.kind)  # type: ignore[attr-defined]
    if not driver.capabilities.dead_man and not settings.service.accept_no_dead_man:
        raise ConfigError(
            f"board {name!r} ({driver.__name__}) cannot switch its output off by itself; add an "
            "independent thermostat and say service.accept_no_dead_man = true to run it"
        )


def started_as(settings: Settings, starts: Mapping[str, tuple[Mode, float]]) -> Settings:
    """Return `settings` with the given loops starting in another mode and at another set point."""
    loops = dict(settings.loops)
    for name, (mode, setpoint_c) in starts.items():
        loops[name] = loops[name].model_copy(update={"mode": mode, "setpoint_c": setpoint_c})
    return settings.model_copy(update={"loops": loops})
