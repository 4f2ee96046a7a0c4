"""The bounded feed: finished cycles on their way to whoever wants them.

A slow reader loses its oldest cycles and is told how many; the loop never waits for it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from thermoctl.signals import Cycle


class Subscription:
    """The cycles one reader has not taken yet, at most `capacity` of them."""

    def __init__(self, capacity: int) -> None:
        self._waiting: deque[Cycle] = deque(maxlen=capacity)
        self.dropped = 0

    def put(self, cycle: Cycle) -> None:
        """Add a cycle; the oldest makes room for it."""
        if len(self._waiting) == self._waiting.maxlen:
            self.dropped += 1
        self._waiting.append(cycle)

    def take(self) -> list[Cycle]:
        """Return what has come since the last call, oldest first."""
        taken = []
        while self._waiting:
            taken.append(self._waiting.popleft())
        return taken


class Feed:
    """Hands every published cycle to every reader."""

    def __init__(self) -> None:
        self._readers: list[Callable[[Cycle], None]] = []

    def subscribe(self, capacity: int = 1000) -> Subscription:
        """Return a new subscription; `capacity` bounds its memory."""
        subscription = Subscription(capacity)
        self._readers.append(subscription.put)
        return subscription

    def call(self, reader: Callable[[Cycle], None]) -> None:
        """Call `reader` with every cycle, in the loop's thread; it must return at once."""
        self._readers.append(reader)

    def publish(self, cycle: Cycle) -> None:
        """Hand `cycle` to every reader."""
        for reader in self._readers:
            reader(cycle)
