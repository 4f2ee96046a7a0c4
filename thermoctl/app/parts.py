"""From the tables of a loop to its limits, model, laws, sensor and actuator.

Pure: nothing is opened and no clock is read, so a configuration is tried out by building it.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from thermoctl.app import plugins
from thermoctl.app.configuration.bases import Options
from thermoctl.app.configuration.device_tables import ActuatorTable, SensorTable
from thermoctl.app.configuration.repair import repaired, without
from thermoctl.app.configuration.tables import EstimatorTable, LoopTable
from thermoctl.app.plugins import BadOption
from thermoctl.app.reach import reach_errors
from thermoctl.estimation import Guarded, Identifier, RandomWalkKalman
from thermoctl.estimation.kalman import CorrectedKalman
from thermoctl.model import actuator as laws
from thermoctl.model import sensor as curves
from thermoctl.model.arx import Arx, KnownGain
from thermoctl.ports import Controller, Estimator
from thermoctl.regulator import Limits, Plan
from thermoctl.regulator.heater.check import POWER_RANGE, HeaterCheck, weakest_of

HEAT, COOL, HEAT_COOL = "heat", "cool", "heat-cool"

_ARX_EXCITATION_MIN = 0.1
_ARX_GAIN_SHARE = 0.2
"""Guarded, a learnt gain is never taken for less than this share of the one that is given."""


def plan_for(table: LoopTable) -> Plan:
    """Return the parts of a loop's regulator, each checked.

    Raises
    ------
    BadOption
        An option of a law is unknown or bad; its path begins below the loop.
    """
    with _within("model", table.model):
        structure = _structure(table)
    with _within("controller", table.controller):
        controller = _controller(table, table.controller, structure)
    shadow = None
    if table.shadow is not None:
        with _within("shadow", table.shadow):
            shadow = _controller(table, table.shadow, structure)
    with _within("estimator", table.estimator):
        identifier = _identifier(table, structure, _reference_time_s(controller, shadow))
    for name, law in (("controller", controller), ("shadow", shadow)):
        _check_action(table, name, law, controller)
    with _within("", table):
        limits = _limits(table, controller)
        return Plan(
            limits,
            identifier,
            controller,
            table.setpoint_c,
            table.mode,
            shadow,
            table.setpoint_rate_k_per_s,
            _heater_check(table, controller),
            table.disagreement_k,
        )


def law_of_kind(table: LoopTable, kind: str) -> Controller:
    """Return the law `kind` as a loop configures it, else as it is by default.

    Raises
    ------
    BadOption
        There is no such kind, or it does not fit the loop.
    """
    structure = _structure(table)
    charge = _controller(table, table.controller, structure)
    configured = [each for each in (table.controller, table.shadow) if each is not None]
    chosen = next((each for each in configured if each.kind == kind), Options(kind=kind))
    if "action" in plugins.option_names(plugins.find(plugins.CONTROLLERS, kind)):
        chosen = Options.model_validate({"action": action_of(charge), **chosen.model_dump()})
    law = _controller(table, chosen, structure)
    _check_action(table, "shadow", law, charge)
    return law


def check_parts(table: LoopTable) -> None:
    """Build every part of a loop once; raise `BadOption` where that fails."""
    for error in part_errors(table):
        raise error


def part_errors(table: LoopTable, *, whole: bool = True) -> Iterator[BadOption]:
    """Yield each option that keeps a loop's parts from being built.

    What was refused is left out for the next attempt. What depends on several keys can then no
    longer be judged; nor can it where the table is not `whole` from the start.
    """
    if whole:
        yield from _beyond_reach(table)
    content: Mapping[str, Any] = table.model_dump(exclude_unset=True)
    told: set[tuple[str, ...]] = set()
    while True:
        try:
            _build(table)
            return
        except BadOption as error:
            path = error.path
            if whole or (len(path) > 1 and path[-1] != "action" and path not in told):
                yield error
            told.add(path)
        rest = without(content, path[:-1] if path[-1:] == ("kind",) else path) if path else content
        left = repaired(rest)
        if rest == content or left is None:
            return
        content, table, whole = rest, left, False


def _build(table: LoopTable) -> None:
    """Build every part of a loop; raise `BadOption` of the first one that cannot be."""
    plan_for(table)
    if table.sensor is not None:
        sensor_for(table.sensor)
    if table.second_sensor is not None:
        _check_second(table, table.second_sensor)
    for output in table.outputs:
        law_for(output)


def _beyond_reach(table: LoopTable) -> Iterator[BadOption]:
    """Yield each limit that a sensor of the loop cannot show; one that is bad is not asked."""
    for part, sensor in (("sensor", table.sensor), ("second_sensor", table.second_sensor)):
        if sensor is not None:
            with contextlib.suppress(BadOption):
                yield from reach_errors(table, part, sensor_for(sensor, part))


def action_of(controller: Controller) -> str:
    """Return what power does to the plant; a law without a word of it heats."""
    return str(getattr(controller, "action", HEAT))


def _check_action(loop: LoopTable, name: str, law: Controller | None, charge: Controller) -> None:
    """Refuse a law that takes the actuators for something else than they are."""
    if law is None:
        return
    path, action = (name, "action"), action_of(law)
    if loop.cooler is None and action == HEAT_COOL:
        raise BadOption(f"{HEAT_COOL!r} needs a table [loops.NAME.cooler]", path)
    if loop.cooler is not None and action != HEAT_COOL:
        raise BadOption(
            f"expected {HEAT_COOL!r} of a loop that has a cooler, {law.name} is for {action!r}",
            path,
        )
    if loop.leads is not None and action != HEAT:
        raise BadOption(f"expected {HEAT!r}: more power is a higher set point of the next", path)
    if action != action_of(charge):
        raise BadOption(f"expected {action_of(charge)!r} as in charge, got {action!r}", path)


def _check_second(table: LoopTable, second: SensorTable) -> None:
    """Refuse a second sensor that is none, or the first one again."""
    path, first = ("second_sensor",), table.sensor
    if first is None:
        raise BadOption("expected a table [loops.NAME.sensor] beside it, got none", path)
    if (second.board, second.input) == (first.board, first.input):
        text = f"expected another input than the first sensor's, got {second.input!r}"
        raise BadOption(f"{text} of {second.board!r} twice", (*path, "input"))
    sensor_for(second, *path)


@contextlib.contextmanager
def _within(name: str, table: BaseModel) -> Iterator[None]:
    """Say of an error from which table it came, and under which of its keys."""
    above = (name,) if name else ()
    try:
        yield
    except BadOption as error:
        raise BadOption(error.text, above + error.path) from error
    except ValueError as error:
        blamed = plugins.blamed(error, type(table).model_fields)
        raise BadOption(blamed.text, above + blamed.path) from error


def _heater_check(table: LoopTable, controller: Controller) -> HeaterCheck | None:
    """Return how the heater is checked, or the loop that acts in its place."""
    check = table.heater_check
    if not check.enabled:
        return None
    weakest = check.weakest_k_per_s
    if weakest is None:
        weakest = weakest_of(table.heater_w, table.volume_l)
    action: Any = action_of(controller)  # a plug-in's may be anything, and is refused there
    leads, first_heat_s = table.leads, check.first_heat_s
    if leads is not None:  # its power is a share of the way between two temperatures
        return HeaterCheck(weakest, first_heat_s, action, (leads.low_c, leads.high_c))
    most = 1.0 if table.cooler is None else table.cooler.power_max
    power_max = max(table.power_max, POWER_RANGE[0])
    return HeaterCheck(weakest, first_heat_s, action, power_max=power_max, cooler_max=most)


def _limits(table: LoopTable, controller: Controller) -> Limits:
    low_c, high_c = table.setpoint_range_c
    cooler, actuator = table.cooler, table.actuator
    return Limits(
        trip_above_c=table.trip_above_c,
        trip_below_c=table.trip_below_c,
        setpoint_min_c=low_c,
        setpoint_max_c=high_c,
        period_s=table.period_s,
        power_max=table.power_max,
        rise_per_s=table.rise_limit_per_s,
        jump_k=table.jump_k if "jump_k" in table.model_fields_set else _jump_k(table),
        jump_widens="jump_k" not in table.model_fields_set,
        power_min=0.0 if cooler is None else -cooler.power_max,
        changeover_s=0.0 if cooler is None else cooler.changeover_s,
        power_cools=action_of(controller) == COOL,
        # A block that cools down gives more than the loop above it asks for; that is no fault.
        applied_tolerance=Limits.APPLIED_TOLERANCE if table.leads is None else 1.0,
        window_s=actuator.window_s if isinstance(actuator, ActuatorTable) else 0.0,
        cooler_window_s=0.0 if cooler is None else cooler.window_s,
    )


def _jump_k(loop: LoopTable) -> float:
    """Return the default, or in a fast tank twice what full power does in a period.

    Half a litre with 1.5 kW rises by 3.6 K in five seconds; that is no outlier.
    """
    return max(loop.jump_k, 2.0 * _gain_k(loop))


def _structure(loop: LoopTable) -> Arx | KnownGain:
    table = loop.model
    if table.structure == "known-gain":
        return KnownGain(_gain_k(loop))
    return Arx(table.n, table.m, table.delay, y_centre_c=table.centre_c, y_scale_k=table.scale_k)


def _identifier(loop: LoopTable, structure: Arx | KnownGain, reference_time_s: float) -> Identifier:
    table = loop.estimator
    law = plugins.build(plugins.find(plugins.ESTIMATORS, table.kind), table.options)
    theta0 = table.theta0 or _first_guess(structure, _gain_k(loop))
    if not table.guards.enabled:
        return Identifier(structure, law, theta0, table.P0)
    # The cap holds from the first sample on. Else that one sample, with all its noise, would
    # decide the pole, and the cap would then keep it there for half an hour.
    cap = table.guards.covariance_max
    if cap is None:
        share = loop.period_s / reference_time_s if reference_time_s > 0.0 else math.inf
        cap = _covariance_max(table.P0, law, structure, loop.setpoint_c, share)
    return Identifier(structure, _guarded(law, table, structure, cap), theta0, min(table.P0, cap))


def _gain_k(loop: LoopTable) -> float:
    """Return the rise during one period at full power, in K, as it is configured."""
    return loop.gain_k_per_s * loop.period_s


def _first_guess(structure: Arx | KnownGain, gain_k: float) -> tuple[float, ...]:
    """Return theta of a plant without loss, which keeps its temperature and which power heats.

    Zeros would be a plant without gain: no power could be computed from it, and without power the
    gain is never learnt. Each b is half of the one before, so that the zeros of B lie inside the
    unit circle, and a law that refuses others can begin.
    """
    if isinstance(structure, KnownGain):
        return (1.0,)
    shares = [0.5**i for i in range(structure.m)]
    b = gain_k / sum(shares) * structure.u_scale / structure.y_scale_k
    return (-1.0, *(0.0,) * (structure.n - 1), *(share * b for share in shares))


def _guarded(
    law: Estimator, table: EstimatorTable, structure: Arx | KnownGain, covariance_max: float
) -> Estimator:
    guards = table.guards
    excitation_min = guards.excitation_min
    if excitation_min is None and isinstance(structure, Arx):
        excitation_min = _ARX_EXCITATION_MIN
    kalman = isinstance(law, RandomWalkKalman | CorrectedKalman)
    too_simple = isinstance(structure, KnownGain)  # its innovations are lag as much as noise
    return Guarded(
        law,  # type: ignore[arg-type]
        covariance_max=covariance_max,
        excitation_min=excitation_min,
        robust_R2=guards.robust_R2 and kalman,
        R2_min=getattr(law, "R2", None) if too_simple else None,
    )


def _covariance_max(
    P0: float, law: Estimator, structure: Arx | KnownGain, setpoint_c: float, share: float
) -> float:
    """Return the cap on P when none is set: P0, or for a known gain what physics allows.

    A loss, (1 - a) times the temperature, that is less certain than the heater's full power would
    make no sense; a noisy converter would otherwise keep the pole jumping. Nor may one sample
    teach more than its `share` of the reference time, a period over three lags: while the heat is
    still under way it looks lost, and a small vessel would be given as much again.
    """
    if isinstance(structure, Arx):
        return P0
    most_k2 = min(structure.b_k**2, getattr(law, "R2", 1.0) * share)
    return min(P0, most_k2 / max(abs(setpoint_c), 1.0) ** 2)


def _reference_time_s(*controllers: Controller | None) -> float:
    """Return the reference time of the law that steers by the learnt model; 0 without one."""
    return max(getattr(controller, "reference_time_s", 0.0) for controller in controllers)


def _controller(table: LoopTable, chosen: Options, structure: Arx | KnownGain) -> Controller:
    """Return the law that is `chosen` for this loop, in charge or in shadow."""
    law = plugins.find(plugins.CONTROLLERS, chosen.kind)
    known, options = plugins.option_names(law), dict(chosen.options)
    given: dict[str, Any] = {"structure": structure, "period_s": table.period_s}
    injected = {name: value for name, value in given.items() if name in known}
    if isinstance(structure, Arx) and table.estimator.guards.enabled and "gain_min_k" in known:
        options.setdefault("gain_min_k", _ARX_GAIN_SHARE * _gain_k(table))
    told = {"gain_k_per_s": table.gain_k_per_s, "power_max": table.power_max}
    for name in told.keys() & set(known):
        options.setdefault(name, told[name])
    controller: Controller = plugins.build(law, options, **injected)
    return controller


def sensor_for(table: SensorTable, name: str = "sensor") -> curves.Sensor:
    """Return the sensor of the table `name`; raise `BadOption` if it describes none."""
    with _within(name, table):
        return curves.Sensor(
            _conversion(table),
            table.reference_v,
            table.open_above,
            table.short_below,
            curves.Calibration(table.calibration_gain, table.calibration_offset_k),
        )


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
