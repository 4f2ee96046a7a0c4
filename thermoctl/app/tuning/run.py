"""Where ``thermoctl tune`` meets a board, or the simulated tank in its place.

A real board is taken as the daemon takes it: its locks first, then the latches of earlier runs,
and a latch of this one is on the disk before the run is over. What the loop's controllers have
learnt of a real plant is stored as the daemon stores it.
"""

from __future__ import annotations

import math
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from thermoctl.app.compose import loop_for
from thermoctl.app.daemon.daemon import SIGNALS, locks_of, state_for
from thermoctl.app.results import say
from thermoctl.app.settings import Settings
from thermoctl.app.tuning.trial import Outcome, Trial, alone
from thermoctl.errors import Refused
from thermoctl.runtime.clock import MonotonicClock, SimulatedClock
from thermoctl.runtime.loop import Loop, Publish
from thermoctl.services.events import level_of
from thermoctl.services.latches import LatchKeeper
from thermoctl.services.learned import LearnedStore, ModelKeeper
from thermoctl.services.places import make_private, runtime_dir
from thermoctl.services.store import LatchStore
from thermoctl.signals import Cycle
from thermoctl.studies.excitation import Excitation
from thermoctl.studies.record import Collector

Ran = tuple[Outcome, Collector]
"""How a run ended, and its samples."""


def run_simulated(settings: Settings, name: str, excitation: Excitation) -> Ran:
    """Run the loop `name` on its simulated tank, as fast as it goes."""
    clock = SimulatedClock()
    single = alone(settings, name)
    return _run(
        name, excitation, clock, lambda publish: loop_for(single, clock, publish, beside=False)
    )


def run_on_board(
    settings: Settings,
    name: str,
    excitation: Excitation,
    state: Path | None,
    consent: Callable[[], None],
) -> Ran:
    """Run the loop `name` on its board, once it is free and `consent` returns.

    Raises
    ------
    Unavailable
        A daemon, or another run, holds the state folder or a device.
    Refused
        The loop is latched.
    """
    directory = make_private(state_for(settings, state))
    with ExitStack() as stack:
        for lock in locks_of(settings, directory):
            stack.enter_context(lock)
        latches = LatchStore(directory, make_private(runtime_dir()))
        latch = latches.load(name)
        if latch is not None:
            raise Refused(
                f"expected a loop {name!r} that may heat, it is latched by {latch.code}:"
                f" {latch.text}; thermoctl alarms ack clears it once its cause is gone"
            )
        consent()
        keeper = LatchKeeper(latches, lambda loop: None)  # a latch ends the run: nobody to tell
        keeper.start()
        stack.callback(keeper.close)
        return _run_and_keep(alone(settings, name), name, excitation, keeper, directory)


def _run_and_keep(
    single: Settings, name: str, excitation: Excitation, keeper: LatchKeeper, directory: Path
) -> Ran:
    """Run the loop, its latches kept as they come and its models at the end."""
    last: dict[str, Cycle] = {}

    def keep(cycle: Cycle) -> None:
        last[cycle.loop] = cycle
        for alarm in cycle.step.alarms:
            if alarm.latched:
                keeper.latched(cycle.loop, alarm)

    clock = MonotonicClock()
    ran = _run(
        name,
        excitation,
        clock,
        lambda publish: loop_for(single, clock, publish, beside=False),
        keep,
    )
    learned = LearnedStore(directory)
    if ModelKeeper(learned, clock.now_s).store(last, at_end=True):
        say([f"{learned.path_of(name)} written: the next start begins with what was learnt"])
    return ran


def _run(
    name: str,
    excitation: Excitation,
    clock: MonotonicClock | SimulatedClock,
    build: Callable[[Publish], Loop],
    keep: Callable[[Cycle], None] = lambda cycle: None,
) -> Ran:
    """Run a trial that signals may end, with a bar for whoever watches."""
    with _bar(name) as show:

        def watch(cycle: Cycle, share: float) -> None:
            keep(cycle)
            say(_event_lines(cycle))
            show(cycle, share)

        trial = Trial(name, excitation, build, clock, watch)
        with _ended_by_signals(trial, clock):
            outcome = trial.run()
    return outcome, trial.record


@contextmanager
def _bar(name: str) -> Iterator[Callable[[Cycle, float], None]]:
    """Give a function that shows on a terminal how far a run is, and how warm the loop."""
    stderr = Console(stderr=True)
    with Progress(console=stderr, transient=True, disable=not stderr.is_terminal) as bar:
        task = bar.add_task(name, total=1.0)

        def show(cycle: Cycle, share: float) -> None:
            step = cycle.step
            temperature_c = step.measurement.temperature_c
            seen = f"{temperature_c:.1f}" if math.isfinite(temperature_c) else "no reading"
            words = f"{name} {seen}, {100 * step.command.power:.0f} %"
            bar.update(task, completed=share, description=words)

        yield show


@contextmanager
def _ended_by_signals(trial: Trial, clock: MonotonicClock | SimulatedClock) -> Iterator[None]:
    """Let signals end the run after the cycle under way, and give them back afterwards."""

    def end(number: int, frame: object) -> None:
        trial.interrupt()
        clock.interrupt()

    before = {number: signal.signal(number, end) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _event_lines(cycle: Cycle) -> list[str]:
    """Return what happened that somebody beside the tank should know."""
    return [
        f"{event.name}: {', '.join(f'{key} {value}' for key, value in event.fields.items())}"
        for event in cycle.step.events
        if level_of(event.name) != "info"
    ]
