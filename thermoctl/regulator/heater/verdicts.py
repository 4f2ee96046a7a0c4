"""What a bad answer leads to: SAFE at first, LATCHED at the second time."""

from __future__ import annotations

import math

from thermoctl.regulator.heater.check import Reacts

LATELY_S = 1800.0
"""Time in s after a bad answer within which a second one latches."""

_FAULTS = {"heater.no_response": 23, "heater.reversed": 3, "heater.stuck_on": 24}


class Verdicts:
    """Remembers the last bad answer of a heater, and tells the supervisor.

    Times are those of the watch.

    Parameters
    ----------
    supervisor : Reacts
        Who switches off.
    """

    def __init__(self, supervisor: Reacts) -> None:
        self._supervisor = supervisor
        self._bad_s = -math.inf

    def lately(self, now_s: float) -> bool:
        """Return whether another bad answer would be the second one."""
        return now_s - self._bad_s < LATELY_S

    def note(self, now_s: float) -> None:
        """Take a bad answer for the first one, without telling anybody."""
        self._bad_s = now_s

    def take_back(self) -> None:
        """Forget the last bad answer: the plant explains it."""
        self._bad_s = -math.inf

    def fail(self, code: str, text: str, t_s: float, now_s: float) -> bool:
        """Go to SAFE, or LATCHED; return whether it is LATCHED.

        That is at the second time, or where nothing can switch the heater off.
        """
        fault = _FAULTS[code]
        self._supervisor.fail(code, fault, text, t_s)
        latched = code == "heater.stuck_on" or self.lately(now_s)
        if latched:
            self._supervisor.latch(code, fault, text, t_s)
        return latched
