"""Events to the journal, without ever making the loop wait.

Where they go is found out once: native fields when stderr is connected to journald, coloured
lines on a terminal, one JSON object a line otherwise. A thread writes; the loop only appends to a
bounded feed, so that a terminal that was stopped, or a full pipe, costs lines and no cycle.
"""

from __future__ import annotations

import os
import re
import socket
import struct
import threading
import time
from collections.abc import Callable, Mapping, MutableMapping
from contextlib import suppress
from datetime import UTC, datetime
from typing import Any, Final, NoReturn

from thermoctl.services.events import PRIORITIES, level_of
from thermoctl.services.feed import Feed
from thermoctl.services.plain import as_json, plain_text
from thermoctl.signals import Event

STDERR: Final = 2
JOURNAL_SOCKET: Final = "/run/systemd/journal/socket"
POLL_S: Final = 0.2
"""How long a line may wait for the writer's thread; waking it would need a lock."""

LONGEST: Final = 4096
"""Characters of one field, so that a datagram stays far below what a socket takes."""

Record = Mapping[str, Any]
"""``timestamp``, ``level``, ``event``, ``loop`` where there is one, and the fields."""

Sink = Callable[[Record], None]


class Journal:
    """Takes events from any thread and writes them from its own.

    Parameters
    ----------
    sink : callable
        Writes one record; may block, and may raise `OSError`.
    wall_clock : callable
        Seconds since 1970 UTC.
    feed_size : int
        Records that wait for the sink before the oldest go.
    """

    def __init__(
        self,
        sink: Sink,
        *,
        wall_clock: Callable[[], float] = time.time,
        feed_size: int = 1024,
    ) -> None:
        self._sink, self._wall_clock = sink, wall_clock
        self._feed: Feed[dict[str, Any]] = Feed(feed_size)
        self._failed = self._told = 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    def emit(self, event: Event, loop: str | None = None) -> None:
        """Put `event` of `loop` into the journal: one append, whatever the sink is doing."""
        self._put(level_of(event.name), event.name, loop, {**event.fields, "t_s": event.t_s})

    def processor(self, logger: Any, method: str, event_dict: MutableMapping[str, Any]) -> NoReturn:
        """End structlog's chain: what any logger of the process says comes here."""
        fields = dict(event_dict)
        name, loop = str(fields.pop("event", "")), fields.pop("loop", None)
        self._put(method if method in PRIORITIES else "info", name, loop, fields)
        from structlog import DropEvent

        raise DropEvent

    def configure(self) -> None:
        """Make this journal the end of every structlog logger of the process."""
        import structlog  # see human_sink

        structlog.configure(processors=[self.processor], cache_logger_on_first_use=False)

    @property
    def dropped(self) -> int:
        """How many records were lost to a slow or a failing sink."""
        return self._feed.dropped + self._failed

    def write_waiting(self) -> None:
        """Write everything emitted so far.

        This is one turn of the journal's thread, and only that thread may call it once started.
        """
        for record in self._feed.take():
            lost = self.dropped
            if lost > self._told and self._write(self._drops_record(lost)):
                self._told = lost
            self._failed += not self._write(record)

    def close(self, timeout_s: float = 1.0) -> bool:
        """Write what waits; return whether it went in time."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _put(self, level: str, name: str, loop: str | None, fields: Mapping[str, Any]) -> None:
        self._feed.put(self._record(level, name, loop, fields))

    def _record(
        self, level: str, name: str, loop: str | None, fields: Mapping[str, Any]
    ) -> dict[str, Any]:
        head: dict[str, Any] = {"timestamp": self._wall_clock(), "level": level, "event": name}
        if loop is not None:
            head["loop"] = loop
        return {**fields, **head}

    def _drops_record(self, total: int) -> dict[str, Any]:
        name = "journal.drops"
        return self._record(level_of(name), name, None, {"total": total})

    def _write(self, record: dict[str, Any]) -> bool:
        try:
            stamp = datetime.fromtimestamp(record["timestamp"], UTC)
            self._sink({**record, "timestamp": stamp.isoformat(timespec="milliseconds")})
        except (OSError, OverflowError, TypeError, ValueError):  # a field may hold anything
            return False
        return True

    def _run(self) -> None:
        while not self._closing.wait(POLL_S):
            self.write_waiting()
        self.write_waiting()


def sink_for(
    descriptor: int = STDERR,
    environ: Mapping[str, str] = os.environ,
    journal_socket: str = JOURNAL_SOCKET,
) -> Sink:
    """Return the sink that suits what `descriptor` is connected to."""
    if _is_journal(descriptor, environ) and os.path.exists(journal_socket):
        return native_sink(journal_socket)
    if os.isatty(descriptor):
        return human_sink(descriptor, colors=not environ.get("NO_COLOR"))
    return json_sink(descriptor)


def human_sink(descriptor: int, colors: bool) -> Sink:
    """Return a sink that writes lines for people, as structlog draws them."""
    # 12 MB with the terminal libraries it brings: a daemon without a terminal stays without it.
    import structlog

    render = structlog.dev.ConsoleRenderer(
        colors=colors, force_colors=colors, pad_event_to=22, sort_keys=False
    )

    def write(record: Record) -> None:
        shown = {plain_text(name): _shown(value) for name, value in record.items()}
        _write_all(descriptor, f"{render(None, '', shown)}\n".encode(errors="replace"))

    return write


def json_sink(descriptor: int) -> Sink:
    """Return a sink that writes one JSON object a line."""

    def write(record: Record) -> None:
        head = {name: record[name] for name in _HEAD if name in record}
        _write_all(descriptor, f"{as_json({**head, **record})}\n".encode(errors="replace"))

    return write


def native_sink(path: str) -> Sink:
    """Return a sink that writes journald's own protocol to its socket at `path`.

    So ``journalctl THERMOCTL_EVENT=...`` finds a line by its name and its values. The socket is
    opened for every record: events are rare, and a journald that was restarted is found again.
    """

    def write(record: Record) -> None:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as journald:
            journald.sendto(native(record), path)

    return write


def native(record: Record) -> bytes:
    """Return `record` as one datagram of systemd's "Native Journal Protocol"."""
    rest = {name: value for name, value in record.items() if name not in _HEAD}
    words = [str(record["event"]), *(f"{name}={_shown(value)}" for name, value in rest.items())]
    if "loop" in record:
        words.insert(0, f"{record['loop']}:")
    lines = {
        "MESSAGE": " ".join(words),
        "PRIORITY": PRIORITIES[record["level"]],
        "SYSLOG_IDENTIFIER": "thermoctl",
        "THERMOCTL_EVENT": record["event"],
    }
    if "loop" in record:
        lines["THERMOCTL_LOOP"] = record["loop"]
    for name, value in rest.items():
        lines.setdefault(f"THERMOCTL_{_journal_name(name)}", value)
    return b"".join(_field(name, str(value)[:LONGEST]) for name, value in lines.items())


_HEAD: Final = ("timestamp", "level", "event", "loop")


def _field(name: str, value: str) -> bytes:
    """A value with a line break needs the form with its length in front."""
    content = value.encode(errors="replace")
    if b"\n" not in content:
        return b"%s=%s\n" % (name.encode(), content)
    return b"%s\n%s%s\n" % (name.encode(), struct.pack("<Q", len(content)), content)


def _journal_name(name: str) -> str:
    """journald takes capitals, digits and underscores, 64 characters with our prefix."""
    return re.sub(r"[^A-Z0-9_]", "_", name.upper())[:50]


def _shown(value: Any) -> str:
    """A float as short as it is exact to seven digits; anything else as one line."""
    return f"{value:.7g}" if isinstance(value, float) else plain_text(value)


def _is_journal(descriptor: int, environ: Mapping[str, str]) -> bool:
    """Return whether `descriptor` is the stream that the service manager named."""
    with suppress(OSError):
        status = os.fstat(descriptor)
        return environ.get("JOURNAL_STREAM", "") == f"{status.st_dev}:{status.st_ino}"
    return False


def _write_all(descriptor: int, content: bytes) -> None:
    """Write past Python's buffers: a thread stuck in one of those hangs the interpreter's exit."""
    while content:
        content = content[os.write(descriptor, content) :]
