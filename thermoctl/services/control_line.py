"""One client of the control socket: bytes in, lines out, everything bounded."""

from __future__ import annotations

import socket
from typing import Final

from thermoctl.services.control_protocol import LONGEST, CallError

OUTBOX: Final = 65536
"""Bytes that may wait for a slow reader before it is let go."""

SILENT_S: Final = 30.0
"""A client without a complete line for this long is let go, unless it watches or waits."""

STUCK_S: Final = 5.0
"""A client that takes nothing of what waits for it is let go after this."""


GRACE_S: Final = 1.0
"""How long a client may be silent while others want its place."""


class ClientLine:
    """A connection that never blocks, and what waits on either side of it.

    Parameters
    ----------
    connection : socket
        The accepted connection.
    now_s : float
        Monotonic time in s.
    """

    def __init__(self, connection: socket.socket, now_s: float) -> None:
        connection.setblocking(False)
        self._connection = connection
        self._inbox, self._outbox = bytearray(), bytearray()
        self._ended = self._lost = self._last = False
        self.heard_s = self._moved_s = now_s

    def receive(self, now_s: float) -> None:
        """Take what has come, no more than one longest line.

        Raises
        ------
        CallError
            A line is longer than any may be.
        """
        room = LONGEST - len(self._inbox)
        if self._ended or self._last or room <= 0:
            return
        try:
            content = self._connection.recv(room)
        except BlockingIOError:
            return
        except OSError:
            self._lost = True
            return
        self._ended = not content
        self._inbox += content
        if b"\n" in content:
            self.heard_s = now_s
        elif len(self._inbox) >= LONGEST:
            self._inbox.clear()
            raise CallError("too_long", f"a line of at most {LONGEST} bytes", "a longer one")

    def line(self) -> bytes | None:
        """Return the next complete line without its end, None while there is none."""
        end = self._inbox.find(b"\n")
        if end < 0 or self._last:
            return None
        line = bytes(self._inbox[:end])
        del self._inbox[: end + 1]
        return line

    def say(self, content: bytes, *, last: bool = False) -> None:
        """Let `content` wait to be sent; after the `last`, nothing is heard or said."""
        if not self._last:
            self._outbox += content
            self._last = last

    def send(self, now_s: float) -> None:
        """Send what the client takes now."""
        if not self._outbox:
            self._moved_s = now_s
            return
        try:
            sent = self._connection.send(self._outbox, socket.MSG_NOSIGNAL)
        except BlockingIOError:
            return
        except OSError:
            self._lost = True
            return
        del self._outbox[:sent]
        self._moved_s = now_s

    def over(self, now_s: float, *, busy: bool) -> bool:
        """Return whether to let it go: gone, done, too slow, or silent while not `busy`."""
        if self._lost or len(self._outbox) > OUTBOX or now_s - self._moved_s > STUCK_S:
            return True
        if self._outbox or busy:
            return False
        finished = self._last or (self._ended and b"\n" not in self._inbox)
        return finished or now_s - self.heard_s > SILENT_S

    def eviction_rank(self, now_s: float, *, busy: bool) -> tuple[bool, bool, int, float]:
        """Return how readily it makes room for others; the greatest goes first.

        Who has closed its side, then who is silent while not `busy`, then who has sent the most
        that nobody has looked at yet: never who has just come to ask one thing.
        """
        silent_s = now_s - self.heard_s
        return self._ended, not busy and silent_s > GRACE_S, len(self._inbox), silent_s

    def close(self) -> None:
        """Let the connection go."""
        self._connection.close()
