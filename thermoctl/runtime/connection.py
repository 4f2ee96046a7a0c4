"""A board that may come and go: opened beside the loop, retried with back-off, closed safely."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

from thermoctl.errors import DriverError, LinkError, WrongDevice
from thermoctl.ports import Board, Clock
from thermoctl.signals import RawSample

OPEN_S = 5.0
_RETRY_FIRST_S, _RETRY_LAST_S = 1.0, 30.0

Report = Callable[..., None]


class Connection:
    """One board of the configuration, connected or trying to be.

    Opening may take seconds (many boards reset when their port is opened), so with `beside` it
    happens in a thread of its own and the loop goes on; a simulation opens at once instead.

    Parameters
    ----------
    name : str
        Name of the board in the configuration.
    build : callable
        Returns a board that is not yet open; may raise a `DriverError` or `OSError`.
    clock : Clock
        The loop's clock.
    report : callable
        Called as ``report(name, **fields)`` for ``board.opened``, ``board.lost``, ...
    beside : bool
        Open in a thread of its own.
    """

    def __init__(
        self,
        name: str,
        build: Callable[[], Board],
        clock: Clock,
        report: Report,
        *,
        beside: bool = True,
    ) -> None:
        self.name = name
        self._build, self._clock, self._report, self._beside = build, clock, report, beside
        self._board: Board | None = None
        self._opening: threading.Thread | None = None
        self._opened: Board | DriverError | None = None
        self._retry_s = _RETRY_FIRST_S
        self._next_try_s = float("-inf")
        self.last_error = "not opened yet"

    @property
    def board(self) -> Board | None:
        """The open board, None while there is none."""
        return self._board

    def read(self, deadline_s: float) -> Mapping[str, RawSample]:
        """Return every input of the board; raise a `DriverError` when it did not answer."""
        board = self._connected()
        try:
            return board.read(deadline_s)
        except LinkError as error:
            self._lose(error)
            raise

    def write(
        self, outputs: Mapping[str, float], valid_for_s: float, deadline_s: float
    ) -> Mapping[str, float]:
        """Set `outputs` and return what the board took; raise a `DriverError` when it refused."""
        board = self._connected()
        try:
            return board.write(outputs, valid_for_s, deadline_s)
        except LinkError as error:
            self._lose(error)
            raise

    def close(self) -> None:
        """Let the board go, safe values first; a thread that is still opening closes its own."""
        self._next_try_s = float("inf")
        if self._opening is not None:
            self._opening.join(timeout=0.2)
            self._collect()
        if self._board is not None:
            self._board.close()
            self._board = None

    # -- coming and going ------------------------------------------------------------------------

    def _connected(self) -> Board:
        if self._board is None:
            self._advance()
        if self._board is None:
            raise LinkError(f"board {self.name!r}: {self.last_error}")
        return self._board

    def _advance(self) -> None:
        """Take what a thread has opened, or begin another try when it is time."""
        if self._opening is None and self._clock.now_s() >= self._next_try_s:
            if not self._beside:
                self._opened = self._open()
                self._collect()
                return
            self._opening = threading.Thread(
                target=self._open_beside, name=f"open {self.name}", daemon=True
            )
            self._opening.start()
        if self._opening is not None and not self._opening.is_alive():
            self._collect()

    def _open_beside(self) -> None:
        self._opened = self._open()

    def _open(self) -> Board | DriverError:
        board: Board | None = None
        try:
            board = self._build()
            identity = board.open(self._clock.now_s() + OPEN_S)
        except (DriverError, OSError) as error:
            if board is not None:
                board.close()
            return error if isinstance(error, DriverError) else LinkError(str(error))
        self._report("board.opened", board=self.name, kind=identity.kind, version=identity.version)
        return board

    def _collect(self) -> None:
        opened, self._opened, self._opening = self._opened, None, None
        if opened is None:
            return
        if not isinstance(opened, DriverError):
            self._board, self._retry_s = opened, _RETRY_FIRST_S
            if self._next_try_s == float("inf"):  # closed while it was opening
                self.close()
            return
        self.last_error = str(opened)
        event = "board.wrong" if isinstance(opened, WrongDevice) else "board.retry"
        self._report(event, board=self.name, error=self.last_error, retry_s=self._retry_s)
        self._wait()

    def _wait(self) -> None:
        if self._next_try_s != float("inf"):
            self._next_try_s = self._clock.now_s() + self._retry_s
            self._retry_s = min(2.0 * self._retry_s, _RETRY_LAST_S)

    def _lose(self, error: LinkError) -> None:
        self.last_error = str(error)
        self._report("board.lost", board=self.name, error=self.last_error)
        board, self._board = self._board, None
        if board is not None:
            board.close()
        self._wait()
