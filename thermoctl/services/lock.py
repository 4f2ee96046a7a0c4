"""One daemon per state folder and device; a second hears who holds it."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from types import TracebackType
from typing import Final, Self
from urllib.parse import quote

from thermoctl.errors import NotPermitted, Unavailable

LONGEST: Final = 64
STOP_IT: Final = "stop it first: systemctl stop thermoctl, or Ctrl-C where it was started"
"""What to do about a daemon that is in the way."""


def device_lock_path(directory: Path, device: str) -> Path:
    """Return the lock file of `device`, the same for all of its names."""
    return directory / f"device-{quote(os.path.realpath(device), safe='')}.lock"


class DaemonLock:
    """A lock file with its holder's process id in it.

    The kernel lets the lock go with the process, however it ends, so a file that was left behind
    never keeps anybody out. The file itself stays: removing it would let two processes lock two
    files of the same name.

    Parameters
    ----------
    path : Path
        The lock file.
    remedy : str
        What whoever finds it held is told to do.
    """

    def __init__(self, path: Path, remedy: str = STOP_IT) -> None:
        self._path, self._remedy = Path(path), remedy
        self._descriptor: int | None = None

    def acquire(self) -> None:
        """Take the lock; at once or not at all.

        Raises
        ------
        Unavailable
            Another process holds it, and the message names it; or the file cannot be made.
        NotPermitted
            This user may not make or open the file.
        """
        if self._descriptor is not None:
            return
        try:
            self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o640)
        except PermissionError as error:
            raise NotPermitted(
                f"{self._path} should be a lock file that user {os.geteuid()} may open"
            ) from error
        except OSError as error:
            raise Unavailable(f"{self._path} should be a lock file: {error.strerror}") from error
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
        except BlockingIOError:
            holder = os.pread(descriptor, LONGEST, 0).decode(errors="replace").strip() or "unknown"
            os.close(descriptor)
            raise Unavailable(
                f"a daemon is running (process {holder} holds {self._path}); {self._remedy}"
            ) from None
        except OSError as error:
            os.close(descriptor)
            raise Unavailable(f"{self._path} should be lockable: {error.strerror}") from error
        self._descriptor = descriptor

    def release(self) -> None:
        """Let the lock go; idempotent."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.release()
