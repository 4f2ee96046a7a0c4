"""Keep the latches on disk as the regulator has them; notice deletions.

The loop says what is latched and goes on; a thread does the I/O. The file follows the regulator,
never the other way round: one that was deleted is written again at once and the deletion is handed
on as a request, so that a request that is refused, or a kill in between, leaves the latch in force.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Final

from thermoctl.services.store import Latch, LatchStore
from thermoctl.signals import Alarm, Event

POLL_S: Final = 0.5
"""How soon a deleted file is noticed, and a failed write tried again."""


class LatchKeeper:
    """Stores latches, watches their files, and never lets the loop wait for either.

    Parameters
    ----------
    store : LatchStore
        Where they are kept.
    on_ack : callable
        Receives the name of a loop whose latch file somebody has deleted, in the keeper's thread;
        expected to put a request into the loop's queue.
    wall_clock : callable
        Seconds since 1970 UTC.
    report : callable or None
        Receives ``latch.unsaved`` and ``latch.saved`` when that changes, in the keeper's thread.
    poll_s : float
        Time between two looks at the files.
    """

    def __init__(
        self,
        store: LatchStore,
        on_ack: Callable[[str], None],
        *,
        wall_clock: Callable[[], float] = time.time,
        report: Callable[[Event], None] | None = None,
        poll_s: float = POLL_S,
    ) -> None:
        self._store, self._on_ack = store, on_ack
        self._wall_clock, self._report, self._poll_s = wall_clock, report, poll_s
        self._told: queue.SimpleQueue[tuple[str, Latch | None] | None] = queue.SimpleQueue()
        self._last_told: dict[str, str | None] = {}
        self._wanted: dict[str, Latch | None] = {}
        self._durable: dict[str, bool] = {}
        self._error: str | None = None
        self._told_problem: str | None = None
        self._since_s = 0.0
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="latches", daemon=True)

    def start(self) -> None:
        """Begin to write and to watch."""
        self._thread.start()

    def latched(self, loop: str, alarm: Alarm) -> None:
        """Say that `loop` is latched by `alarm`; cheap enough to repeat every cycle."""
        if self._last_told.get(loop) == alarm.code:
            return
        self._last_told[loop], self._since_s = alarm.code, alarm.since_s
        latch = Latch(alarm.code, alarm.text, alarm.fault, self._wall_clock())
        self._told.put((loop, latch))

    def cleared(self, loop: str) -> None:
        """Say that `loop` is not latched any more; cheap enough to repeat every cycle.

        Only a latch that was told through `latched` is removed: one that lies on the disk and was
        never handed to the regulator is not ours to forget.
        """
        if self._last_told.get(loop) is None:
            return
        self._last_told[loop] = None
        self._told.put((loop, None))

    def close(self, timeout_s: float = 1.0) -> bool:
        """Write what is wanted a last time; return whether the disk agrees."""
        self._told.put(None)
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        return not self._thread.is_alive() and self.problem is None

    @property
    def problem(self) -> str | None:
        """Why the disk does not hold what it should, or None; changes with every pass."""
        if self._error is not None:
            return self._error
        held = sorted(loop for loop, durable in self._durable.items() if not durable)
        return f"only the spare folder holds the latch of {', '.join(held)}" if held else None

    def keep(self) -> None:
        """Make one pass: bring every file in line, and hand on what was deleted.

        This is one turn of the keeper's thread, and only that thread may call it once started.
        """
        self._take_news()
        self._error = None
        for loop, latch in list(self._wanted.items()):
            try:
                if latch is None:
                    self._store.clear(loop)
                    del self._wanted[loop]
                else:
                    self._hold(loop, latch)
            except OSError as error:
                self._error = f"the latch of {loop} on disk: {error}"
        self._tell_changes()

    def _tell_changes(self) -> None:
        problem, before = self.problem, self._told_problem
        self._told_problem = problem
        if self._report is None or (problem is None) == (before is None):
            return
        if problem is None:
            self._report(Event(self._since_s, "latch.saved"))
        else:
            self._report(Event(self._since_s, "latch.unsaved", {"why": problem}))

    def _take_news(self) -> None:
        while True:
            try:
                self._accept(self._told.get_nowait())
            except queue.Empty:
                return

    def _accept(self, news: tuple[str, Latch | None] | None) -> None:
        if news is None:
            self._closing = True
            return
        loop, latch = news
        self._wanted[loop] = latch
        self._durable.pop(loop, None)

    def _hold(self, loop: str, latch: Latch) -> None:
        held = self._durable.get(loop)
        if held is not None and not self._store.exists(loop):
            del self._durable[loop]  # so that it is handed on once, even if writing fails now
            self._on_ack(loop)
        if not held or loop not in self._durable:
            before = self._store.load(loop)  # a latch that survived a restart keeps its date
            if before is not None and before.code == latch.code:
                latch = replace(latch, since_utc_s=before.since_utc_s)
            self._durable[loop] = self._store.save(loop, latch)

    def _run(self) -> None:
        while not self._closing:
            with suppress(queue.Empty):
                self._accept(self._told.get(timeout=self._poll_s))
            self.keep()
