"""What the operator wants: a mode, a set point, and a power for mode manual."""

from __future__ import annotations

from thermoctl.errors import Refused
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.supervisor import Emit
from thermoctl.signals import Mode


class Wishes:
    """Keeps what was granted; a wish that is refused changes nothing.

    Parameters
    ----------
    limits : Limits
        Which set points are accepted.
    setpoint_c : float
        Set point at the start, in degC.
    mode : Mode
        Mode at the start.
    emit : callable
        Called as ``emit(name, **fields)`` for every change.
    """

    def __init__(self, limits: Limits, setpoint_c: float, mode: Mode, emit: Emit) -> None:
        self._limits = limits
        self._emit = emit
        self.setpoint_c = limits.accept_setpoint(setpoint_c)
        self.mode = mode
        self.manual_power = 0.0
        self._led = False

    def want_mode(self, mode: Mode, given: float) -> None:
        """Go to `mode`, while the power `given` is taken; manual goes on with it."""
        if mode is Mode.PROGRAM:
            raise Refused("expected off, manual or auto: this loop has no program")
        if mode is self.mode:
            return
        if mode is Mode.MANUAL:
            self.manual_power = given
        self._emit("mode.changed", before=self.mode.value, after=mode.value)
        self.mode = mode

    def want_setpoint(self, value_c: float) -> None:
        """Hold `value_c`, in degC."""
        if self._led:
            raise Refused(f"expected it of the loop that leads this one, got {value_c!r} for this")
        accepted_c = self._limits.accept_setpoint(value_c)
        if accepted_c != self.setpoint_c:
            self._emit("setpoint.changed", before_c=self.setpoint_c, after_c=accepted_c)
        self.setpoint_c = accepted_c

    def follow(self, setpoint_c: float) -> None:
        """Hold what a loop above this one asks for, at every sample anew and without an event."""
        self._led = True
        self.setpoint_c = self._limits.accept_setpoint(setpoint_c)

    def want_power(self, power: float) -> None:
        """Give `power`, a fraction of what the loop can take, in mode manual."""
        self.manual_power = self._limits.accept_power(power)
