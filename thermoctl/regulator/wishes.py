"""What the operator wants: a mode, a set point, and a power for mode manual."""

from __future__ import annotations

import math

from thermoctl.errors import Refused
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.reference import Reference, accept_rate, pace_in
from thermoctl.regulator.supervisor import Emit
from thermoctl.signals import Mode, State


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
    most_k_per_s : float
        How fast a set point is approached, at most; infinite: at once.
    """

    def __init__(
        self,
        limits: Limits,
        setpoint_c: float,
        mode: Mode,
        emit: Emit,
        most_k_per_s: float = math.inf,
    ) -> None:
        self._limits = limits
        self._emit = emit
        self._most_k_per_s = self.rate_k_per_s = most_k_per_s
        self.reference = Reference()
        self.setpoint_c = limits.accept_setpoint(setpoint_c)
        self.mode = mode
        self.manual_power = 0.0
        self._led = False

    @property
    def led(self) -> bool:
        """Whether another loop says what to hold."""
        return self._led

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

    def want_setpoint(self, value_c: float, rate_k_per_min: float | None = None) -> None:
        """Hold `value_c`, in degC, and go there no faster than asked for or configured."""
        if self._led:
            raise Refused(
                "expected a set point for the loop that leads this one,"
                f" got {value_c!r} for the one that follows"
            )
        accepted_c = self._limits.accept_setpoint(value_c)
        rate_k_per_s = accept_rate(rate_k_per_min, self._most_k_per_s)
        if accepted_c != self.setpoint_c:
            ramp = {} if rate_k_per_min is None else {"rate_k_per_min": rate_k_per_min}
            self._emit("setpoint.changed", before_c=self.setpoint_c, after_c=accepted_c, **ramp)
        self.setpoint_c, self.rate_k_per_s = accepted_c, rate_k_per_s
        self.reference = self.reference.anew()

    @property
    def ramp_s(self) -> float:
        """How long the reference will still be on its way; 0 where nothing limits it."""
        if math.isinf(self.rate_k_per_s) or math.isnan(self.reference.value_c):
            return 0.0
        return abs(self.setpoint_c - self.reference.value_c) / self.rate_k_per_s

    def approach(self, measured_c: float, seen_s: float, state: State) -> Reference:
        """Return what is followed at this sample, on the way to the set point."""
        target_c, most_k_per_s = self.setpoint_c, self.rate_k_per_s
        if most_k_per_s == math.inf and self.reference.rests_at(target_c):
            return self.reference
        pace = pace_in(self.mode, state)
        self.reference = self.reference.after(target_c, most_k_per_s, measured_c, seen_s, pace)
        return self.reference

    def follow(self, setpoint_c: float) -> None:
        """Hold what a loop above this one asks for at this sample, without an event."""
        self._led = True
        self.setpoint_c = self._limits.accept_setpoint(setpoint_c)

    def want_power(self, power: float) -> None:
        """Give `power`, a fraction of what the loop can take, in mode manual."""
        accepted = self._limits.accept_power(power)
        if accepted != self.manual_power:
            self._emit("output.changed", before_power=self.manual_power, after_power=accepted)
        self.manual_power = accepted
