"""Where the control socket is, and how it is put there and taken away."""

from __future__ import annotations

import os
import socket
import stat
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final, Self

from thermoctl.errors import NotPermitted, Unavailable
from thermoctl.services.lock import DaemonLock
from thermoctl.services.places import runtime_dir

NAME: Final = "control.sock"
SERVICE: Final = Path("/run/thermoctl") / NAME
LONGEST: Final = 107
"""Bytes of a path that the kernel takes: 108 with the zero at its end, see unix(7)."""

_PROBE_S: Final = 0.5
_WAITING: Final = 64


def own_path(environ: Mapping[str, str] = os.environ) -> Path:
    """Return where a daemon of this user listens when nothing else is said."""
    return runtime_dir(environ) / NAME


def usual_paths(environ: Mapping[str, str] = os.environ) -> list[Path]:
    """Return where a client looks: this user's daemon first, then the machine's."""
    own = own_path(environ)
    return [own] if own == SERVICE else [own, SERVICE]


def mode_for(environ: Mapping[str, str] = os.environ) -> int:
    """Return the rights of the socket: the service's group has some, else only we."""
    return 0o660 if environ.get("RUNTIME_DIRECTORY") else 0o600


def checked(path: Path) -> Path:
    """Return `path`, made absolute, if a socket can have it.

    Raises
    ------
    Unavailable
        It is too long for any socket.
    """
    path = path.absolute()
    length = len(os.fsencode(path))
    if length > LONGEST:
        raise Unavailable(
            f"expected a socket path of at most {LONGEST} bytes, got {length}: {path}; "
            "give a shorter --socket PATH"
        )
    return path


class ControlPlace:
    """One path with a listening socket of ours on it, and nobody else's touched.

    A lock file beside it says whose the path is, so two daemons that find the same stale socket
    cannot remove each other's fresh one. A socket that still answers is left alone, lock or not.

    Parameters
    ----------
    path : Path
        Where to listen.
    mode : int
        Rights of the socket.
    """

    def __init__(self, path: Path, mode: int) -> None:
        self.path, self._mode = path, mode
        self._lock = DaemonLock(path.with_name(f"{path.name}.lock"))
        self._inode: tuple[int, int] | None = None
        self.listener: socket.socket | None = None

    @classmethod
    def of_daemon(cls, given: Path | None, environ: Mapping[str, str] = os.environ) -> Self:
        """Return where a daemon listens: at `given`, else at its own path.

        Raises
        ------
        Unavailable
            `given` is too long for any socket, or in no folder: it was mistyped, and opening it
            would make one.
        """
        path = own_path(environ) if given is None else checked(given)
        if given is not None and not path.parent.is_dir():
            raise Unavailable(f"expected a folder for --socket {given}, got none at its parent")
        return cls(path, mode_for(environ))

    def open(self) -> socket.socket:
        """Return a socket that listens at the path; a stale one is replaced.

        Raises
        ------
        Unavailable
            The path is too long, taken, or no place for a socket.
        NotPermitted
            This user may not listen there.
        """
        path = checked(self.path)
        self._lock.acquire()
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        try:
            _remove_stale(path)
            # The rights of the open file are those the path gets: never wider, not for a moment.
            os.fchmod(listener.fileno(), 0o600)
            listener.bind(os.fspath(path))
            os.chmod(path, self._mode)
            self._inode = _inode(path)
            listener.listen(_WAITING)
        except OSError as error:
            listener.close()
            self.close()
            kind = NotPermitted if isinstance(error, PermissionError) else Unavailable
            raise kind(f"expected to listen at {path}: {error.strerror or error}") from error
        except Unavailable:
            listener.close()
            self.close()
            raise
        self.listener = listener
        return listener

    @property
    def lost(self) -> bool:
        """Whether the path no longer leads to us: something cleaned up, or took it."""
        return self._inode is None or _inode(self.path) != self._inode

    def close(self) -> None:
        """Stop listening and remove the path if it is still ours; idempotent."""
        if self.listener is not None:
            self.listener.close()
        if not self.lost:
            with suppress(OSError):
                self.path.unlink()
        self.listener = self._inode = None
        self._lock.release()


def _inode(path: Path) -> tuple[int, int] | None:
    try:
        status = path.lstat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _remove_stale(path: Path) -> None:
    """Remove a socket that nobody listens to any more; anything else there is somebody's."""
    try:
        status = path.lstat()
    except FileNotFoundError:
        return
    if not stat.S_ISSOCK(status.st_mode):
        raise Unavailable(f"expected a socket or nothing at {path}, got something else")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.settimeout(_PROBE_S)
        try:
            probe.connect(os.fspath(path))
        except ConnectionRefusedError:
            path.unlink()
            return
        except FileNotFoundError:
            return
        except (BlockingIOError, TimeoutError):
            pass  # its queue is full, so somebody is there
    raise Unavailable(f"expected nobody to listen at {path}, but a program answers there")
