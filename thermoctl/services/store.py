"""Small records on disk that must survive a power cut: old or new, never torn.

A record is written beside its final name, forced to the disk, renamed over the old one, and the
folder is forced too. What cannot be understood is ignored with a warning, except a latch: a latch
file that nobody can read counts as latched, because the heater may have to stay off.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from thermoctl.errors import NotPermitted
from thermoctl.signals import Mode

FORMAT: Final = 1
LONGEST: Final = 65536
"""Bytes; a record is a few hundred, so anything longer is garbage."""

FUTURE_S: Final = 86400.0
"""A record written later than this from now is not believed; a clock set by hand errs by less."""

UNREADABLE: Final = "latch.unreadable"


@dataclass(frozen=True, slots=True)
class Stored:
    """What was found under a name: a document, or why there is none worth having.

    Both are None when nothing was ever stored.
    """

    document: Mapping[str, Any] | None = None
    warning: str | None = None


class StateStore:
    """Documents in one folder, written whole or not at all.

    Parameters
    ----------
    directory : Path
        Its folder; made at the first write.
    wall_clock : callable
        Seconds since 1970 UTC.
    """

    def __init__(self, directory: Path, wall_clock: Callable[[], float] = time.time) -> None:
        self.directory = Path(directory)
        self._wall_clock = wall_clock

    def path_of(self, name: str) -> Path:
        """Return where the document `name` lives; any text makes one plain file name."""
        return self.directory / f"{quote(name, safe='')}.json"

    def write(self, name: str, document: Mapping[str, Any]) -> None:
        """Replace the document `name`; when this returns, a power cut cannot undo it.

        Raises
        ------
        OSError
            It could not be written; the old document is untouched.
        ValueError
            `document` holds something that is no JSON, NaN included.
        """
        whole = {"format": FORMAT, "written_utc_s": self._wall_clock(), "content": dict(document)}
        content = json.dumps(whole, allow_nan=False, indent=1).encode()
        self.directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        path = self.path_of(name)
        partial = path.with_name(f".{path.name}.partial")  # one name, so a crash leaves one at most
        descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, 0o640)
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            os.replace(partial, path)
        except OSError:
            with suppress(OSError):
                partial.unlink()
            raise
        _force(self.directory)

    def read(self, name: str) -> Stored:
        """Return the document `name`; whatever is wrong with it becomes a warning."""
        path = self.path_of(name)
        try:
            with path.open("rb") as stream:
                content = stream.read(LONGEST + 1)
        except FileNotFoundError:
            return Stored()
        except OSError as error:
            return Stored(warning=f"{path} should be readable: {error.strerror}")
        try:
            return Stored(document=self._validated(content))
        except (ValueError, RecursionError) as error:
            return Stored(warning=f"{path} cannot be understood: {error}")

    def remove(self, name: str) -> None:
        """Remove the document `name`, for good when this returns; none there is fine.

        Raises
        ------
        OSError
            It is there and cannot be removed.
        """
        try:
            self.path_of(name).unlink()
        except FileNotFoundError:
            return
        _force(self.directory)

    def exists(self, name: str) -> bool:
        """Return whether something lies under `name`; when that cannot be told, it does."""
        try:
            self.path_of(name).lstat()
        except FileNotFoundError:
            return False
        except OSError:
            return True
        return True

    def _validated(self, content: bytes) -> Mapping[str, Any]:
        if len(content) > LONGEST:
            raise ValueError(f"expected at most {LONGEST} bytes")
        if not content.strip(b"\0 \n"):
            raise ValueError("it is empty")
        whole = json.loads(content)
        document = whole.get("content") if isinstance(whole, dict) else None
        if not isinstance(document, dict):
            raise ValueError("expected an object with a content")  # noqa: TRY004 - of the file
        if whole.get("format") != FORMAT:
            raise ValueError(f"expected format {FORMAT}, got {whole.get('format')!r}")
        written_utc_s = _finite(whole, "written_utc_s")
        if written_utc_s > self._wall_clock() + FUTURE_S:
            raise ValueError(f"it was written in the future, at {written_utc_s:.0f} s since 1970")
        return document


@dataclass(frozen=True, slots=True)
class Latch:
    """Why a loop must keep its heater off until an operator says otherwise.

    Parameters
    ----------
    code, text, fault
        Those of the alarm that latched.
    since_utc_s : float
        Wall clock when it latched, in s since 1970; NaN when nobody knows.
    """

    code: str
    text: str
    fault: int | None = None
    since_utc_s: float = math.nan


class LatchStore:
    """The latches of all loops, in a folder that survives, and a spare one.

    Parameters
    ----------
    directory : Path
        The state folder.
    spare : Path or None
        The runtime folder: survives a restart of the daemon while the state folder is read-only.
    """

    def __init__(
        self,
        directory: Path,
        spare: Path | None = None,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        places = (directory,) if spare is None else (directory, spare)
        self._stores = tuple(StateStore(place, wall_clock) for place in places)

    def save(self, loop: str, latch: Latch) -> bool:
        """Store `latch`; return whether it will survive a power cut, not only a restart.

        Raises
        ------
        OSError
            No folder takes it.
        """
        known = math.isfinite(latch.since_utc_s)
        document = {
            "loop": loop,
            "code": latch.code,
            "text": latch.text,
            "fault": latch.fault,
            "since_utc_s": latch.since_utc_s if known else None,
        }
        errors: list[OSError] = []
        for store in self._stores:
            try:
                store.write(_latch(loop), document)
            except OSError as error:
                errors.append(error)
            else:
                return not errors
        raise errors[0]

    def load(self, loop: str) -> Latch | None:
        """Return the latch of `loop`, if any; an unreadable one counts."""
        for store in self._stores:
            stored = store.read(_latch(loop))
            if stored.document is not None or stored.warning is not None:
                return _as_latch(stored)
        return None

    def clear(self, loop: str) -> None:
        """Remove the latch of `loop` from every folder.

        Raises
        ------
        OSError
            One of them still holds it.
        """
        for store in self._stores:
            store.remove(_latch(loop))

    def exists(self, loop: str) -> bool:
        """Return whether any folder holds a latch of `loop`."""
        return any(store.exists(_latch(loop)) for store in self._stores)

    def check_readable(self, loop: str) -> None:
        """Do nothing if this user may read the latch of `loop`.

        A daemon takes a latch that it cannot read for one. For a person who merely may not look,
        that answer would be wrong.

        Raises
        ------
        NotPermitted
            There may be a latch, and this user may not read it.
        """
        for store in self._stores:
            folder, path = store.directory, store.path_of(_latch(loop))
            hidden = folder.exists() and not os.access(folder, os.R_OK | os.X_OK)
            if hidden or (store.exists(_latch(loop)) and not os.access(path, os.R_OK)):
                raise NotPermitted(f"{path} should be readable for user {os.geteuid()}; try sudo")


@dataclass(frozen=True, slots=True)
class RunRecord:
    """What a loop was doing, so that the next start knows that it is a restart.

    Parameters
    ----------
    mode, setpoint_c
        What the operator wanted last.
    configured_mode, configured_setpoint_c
        What the configuration said then; an edited one is a newer wish. None: not known.
    exchanged : bool
        Whether the operator had put the controller in shadow in charge.
    configured_laws : tuple of str
        Kinds in charge and in shadow, as configured then.
    """

    mode: Mode
    setpoint_c: float
    configured_mode: Mode | None = None
    configured_setpoint_c: float | None = None
    exchanged: bool = False
    configured_laws: tuple[str, ...] = ()


class RunStore:
    """The last mode, set point and controller of every loop."""

    def __init__(self, directory: Path, wall_clock: Callable[[], float] = time.time) -> None:
        self._store = StateStore(directory, wall_clock)

    def save(self, loop: str, record: RunRecord) -> None:
        """Store `record`.

        Raises
        ------
        OSError
            It could not be written; the old one is untouched.
        ValueError
            The set point is not finite.
        """
        self._store.write(_run(loop), {"loop": loop, **asdict(record)})

    def load(self, loop: str) -> tuple[RunRecord | None, str | None]:
        """Return the record of `loop`, or None and, where there should be one, a warning."""
        stored = self._store.read(_run(loop))
        if stored.document is None:
            return None, stored.warning
        try:
            return _as_run(stored.document), None
        except ValueError as error:
            return None, f"{self._store.path_of(_run(loop))} is ignored: {error}"


def _as_run(document: Mapping[str, Any]) -> RunRecord:
    mode, setpoint_c = Mode(str(document.get("mode"))), _finite(document, "setpoint_c")
    if document.get("configured_mode") is None:
        return RunRecord(mode, setpoint_c)
    configured = Mode(str(document["configured_mode"]))
    configured_c = _finite(document, "configured_setpoint_c")
    laws = document.get("configured_laws", [])
    if not (isinstance(laws, list) and all(isinstance(each, str) for each in laws)):
        raise ValueError(f"expected configured_laws, names, got {laws!r}")
    exchanged = document.get("exchanged") is True
    return RunRecord(mode, setpoint_c, configured, configured_c, exchanged, tuple(laws))


def _latch(loop: str) -> str:
    return f"latch-{loop}"


def _run(loop: str) -> str:
    return f"run-{loop}"


def _as_latch(stored: Stored) -> Latch:
    document = stored.document
    if document is None:
        return Latch(UNREADABLE, f"{stored.warning}; it counts as a latch")
    code, text, fault = document.get("code"), document.get("text"), document.get("fault")
    if not (isinstance(code, str) and isinstance(text, str)):
        return Latch(UNREADABLE, "expected a code and a text; the record counts as a latch")
    try:
        since_utc_s = _finite(document, "since_utc_s")
    except ValueError:
        since_utc_s = math.nan
    return Latch(code, text, fault if isinstance(fault, int) else None, since_utc_s)


def _finite(document: Mapping[str, Any], name: str) -> float:
    """Return a number; JSON as Python reads it knows NaN, Infinity and true."""
    value = document.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"expected a finite {name}, got {value!r}")
    return float(value)


def _force(directory: Path) -> None:
    """Force a rename to the disk; without it, a power cut may bring the old name back."""
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
