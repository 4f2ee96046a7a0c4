"""A board that may come and go: opened beside the loop, retried, closed safely."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Mapping
from typing import TypeVar, TypeVarTuple

from thermoctl.errors import DriverError, LinkError, TransientError, WrongDevice
from thermoctl.ports import Board, Clock, Identity, Simulated
from thermoctl.signals import RawSample

OPEN_S = 5.0
SILENT_S = 10.0
"""A board that has not answered at all for this long is taken for lost, and opened anew."""
_RETRY_FIRST_S, _RETRY_LAST_S = 1.0, 30.0
_NOT_YET = "not opened yet"

Report = Callable[..., None]
T = TypeVar("T")
Given = TypeVarTuple("Given")


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
        self._simulated: Simulated | None = None  # the same one, if it is: asked once, not a cycle
        self._opening: threading.Thread | None = None
        self._opened: Board | DriverError | None = None
        self._identity = Identity("", "", "")
        self._closed = False
        self._driven = False
        self._answered_s = float("-inf")
        self._retry_s = _RETRY_FIRST_S
        self._next_try_s = float("-inf")
        self.last_error = _NOT_YET

    @property
    def board(self) -> Board | None:
        """The open board, None while there is none."""
        return self._board

    @property
    def awaited(self) -> bool:
        """Whether its first opening is still under way, so that nothing has failed yet."""
        return self._board is None and self.last_error == _NOT_YET

    @property
    def driven(self) -> bool:
        """Whether an output may be on: a power was asked for, and no 0 confirmed since."""
        return self._driven

    def read(self, deadline_s: float) -> Mapping[str, RawSample]:
        """Return every input of the board; raise a `DriverError` when it did not answer."""
        board = self._connected()
        return self._exchanged(board.read, deadline_s)

    def write(
        self, outputs: Mapping[str, float], valid_for_s: float, deadline_s: float
    ) -> Mapping[str, float]:
        """Set `outputs`, return what was taken; raise a `DriverError` when refused."""
        board = self._connected()
        zero = not any(outputs.values())
        self._driven = self._driven or not zero
        taken = self._exchanged(board.write, outputs, valid_for_s, deadline_s)
        if zero and all(taken.get(name) == 0.0 for name in outputs):
            self._driven = False
        return taken

    def truth(self) -> Mapping[str, float]:
        """Return what a simulated board knows of its plant; nothing of any other."""
        return {} if self._simulated is None else self._simulated.truth()

    def close(self) -> None:
        """Let the board go, safe values first; one still opening is closed then."""
        self._closed = True
        if self._opening is not None:
            self._opening.join(timeout=0.2)
            self._collect()
        self._let_go()

    # -- coming and going ------------------------------------------------------------------------

    def _exchanged(
        self, exchange: Callable[[*Given], Mapping[str, T]], *given: *Given
    ) -> Mapping[str, T]:
        """Return what the board answers; one whose link is gone, or silent for long, is let go."""
        try:
            answer = exchange(*given)
        except LinkError as error:
            self._lose(error)
            raise
        except TransientError as error:
            silent_s = self._clock.now_s() - self._answered_s
            if silent_s < SILENT_S:
                raise
            lost = LinkError(f"no answer for {silent_s:.0f} s: {error}")
            self._lose(lost)
            raise lost from error
        self._answered_s = self._clock.now_s()
        return answer

    def _connected(self) -> Board:
        if self._board is None:
            self._advance()
        if self._board is None:
            raise LinkError(f"board {self.name!r}: {self.last_error}")
        return self._board

    def _advance(self) -> None:
        """Take what a thread has opened, or begin another try when it is time."""
        if self._closed:
            return
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
        opened = self._open()
        if self._closed and not isinstance(opened, DriverError):
            self._close_quietly(opened)  # nobody waits for it any more
        else:
            self._opened = opened

    def _open(self) -> Board | DriverError:
        board: Board | None = None
        try:
            board = self._build()
            self._identity = board.open(self._clock.now_s() + OPEN_S)
        except Exception as error:  # noqa: BLE001 - drivers come from entry points
            if board is not None:
                self._close_quietly(board)
            if isinstance(error, DriverError):
                return error
            if not isinstance(error, OSError):
                self._report("board.failed", board=self.name, trace=traceback.format_exc())
            return LinkError(f"{type(error).__name__}: {error}")
        return board

    def _collect(self) -> None:
        opened, self._opened, self._opening = self._opened, None, None
        if opened is None:
            opened = LinkError("opening it has not come to an end")
        if not isinstance(opened, DriverError):
            self._board, self._retry_s, self._driven = opened, _RETRY_FIRST_S, False
            self._simulated = opened if isinstance(opened, Simulated) else None
            self._answered_s = self._clock.now_s()
            who = self._identity
            self._report("board.opened", board=self.name, kind=who.kind, version=who.version)
            return
        self.last_error = str(opened)
        event = "board.wrong" if isinstance(opened, WrongDevice) else "board.retry"
        self._report(event, board=self.name, error=self.last_error, retry_s=self._retry_s)
        self._wait()

    def _wait(self) -> None:
        self._next_try_s = self._clock.now_s() + self._retry_s
        self._retry_s = min(2.0 * self._retry_s, _RETRY_LAST_S)

    def _lose(self, error: LinkError) -> None:
        self.last_error = str(error)
        self._report("board.lost", board=self.name, error=self.last_error)
        self._let_go()
        self._wait()

    def _let_go(self) -> None:
        board, self._board, self._simulated = self._board, None, None
        if board is not None:
            self._close_quietly(board)

    def _close_quietly(self, board: Board) -> None:
        """Close `board`; one that breaks its promise not to raise must not keep others on."""
        try:
            board.close()
        except Exception:  # noqa: BLE001 - drivers come from entry points
            self._report("board.failed", board=self.name, trace=traceback.format_exc())
