"""The bench test: loops on simulated tanks instead of their boards."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import resources
from pathlib import Path

from pydantic import ValidationError

from thermoctl.app.compose import loop_for, started_as
from thermoctl.app.configuration.device_tables import ActuatorTable, SensorTable
from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.parts import COOL, action_of, plan_for
from thermoctl.app.settings import Settings, load
from thermoctl.errors import ConfigError
from thermoctl.quantities import WATER_J_PER_L_K, clamp
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import Cycle, Mode
from thermoctl_drivers.simulated import SECOND_INPUT, SimulatedSettings

_STAND_IN_W = 1500.0
_COOLER = {"output": "cooler", "law": "linear"}
_VOLUMES_L, _POWERS_W = (0.5, 200.0), (50.0, 5000.0)


def bench_settings(
    source: str | Path | Settings | None = None, seed: int | None = None
) -> Settings:
    """Return settings whose boards are all simulated and whose loops start in auto.

    Parameters
    ----------
    source : path or Settings, optional
        A configuration; the aquarium of O21 when not given. A real board in it is replaced by
        one of `stand_ins`.
    seed : int, optional
        Seed of the simulation; that of the configuration when not given.

    Raises
    ------
    ConfigError
        The configuration is bad, or cannot be simulated.
    """
    settings = source if isinstance(source, Settings) else load(source or default_profile())
    tanks = stand_ins(settings)
    boards = {**settings.boards, **tanks}
    if seed is not None:
        boards = {name: board.model_copy(update={"seed": seed}) for name, board in boards.items()}
    loops = {name: _rewired(table, tanks) for name, table in settings.loops.items()}
    starts = {name: (Mode.AUTO, table.setpoint_c) for name, table in loops.items()}
    return started_as(settings.model_copy(update={"boards": boards, "loops": loops}), starts)


def default_profile() -> Path:
    """Return the path of the aquarium's configuration, which ships with the package."""
    return profile("aquarium")


def profile(name: str) -> Path:
    """Return the path of the profile `name` that ships with the package."""
    shipped = Path(str(resources.files("thermoctl"))) / "profiles" / f"{name}.toml"
    if shipped.is_file():
        return shipped
    return Path(__file__).parents[2] / "config" / f"{name}.toml"  # a source tree


def simulate(settings: Settings, duration_s: float, seed: int | None = None) -> Iterator[Cycle]:
    """Yield the cycles of `duration_s` simulated seconds at full speed.

    Parameters
    ----------
    settings : Settings
        Any configuration; its boards are simulated, its loops start in auto.
    duration_s : float
        Simulated time in s.
    seed : int, optional
        Seed of the simulation.
    """
    finished: list[Cycle] = []
    clock = SimulatedClock()
    loop = loop_for(bench_settings(settings, seed), clock, finished.append, beside=False)
    period_s = next(iter(settings.loops.values())).period_s
    try:
        for number in range(int(duration_s / period_s) + 1):
            clock.sleep_until(number * period_s)
            loop.cycle(number * period_s)
            yield from finished
            finished.clear()
    finally:
        loop.shut_down()


def stand_ins(settings: Settings) -> dict[str, SimulatedSettings]:
    """Return the tank that stands in for each real board, by the name of the board.

    It heats as fast as the board's loop says: with its litres, or else, whatever is behind that,
    1,500 W in as much water as it takes.

    Raises
    ------
    ConfigError
        The loop wants a power stage that a simulated board does not have.
    """
    return {
        name: _tank_for(name, settings, getattr(board, "mains_hz", 50.0))
        for name, board in settings.boards.items()
        if not isinstance(board, SimulatedSettings)
    }


def _tank_for(board: str, settings: Settings, mains_hz: float) -> SimulatedSettings:
    for loop, table in settings.loops.items():
        if any(each.board == board for each in table.outputs):
            if len({each.board for each in table.outputs}) > 1:
                raise ConfigError(
                    f"loop {loop!r} cannot be simulated: expected its heater and its cooler on one "
                    f"board, got {', '.join(each.board for each in table.outputs)}"
                )
            litres = table.volume_l or _STAND_IN_W / (WATER_J_PER_L_K * table.gain_k_per_s)
            volume_l = clamp(litres, *_VOLUMES_L)
            heater_w = clamp(WATER_J_PER_L_K * volume_l * table.gain_k_per_s, *_POWERS_W)
            try:
                return SimulatedSettings(
                    volume_l=volume_l,
                    heater_w=heater_w,
                    cooler_w=heater_w * _cooling_share(table),
                    ice_kg=0.0 if _cooling_share(table) else None,
                    bits=12,
                    power_stage=table.outputs[0].law,
                    second_sensor=table.second_sensor is not None,
                    mains_hz=mains_hz,
                )
            except ValidationError as error:
                raise ConfigError(f"loop {loop!r} cannot be simulated: {error}") from error
    return SimulatedSettings()


def _rewired(table: LoopTable, tanks: Mapping[str, SimulatedSettings]) -> LoopTable:
    """Return `table` with the sensor and the channels that a simulated board has."""
    sensor, actuator = table.sensor, table.actuator
    if table.leads is not None and sensor is not None and sensor.board in tanks:
        raise ConfigError("a loop that leads another one needs simulated boards to be simulated")
    if sensor is not None and sensor.board in tanks:
        reference_v = tanks[sensor.board].reference_v
        sensor = SensorTable(board=sensor.board, curve="lm335", reference_v=reference_v)
    if isinstance(actuator, ActuatorTable) and actuator.board in tanks:
        alone = action_of(plan_for(table).controller) == COOL
        actuator = actuator.model_copy(update=_COOLER if alone else {"output": "heater"})
    cooler = table.cooler
    if cooler is not None and cooler.board in tanks:
        cooler = cooler.model_copy(update=_COOLER)
    second = table.second_sensor
    if second is not None and sensor is not None:
        if sensor.board in tanks:
            second = sensor.model_copy(update={"input": SECOND_INPUT})  # they are in one tank
        elif second.board in tanks:
            raise ConfigError("a simulated sensor has its second one on simulated boards only")
    parts = {"sensor": sensor, "second_sensor": second, "actuator": actuator, "cooler": cooler}
    return table.model_copy(update=parts)


def _cooling_share(table: LoopTable) -> float:
    """Return what a stand-in's cooler takes out over what its heater brings in; 0: none."""
    controller = plan_for(table).controller
    if action_of(controller) == COOL:
        return 1.0
    return 0.0 if table.cooler is None else float(getattr(controller, "cooling_ratio", 1.0))
