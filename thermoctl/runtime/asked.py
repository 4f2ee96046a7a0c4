"""Requests on their way to the loops, and their answers on the way back."""

from __future__ import annotations

import queue
from collections.abc import Callable, Sequence

from thermoctl.errors import Refused
from thermoctl.runtime.wiring import Wiring
from thermoctl.signals import Request

_UNFINISHED = "the cycle that took it failed"


class Asked:
    """A request in the loop's queue; its asker may look at it or withdraw it.

    The loop and the asker race for it: the first of the two decides whether it is granted or
    withdrawn, and neither ever waits for the other, because popping a list is one step.

    Parameters
    ----------
    request : Request
        What is wanted.
    loop : str or None
        The loop that is asked; None: all of them.
    """

    def __init__(self, request: Request, loop: str | None = None) -> None:
        self.request, self.loop = request, loop
        self._open = [True]
        self._refusal: str | None = _UNFINISHED
        self._settled = False

    def claim(self) -> bool:
        """Take it for good; return whether nobody has before. Called by the loop."""
        try:
            return self._open.pop()
        except IndexError:
            return False

    withdraw = claim
    """Take it back; True: the loop will never grant it, False: it already has it."""

    def decide(self, refusal: str | None) -> None:
        """Note what became of it: None when granted. Called by the loop."""
        self._refusal = refusal

    def settle(self) -> None:
        """Let the asker see the answer; called by the loop once the cycle is published."""
        self._settled = True

    @property
    def settled(self) -> bool:
        """Whether there is an answer, and a published cycle that shows what came of it."""
        return self._settled

    @property
    def refusal(self) -> str | None:
        """Why it was refused, None when granted; only worth reading once it is settled."""
        return self._refusal


class RequestQueue:
    """Requests of all threads: granted at the top of a cycle, answered at its end.

    Parameters
    ----------
    wirings : sequence of Wiring
        The loops that may be asked.
    report : callable
        Called as ``report(name, **fields)`` for ``request.refused``.
    """

    def __init__(self, wirings: Sequence[Wiring], report: Callable[..., None]) -> None:
        self._wirings, self._report = wirings, report
        self._waiting: queue.SimpleQueue[Asked] = queue.SimpleQueue()
        self._claimed: list[Asked] = []

    def put(self, request: Request, loop: str | None) -> Asked:
        """Append a request to `loop`, None: to all of them. Called from any thread."""
        asked = Asked(request, loop)
        self._waiting.put(asked)
        return asked

    def qsize(self) -> int:
        """Return how many wait for the next cycle."""
        return self._waiting.qsize()

    def grant(self) -> None:
        """Hand what has come so far to the loops that it is meant for."""
        for _ in range(self._waiting.qsize()):  # what comes meanwhile waits for the next cycle
            asked = self._waiting.get_nowait()
            if asked.claim():
                self._claimed.append(asked)
                asked.decide(self._grant(asked))

    def _grant(self, asked: Asked) -> str | None:
        """Hand a request to the loops it is meant for; return the refusal, if any."""
        meant = [each for each in self._wirings if asked.loop in (None, each.name)]
        refusal = None if meant else f"there is no loop {asked.loop!r}"
        if not meant:
            self._report("request.refused", loop=asked.loop, why=refusal)
        for wiring in meant:
            try:
                wiring.regulator.request(asked.request)
            except Refused as refused:
                refusal = str(refused)
                self._report("request.refused", loop=wiring.name, why=refusal)
        return refusal

    def settle(self) -> None:
        """Answer what this cycle took, now that everybody can see the outcome."""
        for asked in self._claimed:
            asked.settle()
        self._claimed.clear()
