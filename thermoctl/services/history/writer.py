"""Put every cycle on disk from a thread of its own.

The loop hands a cycle over with one append to a bounded deque, and no lock is shared between that
append and any I/O: a commit that takes seconds, a full disk or a locked file cost rows, counted,
and never a late cycle. The tests in ``tests/faults/test_storage_history.py`` show each of them.
"""

from __future__ import annotations

import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Final

from thermoctl.ports import Health
from thermoctl.services.feed import Feed
from thermoctl.services.history.file import HistoryFile, Opened, Row, open_history
from thermoctl.services.history.schema import (
    INSERT_CLOCK_STEP,
    INSERT_CYCLE,
    INSERT_EVENT,
    RunInfo,
    event_row_of,
    row_of,
)
from thermoctl.signals import Cycle, Event

__all__ = ["HistoryWriter", "Opened", "open_history"]

CLOCK_STEP_S: Final = 1.0
"""Wall clock and loop clock apart by more than this between two cycles: the wall clock stepped."""

Report = Callable[[Event], None]

_Told = tuple[Event, str | None]


class HistoryWriter:
    """The history of one run of the daemon.

    Parameters
    ----------
    path : Path
        The database; its folder is made when it is missing.
    run : RunInfo
        What is recorded of this start.
    wall_clock : callable
        Seconds since 1970 UTC.
    report : callable or None
        Receives ``history.*`` and ``clock.stepped`` events, in the writer's thread.
    commit_every_s : float
        Time between two commits; at most this much is lost with the process.
    feed_size : int
        Cycles that wait for the writer before the oldest go; twice as many rows, cycles and
        events, wait for the disk.
    max_cycles : int
        Cycles kept in the file; the oldest go first. Counted in rows, not in days, because a wall
        clock that is a year ahead for a minute must not erase a year.
    """

    def __init__(
        self,
        path: Path,
        run: RunInfo,
        *,
        wall_clock: Callable[[], float] = time.time,
        report: Report | None = None,
        commit_every_s: float = 1.0,
        feed_size: int = 4096,
        max_cycles: int = 10_000_000,
    ) -> None:
        if max_cycles < 1:
            raise ValueError(f"max_cycles must be at least 1, got {max_cycles!r}")
        if not commit_every_s > 0.0:
            raise ValueError(f"commit_every_s must be positive, got {commit_every_s!r}")
        self._file = HistoryFile(Path(path), run, wall_clock, max_cycles)
        self._wall_clock = wall_clock
        self._report = report
        self._commit_every_s = commit_every_s
        self._feed: Feed[tuple[float, Cycle | _Told]] = Feed(feed_size)
        self._waiting: deque[Row] = deque(maxlen=2 * feed_size)  # events come on top of cycles
        self._lost_waiting = self._written = self._set_aside = 0
        self._reported_drops = 0
        self._last_t_s: float | None = None
        self._stored_t_s: float | None = None
        self._offset_s: float | None = None
        self._error: str | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="history", daemon=True)

    def start(self) -> None:
        """Begin to write; the file is opened in the writer's thread."""
        self._thread.start()

    def publish(self, cycle: Cycle) -> None:
        """Hand `cycle` over: one append, whatever the disk is doing."""
        self._feed.put((self._wall_clock(), cycle))

    def publish_event(self, event: Event, loop: str | None = None) -> None:
        """Hand over an event that belongs to no cycle, such as ``board.lost``."""
        self._feed.put((self._wall_clock(), (event, loop)))

    def close(self, timeout_s: float = 2.0) -> bool:
        """Write what waits and close the file; return whether all was in time.

        The thread is a daemon thread: a disk that hangs does not keep the process alive.
        """
        self._closing.set()
        if self._thread.ident is None:  # never started, so this thread is the only one
            self._finish()
        elif self._thread.is_alive():
            self._thread.join(timeout_s)
        return not (self._thread.is_alive() or self._feed or self._waiting)

    def health(self) -> Health:
        """Return how the recording is doing; ``down`` when nobody writes."""
        status = "ok" if self._error is None else "degraded"
        return Health(
            status=status if self._thread.is_alive() else "down",
            counters={
                "written": self._written,
                "dropped": self._dropped,
                "waiting": len(self._feed) + len(self._waiting),
                "set_aside": self._set_aside,
            },
            last_good_s=self._stored_t_s,
            last_error=self._error,
        )

    def store_waiting(self) -> bool:
        """Move everything published so far to the disk; return whether it is there.

        This is one pass of the writer's thread, and only that thread may call it once started.
        """
        self._drain()
        try:
            opened = self._file.ensure_open()
            if opened.set_aside is not None:
                self._set_aside += 1
                self._tell("history.set_aside", path=str(opened.set_aside), why=opened.why)
            if self._waiting:
                self._written += self._file.append(self._waiting)
                self._waiting.clear()
                self._stored_t_s = self._last_t_s
        except (sqlite3.Error, OSError) as error:
            self._file.give_up(error)
            self._failed(f"{type(error).__name__}: {error}")
            return False
        self._succeeded()
        return True

    @property
    def _dropped(self) -> int:
        return self._feed.dropped + self._lost_waiting

    def _run(self) -> None:
        while not self._closing.wait(self._commit_every_s):
            self.store_waiting()
        self._finish()

    def _finish(self) -> None:
        self.store_waiting()
        self._file.close()

    def _drain(self) -> None:
        """Turn what the loop published into rows."""
        for wall_utc_s, item in self._feed.take():
            if isinstance(item, Cycle):
                self._keep_cycle(wall_utc_s, item)
            else:
                self._keep((INSERT_EVENT, (wall_utc_s, *event_row_of(*item))))

    def _keep_cycle(self, wall_utc_s: float, cycle: Cycle) -> None:
        self._watch_wall_clock(wall_utc_s, cycle.step.t_s)
        try:
            self._keep((INSERT_CYCLE, (wall_utc_s, *row_of(cycle))))
        except (TypeError, ValueError, OverflowError):  # a plug-in's truth may hold anything
            self._lost_waiting += 1
        for event in cycle.step.events:
            self._keep((INSERT_EVENT, (wall_utc_s, *event_row_of(event, cycle.loop))))

    def _keep(self, row: Row) -> None:
        self._lost_waiting += len(self._waiting) == self._waiting.maxlen
        self._waiting.append(row)

    def _watch_wall_clock(self, wall_utc_s: float, t_s: float) -> None:
        """Mark a step: between two cycles both clocks must advance by the same amount."""
        self._last_t_s = t_s
        offset_s, before_s = wall_utc_s - t_s, self._offset_s
        self._offset_s = offset_s
        if before_s is None or abs(offset_s - before_s) <= CLOCK_STEP_S:
            return
        step_s = offset_s - before_s
        self._keep((INSERT_CLOCK_STEP, (wall_utc_s, t_s, step_s)))
        self._tell("clock.stepped", step_s=round(step_s, 3))

    def _failed(self, error: str) -> None:
        if self._error is None:
            self._tell("history.failed", why=error)
        self._error = error
        if self._dropped and not self._reported_drops:
            self._reported_drops = self._dropped
            self._tell("history.drops", dropped=self._dropped, why=error)

    def _succeeded(self) -> None:
        if self._error is not None:
            self._error = None
            self._tell("history.recovered", dropped=self._dropped)
        elif self._dropped > self._reported_drops:
            self._tell("history.drops", dropped=self._dropped, why="the disk was too slow")
        self._reported_drops = self._dropped

    def _tell(self, name: str, **fields: object) -> None:
        """Report an event of our own, and remember it beside those of the loops."""
        event = Event(self._last_t_s or 0.0, name, fields)
        self._keep((INSERT_EVENT, (self._wall_clock(), *event_row_of(event, None))))
        if self._report is not None:
            self._report(event)
