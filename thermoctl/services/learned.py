"""What controllers have learnt, on disk over a restart: a file a loop.

Written as everything that must survive (`thermoctl.services.store`), so it is the old one or the
new one, never a torn one. Unlike a latch it is no promise: whatever cannot be read is ignored with
a warning, and the loop begins with nothing, as the first time.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from thermoctl.ports import Remembered
from thermoctl.quantities import is_finite_number
from thermoctl.services.store import StateStore
from thermoctl.signals import Cycle, State

VERSION: Final = 1
EVERY_S: Final = 600.0
"""A running loop is stored no more often: the model changes slowly, and flash wears."""


class LearnedStore:
    """The models of every loop, by the name of the law that learnt them.

    Parameters
    ----------
    directory : Path
        The state folder.
    wall_clock : callable
        Seconds since 1970 UTC.
    """

    def __init__(self, directory: Path, wall_clock: Callable[[], float] = time.time) -> None:
        self._store = StateStore(directory, wall_clock)
        self._wall_clock = wall_clock

    def save(self, loop: str, models: Mapping[str, Mapping[str, Any]]) -> None:
        """Store `models`; what is there of other laws stays.

        Raises
        ------
        OSError
            It could not be written; the old file is untouched.
        ValueError
            A model holds something that is no JSON, NaN included.
        """
        entries = dict(self._entries(loop))
        now_s = self._wall_clock()
        at = datetime.fromtimestamp(now_s, UTC).isoformat(timespec="seconds")
        for kind, model in models.items():
            entries[kind] = {"learnt_utc": at, "learnt_utc_s": now_s, "model": dict(model)}
        self._store.write(_name(loop), {"version": VERSION, "loop": loop, "models": entries})

    def load(self, loop: str) -> tuple[dict[str, Remembered], str | None]:
        """Return what is remembered of `loop`, and a warning where some of it is no use."""
        stored = self._store.read(_name(loop))
        if stored.document is None:
            return {}, stored.warning
        try:
            return self._understood(loop, stored.document), None
        except ValueError as error:
            return {}, f"{self.path_of(loop)} is ignored: {error}"

    def forget(self, loop: str) -> bool:
        """Remove what is remembered of `loop`; return whether there was anything.

        Raises
        ------
        OSError
            It is there and cannot be removed.
        """
        there = self._store.exists(_name(loop))
        self._store.remove(_name(loop))
        return there

    def path_of(self, loop: str) -> Path:
        """Return the file of `loop`."""
        return self._store.path_of(_name(loop))

    def _entries(self, loop: str) -> Mapping[str, Any]:
        """Return what is on disk of `loop` and can be understood, as it stands there."""
        document = self._store.read(_name(loop)).document
        if document is not None:
            with suppress(ValueError):
                self._understood(loop, document)
                entries: Mapping[str, Any] = document["models"]
                return entries
        return {}

    def _understood(self, loop: str, document: Mapping[str, Any]) -> dict[str, Remembered]:
        for name, expected in (("version", VERSION), ("loop", loop)):
            if document.get(name) != expected:
                raise ValueError(f"expected {name} {expected!r}, got {document.get(name)!r}")
        entries = document.get("models")
        if not isinstance(entries, dict):
            text = f"expected models by the names of laws, got {entries!r}"
            raise ValueError(text)  # noqa: TRY004 - of the file
        return {kind: self._one(kind, entry) for kind, entry in entries.items()}

    def _one(self, kind: str, entry: object) -> Remembered:
        model = entry.get("model") if isinstance(entry, dict) else None
        since_s = entry.get("learnt_utc_s") if isinstance(entry, dict) else None
        if not isinstance(model, dict) or not is_finite_number(since_s):
            raise ValueError(f"expected a model of {kind} and when it was learnt, got {entry!r}")
        return Remembered(model, max(0.0, self._wall_clock() - float(since_s)))  # type: ignore[arg-type]


class ModelKeeper:
    """Stores what running loops have learnt, now and then and at the end.

    Parameters
    ----------
    store : LearnedStore
        Where it is kept.
    now_s : callable
        Monotonic time in s.
    every_s : float
        Least time between two writes while loops run.
    """

    def __init__(
        self, store: LearnedStore, now_s: Callable[[], float], every_s: float = EVERY_S
    ) -> None:
        self._store, self._now_s, self._every_s = store, now_s, every_s
        self._last_s = now_s()

    def store(self, cycles: Mapping[str, Cycle], *, at_end: bool = False) -> list[str]:
        """Store what each loop's last cycle knows, when it is time; return which.

        Only of a loop that runs: what a model made of a sensor that fell out is not worth keeping.
        A disk that is full or read-only is tried again the next time.
        """
        now_s = self._now_s()
        if not at_end and now_s - self._last_s < self._every_s:
            return []
        self._last_s, stored = now_s, []
        for loop, cycle in cycles.items():
            models = cycle.step.remember() if cycle.step.state is State.RUN else {}
            if models:
                with suppress(OSError, ValueError, TypeError):  # a plug-in's may be no JSON at all
                    self._store.save(loop, models)
                    stored.append(loop)
        return stored


def remembered_models(
    store: LearnedStore, loops: Mapping[str, object], emit: Callable[..., None]
) -> dict[str, dict[str, Remembered]]:
    """Return what is remembered of each loop; what is no use is told of."""
    found: dict[str, dict[str, Remembered]] = {}
    for loop in loops:
        found[loop], warning = store.load(loop)
        if warning is not None:
            emit("state.ignored", loop, why=warning)
    return found


def _name(loop: str) -> str:
    return f"model-{loop}"
