"""What can go wrong, by who can act on it.

A bad reading is a value (`thermoctl.signals.Quality`), because the loop has to live with it.
A lost device is a `DriverError`, because only the loop can decide. A bad setting is a
`ConfigError`, raised before anything is switched on. A request that cannot be granted is
`Refused`, and changes nothing.
"""

from __future__ import annotations


class ThermoctlError(Exception):
    """Base of every error this project raises on purpose."""


class ConfigError(ThermoctlError, ValueError):
    """A setting is wrong; nothing has been switched on."""


class Refused(ThermoctlError, ValueError):  # noqa: N818 - it is an answer, not a breakdown
    """A request was not granted; what was in force stays in force."""


class Unavailable(ThermoctlError):  # noqa: N818
    """Something needed is not there; the message says what to install."""


class NotRunning(Unavailable):
    """No daemon is there to answer."""


class NotPermitted(ThermoctlError):  # noqa: N818
    """This user may not do what is needed; the message says what that is."""


class DriverError(ThermoctlError):
    """A board did not do what it was asked."""


class TransientError(DriverError):
    """One exchange failed (time-out, checksum); asking again may help."""


class FaultError(DriverError):
    """The board reports a fault of its own; its output goes to the safe value."""


class LinkError(DriverError):
    """The link to the board is gone; it must be opened again."""


class WrongDevice(LinkError):  # noqa: N818
    """Something answers, but it is not the board that was expected."""


class BoardConfigError(DriverError, ConfigError):
    """A setting of a board is wrong; found before anything is switched on."""
