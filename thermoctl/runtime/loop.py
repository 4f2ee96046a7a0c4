"""The loop: wakes at absolute deadlines and walks one sample through the house.

Start reading at `Loop._walk`; everything around it is about what to do when something fails, and
the answer is always: power 0, said loudly, and on with the next cycle.
"""

from __future__ import annotations

import math
import queue
import time
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from thermoctl.errors import DriverError, LinkError, Refused
from thermoctl.model.actuator import ActuatorLaw
from thermoctl.model.sensor import Sensor
from thermoctl.ports import Clock, Simulated
from thermoctl.regulator import Regulator
from thermoctl.runtime.connection import Connection
from thermoctl.signals import Cycle, Event, RawSample, Request, Step

EXCHANGE_S = 0.2
"""No exchange with a board may take longer; a hanging one costs one sample, not the deadline."""
SUSPENDED_S = 3.0
"""A wake later than this means the machine slept: power 0 before anything else."""

Publish = Callable[[Cycle], None]


@dataclass(frozen=True, slots=True)
class Wiring:
    """One loop and what it is connected to."""

    name: str
    regulator: Regulator
    sensor_board: Connection
    input: str
    sensor: Sensor
    actuator_board: Connection
    output: str
    law: ActuatorLaw


class Loop:
    """Runs every wired loop in one thread, once a period.

    Parameters
    ----------
    wirings : sequence of Wiring
        The loops; they share boards, and each board is read and written once a cycle.
    clock : Clock
        Monotonic or simulated.
    period_s : float
        Time between two cycles.
    publish : callable
        Takes every finished `Cycle`; must return at once.
    completed : callable
        Called after every completed cycle, never after a failed one: feeds the watchdog.
    """

    def __init__(
        self,
        wirings: Iterable[Wiring],
        clock: Clock,
        period_s: float,
        publish: Publish,
        completed: Callable[[], None] = lambda: None,
    ) -> None:
        self.wirings = tuple(wirings)
        self.boards = tuple(
            {id(b): b for w in self.wirings for b in (w.sensor_board, w.actuator_board)}.values()
        )
        self._clock, self._period_s = clock, period_s
        self._publish, self._completed = publish, completed
        self._requests: queue.SimpleQueue[tuple[str | None, Request]] = queue.SimpleQueue()
        self._events: list[tuple[str, Mapping[str, object]]] = []
        self._stopping = False
        self.cycles = 0
        self.missed = 0

    # -- from other threads ----------------------------------------------------------------------

    def ask(self, request: Request, loop: str | None = None) -> None:
        """Put a request into the queue that is read at the top of the next cycle."""
        self._requests.put((loop, request))

    def stop(self) -> None:
        """End `run` after the cycle that is under way; safe to call from a signal handler."""
        self._stopping = True

    @property
    def stopping(self) -> bool:
        """Whether `stop` has been called."""
        return self._stopping

    def report(self, name: str, **fields: object) -> None:
        """Add an event to the next published cycle."""
        self._events.append((name, fields))

    # -- time ------------------------------------------------------------------------------------

    def run(self, until_s: float = math.inf) -> None:
        """Run cycles until `stop` or `until_s`; missed deadlines are counted, never caught up.

        `shut_down` must follow, whatever ended it.
        """
        deadline_s = self._clock.now_s()
        while not self.stopping and deadline_s <= until_s:
            self._clock.sleep_until(deadline_s)
            if not self.stopping:
                self.cycle(deadline_s)
            deadline_s += self._period_s
            behind_s = self._clock.now_s() - deadline_s
            if behind_s > 0.0:
                skipped = math.ceil(behind_s / self._period_s)
                self.missed += skipped
                deadline_s += skipped * self._period_s
                self.report("cycle.missed", cycles=skipped, total=self.missed)

    def cycle(self, deadline_s: float) -> None:
        """Walk one sample of every loop; whatever fails, the heaters are off and it is said."""
        try:
            self._walk(deadline_s)
        except Exception as error:  # noqa: BLE001 - the last line of defence ends in "heater off"
            self._all_off()
            self.report(
                "cycle.failed",
                error=f"{type(error).__name__}: {error}",
                trace=traceback.format_exc(),
            )
            for wiring in self.wirings:
                wiring.regulator.fault("cycle.failed", 58, f"{type(error).__name__}: {error}")
        else:
            self.cycles += 1
            self._completed()

    def shut_down(self) -> bool:
        """Write power 0 to every board and let them go; return whether every board confirmed."""
        confirmed = self._all_off()
        for board in self.boards:
            board.close()
        return confirmed

    # -- the walk of a sample --------------------------------------------------------------------

    def _walk(self, deadline_s: float) -> None:
        late_s = max(0.0, self._clock.now_s() - deadline_s)
        if late_s > SUSPENDED_S:
            self._all_off()
            self.report("cycle.late", late_s=late_s)
        self._grant_requests()
        samples = {id(board): self._read(board) for board in self.boards}
        steps = []
        for wiring in self.wirings:
            raw = samples[id(wiring.sensor_board)].get(wiring.input)
            measurement = wiring.sensor.measure(raw, self._clock.now_s())
            begin_ns = time.thread_time_ns()
            step = wiring.regulator.step(measurement)
            steps.append((wiring, step, (time.thread_time_ns() - begin_ns) / 1000.0))
        accepted = self._write({wiring.name: step for wiring, step, _ in steps})
        events = self._take_events()
        for wiring, step, tick_us in steps:
            if events:
                step = replace(step, events=(*step.events, *events))
            truth = _truth(wiring.sensor_board)
            self._hand_out(
                Cycle(
                    wiring.name, step, accepted[wiring.name], tick_us, late_s, self.missed, truth
                )
            )

    def _read(self, board: Connection) -> Mapping[str, RawSample]:
        try:
            return board.read(self._clock.now_s() + EXCHANGE_S)
        except LinkError as error:
            self._tell(board, "board.lost", 13, str(error))
        except DriverError as error:
            self.report("board.silent", board=board.name, error=str(error))
        return {}

    def _write(self, steps: Mapping[str, Step]) -> dict[str, float]:
        """Give every board its drives in one exchange; return the accepted power by loop."""
        accepted = dict.fromkeys(steps, math.nan)
        now_s = self._clock.now_s()
        for board in self.boards:
            wired = [each for each in self.wirings if each.actuator_board is board]
            if not wired or board.board is None:
                continue
            drives = {w.output: w.law.drive_for(steps[w.name].command.power) for w in wired}
            valid_until_s = min(steps[w.name].command.valid_until_s for w in wired)
            try:
                taken = board.write(drives, valid_until_s - now_s, now_s + EXCHANGE_S)
            except DriverError as error:
                lost = isinstance(error, LinkError)
                code, fault = ("board.lost", 13) if lost else ("output.refused", 22)
                self._tell(board, code, fault, str(error))
                continue
            for wiring in wired:
                accepted[wiring.name] = wiring.law.power_from(taken.get(wiring.output, math.nan))
                wiring.regulator.applied(accepted[wiring.name])
        return accepted

    # -- when something fails --------------------------------------------------------------------

    def _tell(self, board: Connection, code: str, fault: int, text: str) -> None:
        """Send every loop that depends on `board` to SAFE."""
        for wiring in self.wirings:
            if board in (wiring.sensor_board, wiring.actuator_board):
                wiring.regulator.fault(code, fault, text)

    def _all_off(self) -> bool:
        """Write power 0 to every output there is; return whether every board took it."""
        confirmed = True
        for board in self.boards:
            drives = {
                w.output: w.law.drive_for(0.0) for w in self.wirings if w.actuator_board is board
            }
            if not drives or board.board is None:
                continue
            try:
                taken = board.write(drives, EXCHANGE_S, self._clock.now_s() + EXCHANGE_S)
                confirmed = confirmed and all(taken.get(output) == 0.0 for output in drives)
            except DriverError:
                confirmed = False  # said by the caller; the board's dead-man does the rest
        return confirmed

    def _hand_out(self, cycle: Cycle) -> None:
        """Publish `cycle`; a reader that fails is told of, and steers nothing."""
        try:
            self._publish(cycle)
        except Exception as error:  # noqa: BLE001 - readers may fail in any way
            self.report(
                "feed.failed",
                error=f"{type(error).__name__}: {error}",
                trace=traceback.format_exc(),
            )

    # -- small things ----------------------------------------------------------------------------

    def _grant_requests(self) -> None:
        while not self._requests.empty():
            loop, request = self._requests.get_nowait()
            for wiring in self.wirings:
                if loop in (None, wiring.name):
                    try:
                        wiring.regulator.request(request)
                    except Refused as refusal:
                        self.report("request.refused", loop=wiring.name, why=str(refusal))

    def _take_events(self) -> tuple[Event, ...]:
        if not self._events:
            return ()
        taken, self._events = self._events, []
        now_s = self._clock.now_s()
        return tuple(Event(now_s, name, fields) for name, fields in taken)


def _truth(board: Connection) -> Mapping[str, float]:
    return board.board.truth() if isinstance(board.board, Simulated) else {}
