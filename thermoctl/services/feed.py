"""A bounded feed from the loop to a thread; drops the oldest, counted."""

from __future__ import annotations

import itertools
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Feed(Generic[T]):
    """Many may put, one takes; nobody ever waits and no lock is held.

    A deque with a limit drops its oldest item by itself and in silence. Every item carries its
    number, so the taker sees from the last number and from how many it took what is missing.

    Parameters
    ----------
    size : int
        Items kept while nobody takes, at least 1.
    """

    def __init__(self, size: int) -> None:
        if size < 1:
            raise ValueError(f"size must be at least 1, got {size!r}")
        self._items: deque[tuple[int, T]] = deque(maxlen=size)
        self._numbers = itertools.count()
        self._taken = self._dropped = 0

    def put(self, item: T) -> None:
        """Append `item`; the oldest goes when the feed is full."""
        self._items.append((next(self._numbers), item))

    def take(self) -> list[T]:
        """Return what has been put since the last call, oldest first."""
        taken = []
        for _ in range(len(self._items)):  # not "while": a fast producer would never let go
            number, item = self._items.popleft()
            self._taken += 1
            self._dropped = number + 1 - self._taken
            taken.append(item)
        return taken

    @property
    def dropped(self) -> int:
        """How many items were lost, as of the last `take`."""
        return self._dropped

    def __len__(self) -> int:
        return len(self._items)
