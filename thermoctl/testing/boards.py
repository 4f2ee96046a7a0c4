"""A board that follows a script."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from thermoctl.ports import Capabilities, Health, Identity
from thermoctl.signals import RawSample
from thermoctl.testing.clock import ManualClock


@dataclass(frozen=True, slots=True)
class Write:
    """One call of `ScriptedBoard.write`: when, what, and for how long."""

    t_s: float
    outputs: Mapping[str, float]
    valid_for_s: float
    deadline_s: float


class ScriptedBoard:
    """A board that follows a script and records what it is told.

    Parameters
    ----------
    clock : ManualClock
        Stamps samples and writes.
    reads : iterable
        One item a call of `read`: counts, a whole mapping of samples, None for an input that did
        not answer, or an exception to raise. The last item is repeated for ever.
    writes : iterable
        One item a call of `write`: the power that is taken, None for the one that was asked, or an
        exception to raise. The last item is repeated for ever.
    full_scale : float
        Of samples made from counts.
    takes_s : float
        How long each call takes on the clock.
    """

    Settings: ClassVar[type[Any]] = dict

    def __init__(
        self,
        clock: ManualClock,
        reads: Iterable[float | Mapping[str, RawSample] | BaseException | None] = (None,),
        writes: Iterable[float | BaseException | None] = (None,),
        *,
        full_scale: float = 1024.0,
        input_name: str = "temperature",
        capabilities: Capabilities | None = None,
        takes_s: float = 0.0,
    ) -> None:
        self.capabilities = capabilities or Capabilities(dead_man=True)
        self.written: list[Write] = []
        self.opened = self.closed = 0
        self._clock, self._takes_s = clock, takes_s
        self._reads, self._writes = list(reads), list(writes)
        self._full_scale, self._input_name = full_scale, input_name
        self._read_count = 0

    def open(self, deadline_s: float) -> Identity:
        """Count, and write power 0 as every board does."""
        self.opened += 1
        self.written.append(Write(self._clock.now_s(), {"heater": 0.0}, 0.0, deadline_s))
        return Identity(kind="scripted", name="script", version="1")

    def read(self, deadline_s: float) -> Mapping[str, RawSample]:
        """Return, or raise, the next item of the script."""
        del deadline_s
        item = self._reads[min(self._read_count, len(self._reads) - 1)]
        self._read_count += 1
        self._clock.advance(self._takes_s)
        if isinstance(item, BaseException):
            raise item
        if item is None:
            return {}
        if isinstance(item, Mapping):
            return item
        now_s = self._clock.now_s()
        return {self._input_name: RawSample(now_s, item, self._full_scale, self._read_count)}

    def write(
        self, outputs: Mapping[str, float], valid_for_s: float, deadline_s: float
    ) -> Mapping[str, float]:
        """Record the call; return, or raise, what the script says."""
        call = Write(self._clock.now_s(), dict(outputs), valid_for_s, deadline_s)
        done = len(self.written) - self.opened
        item = self._writes[min(done, len(self._writes) - 1)]
        self.written.append(call)
        self._clock.advance(self._takes_s)
        if isinstance(item, BaseException):
            raise item
        return dict(outputs) if item is None else dict.fromkeys(outputs, item)

    def health(self) -> Health:
        """Return ``ok`` while it is open."""
        return Health("ok" if self.opened > self.closed else "down")

    def close(self) -> None:
        """Count."""
        self.closed += 1

    @property
    def power(self) -> float:
        """The power asked for last."""
        return self.written[-1].outputs.get("heater", math.nan) if self.written else 0.0
