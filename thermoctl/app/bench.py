"""``thermoctl --sim``: the bench test, as a live view or as JSON lines.

Loop, view and keys share one thread: while the loop sleeps between two cycles, keys are read and
the picture is drawn. So a disturbance never meets a tank in the middle of a step.
"""

from __future__ import annotations

import json
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import click

from thermoctl import __version__
from thermoctl.app.compose import loop_for
from thermoctl.app.cycle_record import as_line
from thermoctl.app.daemon.insight_watch import InsightService, insights_for
from thermoctl.app.daemon.order_service import OrderService, order_service
from thermoctl.app.doubts import doubts
from thermoctl.app.live import Action, Desk, Facts, Keys, LiveModel, LiveScreen, look_for
from thermoctl.app.live.desk import DISTURBANCES
from thermoctl.app.live.look import printable
from thermoctl.app.report import Summary, closing_lines, off_lines
from thermoctl.app.settings import Settings
from thermoctl.errors import Refused
from thermoctl.ports import Simulated
from thermoctl.runtime.clock import PacedClock
from thermoctl.runtime.loop import Loop
from thermoctl.services.history.schema import RunInfo
from thermoctl.services.history.writer import HistoryWriter
from thermoctl.services.places import make_private, state_dir
from thermoctl.signals import Cycle, Event

HISTORY = "sim.sqlite"
_DRAW_S = 0.05
_BACKLOG = 2000
_COMMIT_S = 0.1
"""At full speed three thousand cycles a second would lie about, each with all that was believed in
it, before the usual commit once a second: memory that has left every cache, and a backlog."""


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """What the command line says of a bench test."""

    speed: float
    duration_s: float
    as_json: bool
    history: Path | None


def run_bench(settings: Settings, options: BenchOptions) -> None:
    """Run the bench test until its time is over, or somebody ends it."""
    with ExitStack() as stack:
        clock = PacedClock(options.speed)
        sinks: list[Callable[[Cycle], None]] = []

        def publish(cycle: Cycle) -> None:
            for sink in sinks:
                sink(cycle)

        loop = loop_for(settings, clock, publish, beside=False)
        stack.callback(loop.shut_down)
        for doubt in doubts(settings):
            loop.report(doubt.event, loop=doubt.loop, key=doubt.key, text=doubt.text)
            if options.as_json:  # which has no events
                click.echo(f"thermoctl: {doubt}", err=True)
        _end_on_signals(loop, clock)
        if options.history is not None:
            sinks.append(stack.enter_context(_recorded(settings, options.history)))
        summary = Summary()
        sinks.append(summary.add)
        orders = order_service(settings.loops, _reports(loop))
        if orders is not None:
            sinks.append(orders.step)
        if options.as_json:
            sinks.append(_json_lines(loop, orders, flush=math.isfinite(options.speed)))
        else:
            insight = InsightService(insights_for(settings.loops), _reports(loop))
            view = stack.enter_context(
                _LiveBench.on_terminal(settings, loop, clock, options, insight)
            )
            sinks += [insight.step, view.take]
            clock.idle = view.idle
        loop.run(until_s=options.duration_s)
    _tell(summary, options)


def _end_on_signals(loop: Loop, clock: PacedClock) -> None:
    def end(number: int, frame: object) -> None:
        loop.stop()
        clock.interrupt()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, end)


def _tell(summary: Summary, options: BenchOptions) -> None:
    figures = summary.as_dict()
    if options.as_json:
        sys.stdout.write(json.dumps({"summary": figures}, allow_nan=False) + "\n")
        sys.stdout.flush()
        for line in off_lines(figures):
            click.echo(f"thermoctl: {line}", err=True)
        return
    look = look_for(sys.stderr.encoding)
    for line in closing_lines(figures):
        click.echo(printable(line, utf8=look.utf8), err=True)


def _reports(loop: Loop) -> Callable[..., None]:
    """Return what puts an event of somebody beside a loop among its own."""

    def report(name: str, of: str, **fields: object) -> None:
        loop.report(name, loop=of, **fields)

    return report


def _json_lines(loop: Loop, orders: OrderService | None, *, flush: bool) -> Callable[[Cycle], None]:
    """Write a line a cycle; when nobody reads any more there is nothing left to run for."""

    def sink(cycle: Cycle) -> None:
        try:
            beside = {} if orders is None else orders.keys(cycle.loop)
            sys.stdout.write(as_line(cycle, beside) + "\n")
            if flush:
                sys.stdout.flush()
        except BrokenPipeError:
            # What is still buffered goes nowhere, so that the exit stays silent too.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            loop.stop()

    return sink


@contextmanager
def _recorded(settings: Settings, path: Path) -> Iterator[Callable[[Cycle], None]]:
    """Record every cycle; a run faster than the disk waits for it instead of losing cycles."""
    run = RunInfo(__version__, settings.as_json())
    writer = HistoryWriter(path, run, commit_every_s=_COMMIT_S)
    writer.start()
    counted = 0

    def sink(cycle: Cycle) -> None:
        nonlocal counted
        writer.publish(cycle)
        counted += 1
        if counted % (_BACKLOG // 4) == 0:
            waited_until_s = time.monotonic() + 5.0
            while (
                writer.health().counters["waiting"] > _BACKLOG and time.monotonic() < waited_until_s
            ):
                time.sleep(0.01)

    try:
        yield sink
    finally:
        if not writer.close(timeout_s=10.0):
            click.echo(f"thermoctl: not every cycle reached {path}", err=True)


def history_path(state: Path | None) -> Path | None:
    """Return where a bench test is recorded, or None where it cannot be."""
    try:
        return make_private(state or state_dir()) / HISTORY
    except Exception as error:  # noqa: BLE001 - a bench test without its record is still one
        click.echo(f"thermoctl: no history is kept: {error}", err=True)
        return None


class _LiveBench:
    """The live view of a bench test: takes cycles, draws when the loop is idle, obeys keys."""

    def __init__(
        self,
        loop: Loop,
        clock: PacedClock,
        model: LiveModel,
        screen: LiveScreen,
        keys: Keys,
        insight: InsightService,
    ) -> None:
        self._loop, self._clock, self._insight = loop, clock, insight
        self._model, self._screen, self._keys = model, screen, keys
        self._desk = Desk(model.facts)
        self._last: Cycle | None = None
        self._drawn_s = 0.0
        self._paused = False

    @staticmethod
    @contextmanager
    def on_terminal(
        settings: Settings,
        loop: Loop,
        clock: PacedClock,
        options: BenchOptions,
        insight: InsightService,
    ) -> Iterator[_LiveBench]:
        """Take the terminal over, and give it back whatever happens."""
        name, table = settings.loop()
        low_c, high_c = table.setpoint_range_c
        speed = options.speed if math.isfinite(options.speed) else None
        facts = Facts(
            name, table.period_s, low_c, high_c, datetime.now(UTC).astimezone(), speed=speed
        )
        model = LiveModel(facts)
        with Keys(sys.stdin.fileno()) as keys, LiveScreen(model) as screen:
            yield _LiveBench(loop, clock, model, screen, keys, insight)

    def take(self, cycle: Cycle) -> None:
        """Feed the view; at full speed this is also where it gets a turn."""
        self._model.feed(cycle, self._insight.insight(cycle.loop))
        self._last = cycle
        if time.monotonic() - self._drawn_s > _DRAW_S:
            self.idle(0.0)

    def idle(self, timeout_s: float) -> None:
        """Spend up to `timeout_s` on keys, then draw if it is time to."""
        for action in self._keys.poll(min(timeout_s, _DRAW_S)):
            self._obey(action)
        self._screen.draw(self._clock.now_s(), self._desk.prompt, paused=self._paused)
        self._drawn_s = time.monotonic()

    def _obey(self, action: Action) -> None:
        if action is Action.QUIT:
            self._loop.stop()
            self._clock.interrupt()
        elif action is Action.PAUSE:
            self._clock.pause()
            self._paused = not self._paused
        elif action in DISTURBANCES:
            self._disturb(action)
        elif self._last is not None:
            request = self._desk.press(action, self._last.step)
            if request is not None:
                self._loop.ask(request, self._last.loop)

    def _disturb(self, action: Action) -> None:
        for connection in self._loop.boards:
            plant: object = connection.board
            if isinstance(plant, Simulated):
                try:
                    what = plant.disturb(action.value)
                except Refused as refusal:
                    what = str(refusal)
                self._model.note(Event(self._clock.now_s(), "sim.disturbed", {"text": what}))
