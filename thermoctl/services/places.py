"""Where state and sockets live: the service's, the user's, or private."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from thermoctl.errors import NotPermitted, Unavailable

PRIVATE: Final = 0o700
NAME: Final = "thermoctl"
SERVICE_STATE: Final = Path("/var/lib/thermoctl")
SERVICE_RUN: Final = Path("/run/thermoctl")
"""Where the service that systemd runs keeps its state, its sockets and its locks."""


def state_dir(environ: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for what must survive a restart; it may not exist yet.

    ``$STATE_DIRECTORY``, else ``$XDG_STATE_HOME/thermoctl``, else ``~/.local/state/thermoctl``;
    without any home, a folder of this user below the temporary one.
    """
    if given := _first(environ.get("STATE_DIRECTORY", "")):
        return given
    if base := _absolute(environ.get("XDG_STATE_HOME", "")):
        return base / NAME
    if home := _home(environ):
        return home / ".local" / "state" / NAME
    return _temporary() / "state"


def runtime_dir(environ: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for sockets and locks, emptied at boot; it may not exist yet.

    ``$RUNTIME_DIRECTORY``, else ``$XDG_RUNTIME_DIR/thermoctl``, else a folder of this user below
    the temporary one.
    """
    if given := _first(environ.get("RUNTIME_DIRECTORY", "")):
        return given
    if base := _absolute(environ.get("XDG_RUNTIME_DIR", "")):
        return base / NAME
    return _temporary() / "run"


def make_private(directory: Path) -> Path:
    """Make `directory` where it is missing, and return it once it is safe to trust.

    Raises
    ------
    Unavailable
        It cannot be made, is no folder, belongs to somebody else, or others may write into it.
    NotPermitted
        This user may not make it, or not write into it.
    """
    try:
        directory.mkdir(mode=PRIVATE, parents=True, exist_ok=True)
        found = directory.stat()
        # Only below a folder that everybody may write into could somebody else have put it there.
        checked = [(directory, found)]
        if directory.parent.name == _temporary().name:
            checked.append((directory.parent, directory.parent.lstat()))
    except PermissionError as error:
        raise _not_permitted(directory) from error
    except OSError as error:
        raise Unavailable(
            f"{directory} should be a folder to write into: {error.strerror}"
        ) from error
    for place, status in checked:
        if not stat.S_ISDIR(status.st_mode):
            raise Unavailable(f"{place} should be a folder, not a link or a file")
        if status.st_uid not in (os.geteuid(), 0):
            raise Unavailable(
                f"{place} should belong to user {os.geteuid()}, but belongs to {status.st_uid}"
            )
        if status.st_mode & stat.S_IWOTH:
            raise Unavailable(
                f"{place} should not be writable by everybody, "
                f"but has mode {stat.S_IMODE(status.st_mode):04o}"
            )
    if not os.access(directory, os.W_OK | os.X_OK):
        raise _not_permitted(directory)
    return directory


def _not_permitted(directory: Path) -> NotPermitted:
    return NotPermitted(
        f"{directory} should be a folder that user {os.geteuid()} may write into; "
        "run as its owner, or give --state DIR"
    )


def _first(listed: str) -> Path | None:
    """The service manager separates several folders by colons; ours is the first."""
    return _absolute(listed.split(":")[0])


def _absolute(text: str) -> Path | None:
    """A relative path would depend on the working directory, so it counts as not set."""
    path = Path(text)
    return path if text and path.is_absolute() else None


def _home(environ: Mapping[str, str]) -> Path | None:
    """Return $HOME, else what the user database says; a service's user may have neither."""
    if given := _absolute(environ.get("HOME", "")):
        return given
    import pwd  # POSIX only, and only asked for here

    try:
        return _absolute(pwd.getpwuid(os.geteuid()).pw_dir)
    except KeyError:
        return None


def _temporary() -> Path:
    return Path(tempfile.gettempdir()) / f"{NAME}-{os.geteuid()}"
