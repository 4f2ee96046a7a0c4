"""A load that is known beforehand: what a plant loses beside its usual loss.

The controller is shown the power that is left of what was applied, and what it asks for is raised
by the load. So any law holds through it, without being told, and none learns it as a loss.
"""

from __future__ import annotations

import math

from thermoctl.errors import Refused
from thermoctl.quantities import clamp, is_finite_number
from thermoctl.regulator.supervisor import Emit

LONGEST_S = 30.0 * 86_400.0


class KnownLoad:
    """Keeps the load that was announced, until its time is over.

    Parameters
    ----------
    emit : callable
        Called as ``emit(name, **fields)`` when a load begins, changes or ends.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._power = 0.0
        self._begin_s = self._end_s = -math.inf
        self._told = False
        self._wanted: tuple[float, float] | None = None

    def want(self, power: float, duration_s: float) -> None:
        """Expect `power`, of full power, for `duration_s` from the next sample on.

        A load of 0 ends the one before at that sample, however long it was to last.

        Raises
        ------
        Refused
            Either is no such number.
        """
        if not is_finite_number(power) or not -1.0 <= power <= 1.0:
            raise Refused(f"expected a load from -1 to 1 of full power, got {power!r}")
        if not is_finite_number(duration_s) or not 0.0 < duration_s <= LONGEST_S:
            raise Refused(
                f"expected a duration above 0, up to {LONGEST_S:.0f} s, got {duration_s!r}"
            )
        if power == 0.0:
            self._wanted = 0.0, 0.0
            return
        self._wanted, self._told = (float(power), float(duration_s)), True
        self._emit("load.changed", power=float(power), duration_s=float(duration_s))

    def at(self, t_s: float) -> float:
        """Return the load from `t_s` on; one that was wanted begins."""
        if self._wanted is not None:
            self._power, duration_s = self._wanted
            self._begin_s, self._end_s = t_s, t_s + duration_s
            self._wanted = None
        if t_s >= self._end_s and self._told:
            self._told = False
            self._emit("load.changed", power=0.0, duration_s=0.0)
        return self._power if t_s < self._end_s else 0.0

    def mean(self, t_s: float, interval_s: float) -> float:
        """Return the mean load of the interval that ends at `t_s`."""
        if self._power == 0.0:
            return 0.0
        since_s = max(self._begin_s, t_s - interval_s)
        return self._power * clamp((min(t_s, self._end_s) - since_s) / interval_s, 0.0, 1.0)
