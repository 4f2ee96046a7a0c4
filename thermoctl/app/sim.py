"""The bench test: loops on simulated tanks instead of their boards."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import resources
from pathlib import Path

from pydantic import BaseModel, ValidationError

from thermoctl.app.compose import loop_for, started_as
from thermoctl.app.settings import Settings, load
from thermoctl.errors import ConfigError
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import Cycle, Mode
from thermoctl_drivers.simulated import SimulatedSettings


def bench_settings(
    source: str | Path | Settings | None = None, seed: int | None = None
) -> Settings:
    """Return settings whose boards are all simulated and whose loops start in auto.

    Parameters
    ----------
    source : path or Settings, optional
        A configuration; the aquarium of O21 when not given. A real board in it is replaced by a
        tank behind the power stage that the loop's actuator law expects.
    seed : int, optional
        Seed of the simulation; that of the configuration when not given.

    Raises
    ------
    ConfigError
        The configuration is bad, or a loop uses a channel that a simulated board does not have.
    """
    settings = source if isinstance(source, Settings) else load(source or default_profile())
    boards = {name: _simulated(name, board, settings) for name, board in settings.boards.items()}
    if seed is not None:
        boards = {name: board.model_copy(update={"seed": seed}) for name, board in boards.items()}
    starts = {name: (Mode.AUTO, table.setpoint_c) for name, table in settings.loops.items()}
    return started_as(settings.model_copy(update={"boards": boards}), starts)


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


def _simulated(name: str, board: BaseModel, settings: Settings) -> SimulatedSettings:
    if isinstance(board, SimulatedSettings):
        return board
    for loop, table in settings.loops.items():
        if table.actuator is not None and table.actuator.board == name:
            try:
                return SimulatedSettings(
                    power_stage=table.actuator.law, mains_hz=getattr(board, "mains_hz", 50.0)
                )
            except ValidationError as error:
                raise ConfigError(f"loop {loop!r} cannot be simulated: {error}") from error
    return SimulatedSettings()
