"""Consumers of finished cycles that think for longer than a loop may wait.

They have a thread of their own behind a bounded feed, never steer, and lose the oldest cycles when
they are slow. One that fails is dropped and told of, and the loop goes on.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

from thermoctl.services.feed import Feed
from thermoctl.signals import Cycle

W = TypeVar("W")

Report = Callable[..., None]

_FEED = 1_200
_TURN_S = 0.5


class Beside(ABC, Generic[W]):
    """Shows finished cycles to a watch of each loop, in a thread.

    Parameters
    ----------
    name : str
        Name of the thread.
    failed : str
        Name of the event that tells of a watch that was dropped.
    watches : mapping
        A watch by the name of its loop.
    report : callable
        Called as ``report(name, loop, **fields)`` in the thread.
    """

    def __init__(self, name: str, failed: str, watches: Mapping[str, W], report: Report) -> None:
        self._failed, self._watches, self._report = failed, dict(watches), report
        self._feed: Feed[Cycle] = Feed(_FEED)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @abstractmethod
    def look(self, watch: W, cycle: Cycle) -> None:
        """Show `cycle` to its watch; the one thing a service has to add."""

    def start(self) -> None:
        """Begin to watch."""
        self._thread.start()

    def publish(self, cycle: Cycle) -> None:
        """Take a finished cycle and return at once; a slow thread loses the oldest."""
        self._feed.put(cycle)

    def step(self, cycle: Cycle) -> None:
        """Take a finished cycle and look at it at once, as a simulation may."""
        self.publish(cycle)
        self.turn()

    def close(self, timeout_s: float = 1.0) -> None:
        """End the thread; what it has not looked at is nobody's loss."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def turn(self) -> None:
        """Look at what was published since the last turn; one turn of the thread."""
        for cycle in self._feed.take():
            if self._closing.is_set():
                return
            watch = self._watches.get(cycle.loop)
            if watch is not None:
                self._shown(watch, cycle)

    def _shown(self, watch: W, cycle: Cycle) -> None:
        try:
            self.look(watch, cycle)
        except Exception as error:  # noqa: BLE001 - the loop goes on without it
            del self._watches[cycle.loop]
            text = f"{type(error).__name__}: {error}"
            self._report(self._failed, cycle.loop, error=text)

    def _run(self) -> None:
        while not self._closing.wait(_TURN_S):
            self.turn()
