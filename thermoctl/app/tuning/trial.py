"""Runs one loop through a test signal, with its supervisor in force.

In mode manual the signal asks as an operator would, through the queue of requests; what it asks for
is bounded, rated and refused like any other power. However it ends, power 0 is written last.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from thermoctl.app.compose import started_as
from thermoctl.app.settings import Settings
from thermoctl.errors import ConfigError
from thermoctl.ports import Clock
from thermoctl.runtime.loop import Loop, Publish
from thermoctl.signals import Cycle, ManualPower, Mode, Quality, State, Step
from thermoctl.studies.excitation import Course, Excitation
from thermoctl.studies.record import Collector, Columns

NAMES = Columns("temperature_c", "accepted_power", "t_s")
"""Columns of the record that is made, as the history calls them."""

FEWEST_PERIODS = 240
"""Periods a run needs: 149 whole samples for the usual candidates, the rest to heat up."""

LATE_PERIODS = 10.0
"""Periods after which a run ends that should have ended by itself."""

STORED_S = 60.0
"""The trip must be farther above the band than this long at high power could carry it."""

_OVER = (State.SAFE, State.LATCHED)


class Ending(StrEnum):
    """Why a run came to its end."""

    FINISHED = "finished"
    INTERRUPTED = "interrupted"
    FAULT = "fault"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What is left of a run.

    Parameters
    ----------
    ending : Ending
        Why it ended.
    why : str
        What the supervisor found, for a fault; else empty.
    off_confirmed : bool
        Whether every output is known to be off.
    hottest_c : float
        Highest good reading, in degC; minus infinity without one.
    reached : bool
        Whether the band was reached, so that there was a test signal at all.
    """

    ending: Ending
    why: str
    off_confirmed: bool
    hottest_c: float
    reached: bool


def plan(
    settings: Settings,
    name: str,
    powers: tuple[float, float] | None,
    band_k: float,
    duration_s: float,
    seed: int = 1,
) -> Excitation:
    """Return the test signal for a loop; its band ends at the set point.

    Parameters
    ----------
    settings : Settings
        With a loop called `name`.
    powers : tuple of float or None
        Low and high power; 0 and the most the loop may give when None.
    band_k : float
        Width of the band below the set point, in K.
    duration_s : float
        Length of the whole run, in s.

    Raises
    ------
    ConfigError
        The limits of the loop leave no room for it; the text says which.
    """
    table = settings.loop(name)[1]
    low, high = powers or (0.0, table.power_max)
    if high > table.power_max:
        raise ConfigError(
            f"expected powers up to {table.power_max:g}, the power_max of loop {name!r},"
            f" got {high:g}"
        )
    rise_k = table.gain_k_per_s * high
    top_c, bottom_c = table.setpoint_c, table.setpoint_c - band_k
    if not bottom_c >= table.setpoint_range_c[0]:
        raise ConfigError(
            f"expected a band within the set points of loop {name!r}, at least"
            f" {table.setpoint_range_c[0]:g} degC, got {bottom_c:g} to {top_c:g} degC"
        )
    if not top_c + STORED_S * rise_k < table.trip_above_c:
        raise ConfigError(
            f"expected a trip above {top_c + STORED_S * rise_k:.2f} degC, where {STORED_S:g} s at"
            f" high power lead from the top of the band, got trip_above_c {table.trip_above_c:g}"
        )
    if duration_s < FEWEST_PERIODS * table.period_s:
        raise ConfigError(
            f"expected a duration of at least {FEWEST_PERIODS * table.period_s:g} s,"
            f" {FEWEST_PERIODS} periods, got {duration_s:g} s"
        )
    early_k = rise_k * table.period_s
    try:
        return Excitation(low, high, bottom_c, top_c, duration_s, table.period_s, early_k, seed)
    except ValueError as problem:
        raise ConfigError(str(problem)) from problem


def alone(settings: Settings, name: str) -> Settings:
    """Return `settings` with the loop `name` only, in mode manual, and its boards."""
    table = settings.loop(name)[1]
    parts = (table.sensor, table.second_sensor, *table.outputs)
    used = {part.board for part in parts if part is not None}
    boards = {board: each for board, each in settings.boards.items() if board in used}
    single = settings.model_copy(update={"loops": {name: table}, "boards": boards})
    return started_as(single, {name: (Mode.MANUAL, table.setpoint_c)})


def _under_way_k(step: Step) -> float:
    """Return by how much heat that was given will still raise the reading, as far as is known."""
    plant = step.plant
    coming_k = 0.0 if plant is None else plant.coasting_c - step.measurement.temperature_c
    return max(coming_k, 0.0) if math.isfinite(coming_k) else 0.0


class Trial:
    """One run of a loop through a test signal.

    Parameters
    ----------
    name : str
        Name of the loop; its mode must be manual.
    excitation : Excitation
        As `plan` returns it.
    build : callable
        Returns the loop for a function that takes its finished cycles.
    clock : Clock
        The loop's clock.
    watch : callable
        Called with every finished cycle and the share of the run that is over.
    """

    def __init__(
        self,
        name: str,
        excitation: Excitation,
        build: Callable[[Publish], Loop],
        clock: Clock,
        watch: Callable[[Cycle, float], None] = lambda cycle, share: None,
    ) -> None:
        self._name, self._excitation = name, excitation
        self._clock, self._watch = clock, watch
        self._course = Course()
        self._begun_s = math.nan
        self._ending = Ending.INTERRUPTED
        self._why = ""
        self._failure: Exception | None = None
        self._hottest_c = -math.inf
        self.record = Collector(f"tune {name}", NAMES, nominal_s=excitation.period_s)
        self.loop = build(self._take)

    def run(self) -> Outcome:
        """Run to the end of the signal, a fault or `interrupt`; power 0 is written last.

        The time-out does not wait for a cycle that says so: it ends the loop itself.
        """
        excitation = self._excitation
        latest_s = self._clock.now_s() + excitation.duration_s + LATE_PERIODS * excitation.period_s
        try:
            self.loop.run(until_s=latest_s)
        finally:
            confirmed = self.loop.shut_down()
        if self._failure is not None:
            raise self._failure
        if not self.loop.stopping:
            self._ending = Ending.FINISHED
        reached = not self._course.approaching
        return Outcome(self._ending, self._why, confirmed, self._hottest_c, reached)

    def interrupt(self) -> None:
        """End the run after the cycle under way; a signal handler may call it."""
        self.loop.stop()

    def _take(self, cycle: Cycle) -> None:
        """Take a finished cycle; without this turn nobody would lower the power again."""
        try:
            self._follow(cycle)
        except Exception as error:
            self._failure = error
            self.loop.stop()
            raise

    def _follow(self, cycle: Cycle) -> None:
        step = cycle.step
        if math.isnan(self._begun_s):
            self._begun_s = step.t_s
        good = step.measurement.quality is Quality.GOOD
        temperature_c = step.measurement.temperature_c if good else math.nan
        self._keep(step.t_s, cycle.accepted_power, temperature_c)
        elapsed_s = step.t_s - self._begun_s
        if step.state in _OVER:
            rows = [alarm for alarm in step.alarms if alarm.latched or alarm.active]
            self._why = f"{rows[0].code}: {rows[0].text}" if rows else step.state.value
            self._end(Ending.FAULT)
        elif elapsed_s >= self._excitation.duration_s:
            self._end(Ending.FINISHED)
        else:
            self._course, power = self._excitation.after(
                self._course, step.t_s, temperature_c, _under_way_k(step)
            )
            self.loop.ask(ManualPower(power), self._name)
        self._watch(cycle, min(1.0, elapsed_s / self._excitation.duration_s))

    def _keep(self, t_s: float, power: float, temperature_c: float) -> None:
        """Put the sample into the record, or count it as one that is not known."""
        where = f"the cycle at {t_s - self._begun_s:g} s"
        if not math.isfinite(temperature_c):
            self.record.skip(where, "temperature_c is not known")
        elif not math.isfinite(power):
            self.record.skip(where, "accepted_power is not known")
        else:
            self._hottest_c = max(temperature_c, self._hottest_c)
            self.record.add(where, t_s, power, temperature_c)

    def _end(self, ending: Ending) -> None:
        self._ending = ending
        self.loop.stop()
