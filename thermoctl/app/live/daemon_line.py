"""A daemon's loop as a view needs it: cycles come, requests go, and nobody waits.

Two threads do the waiting: one follows the loop's cycles and finds the daemon again when it has
gone, the other carries requests, one after the other. Whoever draws takes what has come.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final

from thermoctl.app.daemon.cycle_wire import cycle_from, insight_from
from thermoctl.errors import Refused, ThermoctlError, Unavailable
from thermoctl.insight import Insight
from thermoctl.services.control_client import ANSWER_S, ControlClient
from thermoctl.signals import Acknowledge, ChooseController, Cycle, Mode, Request, SetPoint

RETRY_S: Final = 1.0
"""Pause before a daemon that has gone is asked again."""

_WAIT_S: Final = 0.1


@dataclass(frozen=True, slots=True)
class Heard:
    """A finished cycle, and what is told of the plant after it."""

    cycle: Cycle
    insight: Insight | None


@dataclass(frozen=True, slots=True)
class Gone:
    """Nothing is heard of the loop at the moment."""

    why: str


@dataclass(frozen=True, slots=True)
class Denied:
    """A request was not granted, or never reached the loop."""

    why: str


@dataclass(frozen=True, slots=True)
class Met:
    """What a daemon says of one loop before the first cycle is heard.

    Parameters
    ----------
    loop : str
        Name of the loop.
    period_s : float
        Time between two of its samples.
    patience_s : float
        How long the daemon gives its loops to answer a request.
    ahead_s : float
        Loop time minus this machine's monotonic clock.
    """

    loop: str
    period_s: float
    patience_s: float
    ahead_s: float


def meet(socket: Path | None, loop: str | None) -> Met | list[str]:
    """Return what is known of the loop; all names where several are meant.

    Raises
    ------
    Refused
        There is no such loop.
    NotRunning, NotPermitted, Unavailable
        No daemon answers, or not to this user, or its loop finishes no cycle.
    """
    with ControlClient(socket) as client:
        until_s = time.monotonic() + ANSWER_S
        while True:
            told = client.ask("status", loop=loop)
            records, waiting = told["loops"], told["waiting"]
            if len(records) + len(waiting) > 1:
                return [*(each["loop"] for each in records), *waiting]
            if records:
                return _met(records[0], float(told["patience_s"]))
            if time.monotonic() > until_s:
                raise Unavailable(f"expected {waiting[0]} to finish a cycle, and it has not yet")
            time.sleep(_WAIT_S)


def _met(record: Mapping[str, Any], patience_s: float) -> Met:
    ahead_s = record["t_s"] + record["age_s"] - time.monotonic()
    return Met(record["loop"], float(record["period_s"]), patience_s, ahead_s)


def call_for(request: Request) -> dict[str, Any]:
    """Return the keys of the call that asks a daemon for `request`.

    Raises
    ------
    Refused
        No call asks for it.
    """
    match request:
        case Mode():
            return {"do": "mode", "mode": request.value}
        case SetPoint(value_c):
            return {"do": "set", "value_c": value_c}
        case ChooseController(name):
            return {"do": "controller", "name": name}
        case Acknowledge(code):
            return {"do": "ack", "code": code}
        case _:
            raise Refused(f"expected a request that a key can make, got {request!r}")


def most_urgent(waiting: list[Request]) -> list[Request]:
    """Return what is still worth asking for, in order.

    Of set points in a row the last one counts, and nothing that was asked for before Off does.
    """
    kept: list[Request] = []
    for request in waiting:
        if request is Mode.OFF:
            kept = [each for each in kept if isinstance(each, Acknowledge)]
        elif kept and isinstance(kept[-1], SetPoint) and isinstance(request, SetPoint):
            kept.pop()
        kept.append(request)
    return kept


class DaemonLine:
    """Both directions between a view and one loop of a daemon, as a context.

    A request waits for the answer to the one before it, so that they arrive in the order in which
    they were made.

    Parameters
    ----------
    socket : Path or None
        The daemon's socket; found as `ControlClient` does when not given.
    met : Met
        The loop.
    """

    def __init__(self, socket: Path | None, met: Met) -> None:
        self._socket, self._met = socket, met
        self._heard: SimpleQueue[Heard | Gone | Denied] = SimpleQueue()
        self._asked: SimpleQueue[Request | None] = SimpleQueue()
        self._closing = threading.Event()

    def __enter__(self) -> DaemonLine:
        for work in (self._follow, self._carry):
            threading.Thread(target=work, name=work.__name__, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        """Ask both threads to end; one that waits for a daemon ends with the process."""
        self._closing.set()
        self._asked.put(None)

    def take(self) -> list[Heard | Gone | Denied]:
        """Return what has come since the last call, the oldest first."""
        return _drained(self._heard)

    def ask(self, request: Request) -> None:
        """Hand a request over, and return at once; a refusal comes with `take`."""
        self._asked.put(request)

    def _follow(self) -> None:
        while not self._closing.is_set():
            try:
                with ControlClient(self._socket) as client:
                    for record, details in client.follow(self._met.loop):
                        self._heard.put(Heard(cycle_from(record, details), insight_from(details)))
            except ThermoctlError as error:
                self._heard.put(Gone(str(error)))
            self._closing.wait(RETRY_S)

    def _carry(self) -> None:
        while (first := self._asked.get()) is not None:
            rest = _drained(self._asked)
            for request in most_urgent([first, *(each for each in rest if each is not None)]):
                try:
                    self._call(request)
                except ThermoctlError as error:
                    self._heard.put(Denied(str(error)))
            if None in rest:
                return

    def _call(self, request: Request) -> None:
        with ControlClient(self._socket) as client:
            patience_s = self._met.patience_s + ANSWER_S
            client.ask(patience_s=patience_s, loop=self._met.loop, **call_for(request))


def _drained(queue: SimpleQueue[Any]) -> list[Any]:
    """Return all that waits in `queue`."""
    waiting = []
    while True:
        try:
            waiting.append(queue.get_nowait())
        except Empty:
            return waiting
