"""The loop: wakes at absolute deadlines and walks one sample through the house.

Start reading at `Loop._walk`; the numbers beside it are those of the walk in
``docs/architecture.md``. Everything around it is about what to do when something fails, and the
answer is always: power 0, said loudly, and on with the next cycle.
"""

from __future__ import annotations

import math
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import TypeVarTuple

from thermoctl.errors import DriverError, FaultError, LinkError
from thermoctl.ports import Clock
from thermoctl.regulator.limits import command_lasts_s
from thermoctl.runtime.asked import Asked, RequestQueue
from thermoctl.runtime.cascade import Cascade, hand_down, outer_first
from thermoctl.runtime.connection import Connection
from thermoctl.runtime.wiring import Input, Output, Wiring, signed
from thermoctl.signals import Cycle, Event, Measurement, Quality, RawSample, Request, Step

EXCHANGE_S = 0.2
"""No exchange with a board may take longer; a hanging one costs one sample, not the deadline."""
SUSPENDED_S = 3.0
"""A wake later than this means the machine slept: power 0 before anything else."""
FRESH_S = 3.0
"""A sample older than this, or than one and a half periods of a slow loop, is STALE."""
AWAITED_S = 10.0
"""How long the first step waits for boards that are being opened for the first time."""
_EVENTS = 256

Publish = Callable[[Cycle], None]
Args = TypeVarTuple("Args")


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
        Called after every completed cycle, never after one in which something failed that no
        driver and no law may do: feeds the watchdog.
    """

    def __init__(
        self,
        wirings: Iterable[Wiring],
        clock: Clock,
        period_s: float,
        publish: Publish,
        completed: Callable[[], None] = lambda: None,
    ) -> None:
        self.wirings = outer_first(wirings)
        self._named = {each.name: each for each in self.wirings}
        self.boards = tuple({id(b): b for w in self.wirings for b in w.boards}.values())
        self._outputs = {
            id(b): tuple((w, output) for w in self.wirings for output in w.on(b))
            for b in self.boards
        }
        self._clock, self._period_s = clock, period_s
        self._lasts_s = command_lasts_s(period_s)
        self._fresh_s = max(FRESH_S, 1.5 * period_s)
        self._publish, self._completed = publish, completed
        self._requests = RequestQueue(self.wirings, self.report)
        self._events: deque[tuple[str, Mapping[str, object]]] = deque(maxlen=_EVENTS)
        self._silent: set[str] = set()
        self._sound = True
        self._failure = ""
        self._stopping = False
        self._begun_s = math.inf
        self._cascade = Cascade(self.wirings)
        self.cycles = 0
        self.missed = 0

    # -- from other threads ----------------------------------------------------------------------

    def ask(self, request: Request, loop: str | None = None) -> Asked:
        """Put a request into the queue that is read at the top of the next cycle.

        What is returned is settled once that cycle is published, for whoever wants the answer.
        """
        return self._requests.put(request, loop)

    def stop(self) -> None:
        """End `run` after the cycle that is under way; a signal handler may call it."""
        self._stopping = True

    @property
    def stopping(self) -> bool:
        """Whether `stop` has been called."""
        return self._stopping

    def report(self, name: str, **fields: object) -> None:
        """Add an event to the next published cycle."""
        self._events.append((name, fields))

    def take_events(self) -> tuple[Event, ...]:
        """Return what was reported since the last cycle was published."""
        if not self._events:
            return ()
        now_s = self._clock.now_s()
        taken = [self._events.popleft() for _ in range(len(self._events))]
        return tuple(Event(now_s, name, fields) for name, fields in taken)

    # -- time ------------------------------------------------------------------------------------

    def run(self, until_s: float = math.inf) -> None:
        """Run until `stop` or `until_s`; missed deadlines are never caught up.

        `shut_down` must follow, whatever ended it.
        """
        deadline_s = self._clock.now_s()
        while not self.stopping and deadline_s <= until_s:
            self._clock.sleep_until(deadline_s)  # 1. wake
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
        """Walk one sample of every loop; what fails ends in heat off, and is said."""
        self._sound = True
        try:
            self._walk(deadline_s)
        except Exception as error:  # noqa: BLE001 - the last line of defence ends in "heater off"
            self._all_off()
            self._fail(self.wirings, "cycle.failed", error)
            self._publish_failed()
        self._requests.settle()
        if self._sound:
            self.cycles += 1
            self._failure = ""
            self._call_isolated(self._completed)  # 15. alive

    def shut_down(self) -> bool:
        """Write power 0 to every board, let them go; return whether all must be off."""
        confirmed = self._all_off()
        for board in self.boards:
            board.close()
        return confirmed

    # -- the walk of a sample --------------------------------------------------------------------

    def _walk(self, deadline_s: float) -> None:
        now_s = self._clock.now_s()
        late_s = now_s - deadline_s if now_s > deadline_s else 0.0
        if late_s > SUSPENDED_S:
            self._all_off()
            self.report("cycle.late", late_s=late_s)
        self._requests.grant()  # 2. requests
        samples, seen = {}, {}  # filled in loops: a comprehension takes twice as long
        for board in self.boards:
            samples[id(board)] = self._read(board)  # 3. read
        if self._boards_awaited():
            return  # no reading is missing yet, and no output is on
        for wiring in self.wirings:
            seen[wiring.name] = self._measure(wiring, samples)  # 4. measure
        leading = self._cascade.tell(seen)
        walked, steps = [], {}
        for wiring in self.wirings:
            begin_ns = time.thread_time_ns()
            steps[wiring.name] = step = wiring.regulator.step(seen[wiring.name])  # 5 to 12
            walked.append((wiring, step, (time.thread_time_ns() - begin_ns) / 1000.0))
            hand_down(wiring, step.command.power, self._named)
        self._cascade.gave = accepted = self._write(steps, leading)  # 13. write
        events = self.take_events()
        for wiring, step, tick_us in walked:  # 14. publish
            taken = accepted[wiring.name]
            self._call_isolated(self._publish_cycle, wiring, step, events, taken, tick_us, late_s)

    def _boards_awaited(self) -> bool:
        """Return whether a board is being opened for the first time, and is not late yet.

        All loops wait for it: one that follows another must not begin before its master.
        """
        now_s = self._clock.now_s()
        if now_s < self._begun_s:
            self._begun_s = now_s
        return now_s - self._begun_s < AWAITED_S and any(each.awaited for each in self.boards)

    def _read(self, board: Connection) -> Mapping[str, RawSample]:
        try:
            samples = board.read(self._clock.now_s() + EXCHANGE_S)
        except LinkError as error:
            if not board.awaited:
                self._report_fault(board, "board.lost", 13, str(error))
        except DriverError as error:
            if isinstance(error, FaultError) and self._dependents(board):
                self._report_fault(board, "board.fault", 25, str(error))
            elif board.name not in self._silent:
                self.report("board.silent", board=board.name, error=str(error))
                self._silent.add(board.name)
        except Exception as error:  # noqa: BLE001 - drivers come from entry points
            users = self._dependents(board)
            if users or board.name not in self._silent:  # a board that can be spared: once
                self._fail(users, "cycle.failed", error)
            self._silent.add(board.name)
        else:
            self._silent.discard(board.name)
            return samples
        return {}

    def _measure(
        self, wiring: Wiring, samples: Mapping[int, Mapping[str, RawSample]]
    ) -> Measurement:
        """Return what the sensor of a loop says, or its two sensors together."""
        first = self._measure_input(wiring, wiring.inputs[0], samples)
        if wiring.second is None:
            return first
        return wiring.regulator.fuse(first, self._measure_input(wiring, wiring.second, samples))

    def _measure_input(
        self, wiring: Wiring, read: Input, samples: Mapping[int, Mapping[str, RawSample]]
    ) -> Measurement:
        """Return what an input says; a sample that is not of these seconds is STALE."""
        now_s = self._clock.now_s()
        try:
            measurement = read.sensor.measure(samples[id(read.board)].get(read.channel), now_s)
            if -EXCHANGE_S <= now_s - measurement.t_s <= self._fresh_s:
                return measurement
        except Exception as error:  # noqa: BLE001 - of a sample that a plug-in made
            self._fail((wiring,), "cycle.failed", error)
            return Measurement(now_s, quality=Quality.MISSING)
        old = measurement.quality is Quality.GOOD
        return replace(
            measurement, t_s=now_s, quality=Quality.STALE if old else measurement.quality
        )

    def _write(self, steps: Mapping[str, Step], leading: Mapping[str, float]) -> dict[str, float]:
        """Give every board its drives; return the accepted power by loop, `leading` ones too."""
        taken: dict[Output, float] = {}
        for board in self.boards:
            wired = self._outputs[id(board)]
            if not wired or board.board is None:
                continue
            now_s = self._clock.now_s()
            drives, powers, lasts_s = {}, {}, self._lasts_s  # at most, whatever a sample says
            for w, o in wired:
                command = steps[w.name].command
                drives[o.channel] = self._drive(w, o, command.power)
                left_s = command.valid_until_s - now_s
                lasts_s = left_s if left_s < lasts_s else lasts_s
            try:
                answer = board.write(drives, lasts_s, now_s + EXCHANGE_S)
                for _, o in wired:
                    powers[o] = o.power(answer.get(o.channel))
            except DriverError as error:
                lost = isinstance(error, LinkError)
                code, fault = ("board.lost", 13) if lost else ("output.refused", 22)
                self._report_fault(board, code, fault, str(error))
            except Exception as error:  # noqa: BLE001 - drivers come from entry points
                self._off(board)
                self._fail(self._dependents(board), "cycle.failed", error)
            else:
                taken.update(powers)
        accepted = dict(leading)
        for wiring in self.wirings:
            if wiring.outputs:
                accepted[wiring.name] = self._accepted(wiring, taken)
        return accepted

    def _accepted(self, wiring: Wiring, taken: Mapping[Output, float]) -> float:
        """Return the power that a loop's outputs took, after telling its regulator."""
        shares = []
        for output in wiring.outputs:
            if output not in taken:
                return math.nan
            shares.append(taken[output])
        accepted = signed(shares)
        wiring.regulator.applied(accepted)
        return accepted

    def _drive(self, wiring: Wiring, output: Output, power: float) -> float:
        """Return the drive for `power`; a law that fails costs its own loop the heat, no other."""
        try:
            return output.law.drive_for(wiring.share(output, power))
        except Exception as error:  # noqa: BLE001 - the other loops on this board go on
            self._fail((wiring,), "cycle.failed", error)
            return 0.0

    def _publish_cycle(
        self,
        wiring: Wiring,
        step: Step,
        events: tuple[Event, ...],
        accepted: float,
        tick_us: float,
        late_s: float,
    ) -> None:
        """Publish the finished cycle of one loop."""
        told = replace(step, events=(*step.events, *events)) if events else step
        truth = wiring.truth()
        self._publish(Cycle(wiring.name, told, accepted, tick_us, late_s, self.missed, truth))

    # -- when something fails --------------------------------------------------------------------

    def _dependents(self, board: Connection) -> tuple[Wiring, ...]:
        """Return the loops that cannot do without `board`."""
        return tuple(w for w in self.wirings if board in w.needs)

    def _report_fault(self, board: Connection, code: str, fault: int, text: str) -> None:
        """Send every loop that depends on `board` to SAFE."""
        for wiring in self._dependents(board):
            wiring.regulator.fault(code, fault, text)

    def _fail(self, wirings: Iterable[Wiring], code: str, error: Exception) -> None:
        """Send `wirings` to SAFE for an error that nobody foresaw, and say where it came from."""
        text = f"{type(error).__name__}: {error}"
        if text != self._failure or code != "cycle.failed":  # not the same again every second
            self._failure = text
            self.report(code, error=text, trace=traceback.format_exc())
        for wiring in wirings:
            wiring.regulator.fault(code, 58, text)
            self._sound = False

    def _all_off(self) -> bool:
        """Write power 0 to every output there is; return whether no output can be on."""
        confirmed = True
        for board in self.boards:  # every one, whatever the one before says
            confirmed = self._off(board) and confirmed
        return confirmed

    def _off(self, board: Connection) -> bool:
        drives = {output.channel: 0.0 for _, output in self._outputs[id(board)]}
        if drives and board.board is not None:
            try:
                board.write(drives, EXCHANGE_S, self._clock.now_s() + EXCHANGE_S)
            except DriverError:
                return False  # said by the caller; the board's dead-man does the rest
            except Exception as error:  # noqa: BLE001 - the next board must be written too
                self._fail((), "cycle.failed", error)
                return False
        return not board.driven

    def _publish_failed(self) -> None:
        """Publish a cycle without a reading for one that failed, so that it is seen and heard."""
        events = self.take_events()
        unread = Measurement(self._clock.now_s(), quality=Quality.MISSING)

        def publish(wiring: Wiring) -> None:
            self._publish_cycle(wiring, wiring.regulator.step(unread), events, math.nan, 0.0, 0.0)

        for wiring in self.wirings:
            self._call_isolated(publish, wiring)

    def _call_isolated(self, call: Callable[[*Args], None], *args: *Args) -> None:
        """Make a call that must steer nothing; one that fails is told of, and that is all."""
        try:
            call(*args)
        except Exception as error:  # noqa: BLE001 - readers may fail in any way
            self._fail((), "feed.failed", error)
