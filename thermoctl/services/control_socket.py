"""The control socket: clients of the daemon, served by a thread beside the loop.

One thread, and a pause after each of its turns: whatever clients do, they take a bounded share of
the processor, of memory and of file descriptors. What fails here is an event and costs no heat.
"""

from __future__ import annotations

import select
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Final, NamedTuple, Protocol

from thermoctl.errors import NotPermitted, Refused, Unavailable
from thermoctl.services.control_line import ClientLine
from thermoctl.services.control_place import ControlPlace
from thermoctl.services.control_protocol import Call, CallError, denied, granted, parse, told
from thermoctl.services.feed import Feed
from thermoctl.signals import Cycle

CLIENTS: Final = 16
"""Clients at once; one more takes the place of a silent or a greedy one."""

WATCHERS: Final = 8
"""Clients that may watch at once, so that those who only ask are never kept out."""

NEWCOMERS: Final = 16
"""Clients accepted in a turn; more wait for the next one."""

PAUSE_S: Final = 0.02
"""Pause after a turn that served anybody: fifty calls a second and client, and no more."""

QUIET_S: Final = 0.2
"""How long to wait for a first client before looking whether to end."""

RETRY_S: Final = 5.0
"""Pause before listening again, and between two looks at the path."""

_FEED: Final = 256

Report = Callable[..., None]
Pending = Callable[[], Mapping[str, Any] | None]
"""Asked again and again: the content of the reply, None while there is none yet."""


class Answering(Protocol):
    """Who answers calls: at once, and always in the same thread."""

    def answer(self, call: Call) -> Mapping[str, Any] | Pending:
        """Return the content of the reply, or what will have it; may raise `CallError`."""

    def record(self, cycle: Cycle) -> Mapping[str, Any]:
        """Return what a watching client is told of a finished cycle."""

    def details(self, cycle: Cycle) -> Mapping[str, Any]:
        """Return the rest of a cycle, for a client that asked for details."""


class _Told(NamedTuple):
    """A finished cycle in words; the details are only there if anybody wants them."""

    loop: str
    record: Mapping[str, Any]
    details: Mapping[str, Any] | None


class ControlSocket:
    """Listens at a path and hands calls on; cannot delay or end the loop.

    Parameters
    ----------
    place : ControlPlace
        Where to listen.
    answering : Answering
        Who answers.
    report : callable
        Called as ``report(name, None, **fields)`` in the thread of the socket.
    clock_s : callable
        Monotonic time in s.
    """

    def __init__(
        self,
        place: ControlPlace,
        answering: Answering,
        report: Report,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._place, self._answering, self._report = place, answering, report
        self._clock_s = clock_s
        self._feed: Feed[Cycle] = Feed(_FEED)
        self._clients: list[ClientLine] = []
        self._pending: dict[ClientLine, tuple[Call, Pending]] = {}
        self._watching: dict[ClientLine, Call] = {}
        self._problem: str | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="control socket", daemon=True)

    def start(self) -> None:
        """Begin to listen; what stands in the way is told of and tried again."""
        self._thread.start()

    def publish(self, cycle: Cycle) -> None:
        """Take a finished cycle for whoever watches, and return at once."""
        self._feed.put(cycle)

    def close(self, timeout_s: float = 1.0) -> None:
        """End the thread, let every client go and remove the socket."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    # -- the thread ------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                self._place.open()
                self._problem = None
                self._report("socket.opened", None, path=str(self._place.path))
                self._serve()
            except (Unavailable, NotPermitted) as error:
                self._tell("socket.unavailable", why=str(error))
            except Exception as error:  # noqa: BLE001 - a bug here must not end the socket for good
                text = f"{type(error).__name__}: {error}"
                self._tell("socket.failed", error=text, trace=traceback.format_exc())
            finally:
                self._let_all_go()
            self._closing.wait(RETRY_S)

    def _tell(self, name: str, **fields: object) -> None:
        """Report a problem once, not every time it is met again."""
        problem = str(fields.get("why", fields.get("error")))
        if problem != self._problem:
            self._problem = problem
            self._report(name, None, **fields)

    def _serve(self) -> None:
        look_at_s = self._clock_s() + RETRY_S
        while not self._closing.is_set():
            self.turn()
            self._closing.wait(PAUSE_S)
            if self._clock_s() >= look_at_s:
                look_at_s = self._clock_s() + RETRY_S
                if self._place.lost:
                    raise Unavailable(f"expected {self._place.path} to stay; something removed it")

    def turn(self) -> None:
        """Serve every client once; one turn of the thread."""
        listener = self._place.listener
        if listener is None:
            return
        if not self._clients:
            self._feed.take()
            select.select([listener], [], [], QUIET_S)
        with suppress(OSError):  # nobody is waiting, or whoever was has gone
            for _ in range(NEWCOMERS):
                connection, _ = listener.accept()
                self._admit(ClientLine(connection, self._clock_s()))
        told_of = [self._told_of(cycle) for cycle in self._feed.take() if self._watching]
        for client in tuple(self._clients):
            self._attend(client, told_of)

    def _admit(self, client: ClientLine) -> None:
        """Take a newcomer in and hear it; where all places are taken, somebody makes room."""
        if len(self._clients) >= CLIENTS:
            self._drop(self._first_to_evict())
        self._clients.append(client)
        self._attend(client, [])

    def _first_to_evict(self) -> ClientLine:
        """Return who makes room for others; there is one, for fewer watch than there are places."""
        now_s = self._clock_s()
        talking = [each for each in self._clients if each not in self._watching]
        return max(talking, key=lambda each: each.eviction_rank(now_s, busy=each in self._pending))

    def _told_of(self, cycle: Cycle) -> _Told:
        """Return what watching clients are told, made once for all of them."""
        wanted = any(call.argument for call in self._watching.values())
        details = self._answering.details(cycle) if wanted else None
        return _Told(cycle.loop, self._answering.record(cycle), details)

    # -- one client ------------------------------------------------------------------------------

    def _attend(self, client: ClientLine, cycles: Sequence[_Told]) -> None:
        """Hear one line of a client, answer it, send; drop a client that is done or too slow."""
        now_s = self._clock_s()
        busy = client in self._pending or client in self._watching
        watched = self._watching.get(client)
        for each in cycles if watched is not None else ():
            if watched is not None and watched.loop in (None, each.loop):
                details = each.details if watched.argument else None
                client.say(told(watched.call_id, each.record, details))
        try:
            client.receive(now_s)
            line = None if client in self._pending else client.line()
        except CallError as error:
            client.say(denied(None, error), last=True)
        else:
            if line is not None:
                self._hear(client, line)
        if client in self._pending:
            self._answer_later(client)
        client.send(now_s)
        if client.over(now_s, busy=busy):
            self._drop(client)

    def _hear(self, client: ClientLine, line: bytes) -> None:
        call: Call | None = None
        try:
            call = parse(line)
            if call.do == "watch":
                self._require_room(client)
            answer = self._answering.answer(call)
        except Exception as error:  # noqa: BLE001 - whatever a call can do, the others are served
            client.say(self._denial(call, error))
            return
        if callable(answer):
            self._pending[client] = (call, answer)
            return
        client.say(granted(call.call_id, answer))
        if call.do == "watch":
            self._watching[client] = call

    def _require_room(self, client: ClientLine) -> None:
        if client not in self._watching and len(self._watching) >= WATCHERS:
            expected = f"fewer than {WATCHERS} clients that watch"
            raise CallError("busy", expected, len(self._watching))

    def _answer_later(self, client: ClientLine) -> None:
        call, pending = self._pending[client]
        try:
            content = pending()
        except Exception as error:  # noqa: BLE001 - as above
            reply = self._denial(call, error)
        else:
            if content is None:
                return
            reply = granted(call.call_id, content)
        del self._pending[client]
        client.say(reply)

    def _denial(self, call: Call | None, error: Exception) -> bytes:
        """Return the reply to a call that failed; what nobody foresaw is told in full as well."""
        call_id = None if call is None else call.call_id
        if isinstance(error, CallError):
            return denied(error.call_id if call is None else call_id, error)
        if isinstance(error, Refused):
            return denied(call_id, CallError("refused", text=str(error)))
        text = f"{type(error).__name__}: {error}"
        self._tell("socket.failed", error=text, trace=traceback.format_exc())
        return denied(call_id, CallError("failed", text=text))

    def _drop(self, client: ClientLine) -> None:
        client.close()
        self._clients.remove(client)
        self._pending.pop(client, None)
        self._watching.pop(client, None)

    def _let_all_go(self) -> None:
        for client in tuple(self._clients):
            self._drop(client)
        self._place.close()
