"""What is followed on the way to a set point, no faster than is allowed.

Without a limit that is the set point itself. With one, it starts from where the plant is and stays
there until the loop steers: nothing runs away while the loop is off or safe, and nothing jumps when
it goes on.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

from thermoctl.errors import Refused
from thermoctl.quantities import is_finite_number
from thermoctl.signals import Mode, State

FOLLOWED_K = 1.0
"""Distance in K within which the plant follows the reference. The way to another set point then
begins at the reference itself, and readings do not shake it."""
_S_PER_MIN = 60.0


class Pace(Enum):
    """How a reference goes on."""

    IDLE = "idle"
    HELD = "held"
    RUNNING = "running"


def pace_in(mode: Mode, state: State) -> Pace:
    """Return how a reference goes on: it moves only while a controller steers."""
    if mode is not Mode.AUTO or state in (State.SAFE, State.LATCHED):
        return Pace.IDLE
    return Pace.RUNNING if state is State.RUN else Pace.HELD


class Reference(NamedTuple):
    """What is followed now; `after` says what is followed next.

    Parameters
    ----------
    value_c : float
        What is followed, in degC; NaN before the first reading where a limit holds.
    rate_k_per_s : float
        How fast it moves, with its sign; 0 at the set point and while it is held.
    target_c : float
        The set point it is on its way to.
    """

    value_c: float = math.nan
    rate_k_per_s: float = 0.0
    target_c: float = math.nan

    def anew(self) -> Reference:
        """Return it as it stands before another request, even for the same set point."""
        return self._replace(target_c=math.nan)

    def rests_at(self, target_c: float) -> bool:
        """Return whether it is at `target_c` and stays there."""
        return self == (target_c, 0.0, target_c)

    def after(
        self, target_c: float, most_k_per_s: float, measured_c: float, seen_s: float, pace: Pace
    ) -> Reference:
        """Return what is followed `seen_s` later.

        Parameters
        ----------
        target_c : float
            The set point in force.
        most_k_per_s : float
            How fast it may move; infinite: no limit.
        measured_c : float
            This reading; NaN without one.
        seen_s : float
            Time that this sample stands for.
        pace : Pace
            Whether it may move at all.
        """
        if math.isinf(most_k_per_s):
            return Reference(target_c, 0.0, target_c)
        here_c = self.value_c if math.isnan(measured_c) else measured_c
        if pace is Pace.IDLE or math.isnan(self.value_c):
            return Reference(here_c, 0.0, target_c)
        if pace is Pace.HELD:
            return Reference(self.value_c, 0.0, target_c)
        fresh = target_c != self.target_c and abs(here_c - self.value_c) > FOLLOWED_K
        value_c = here_c if fresh else self.value_c
        step_k, left_k = most_k_per_s * seen_s, target_c - value_c
        if abs(left_k) <= step_k:
            return Reference(target_c, 0.0, target_c)
        rate_k_per_s = math.copysign(most_k_per_s, left_k)
        return Reference(value_c + rate_k_per_s * seen_s, rate_k_per_s, target_c)


def accept_rate(rate_k_per_min: object, most_k_per_s: float) -> float:
    """Return a rate in K/s; None is the most that is configured.

    That is infinite where nothing is configured.

    Raises
    ------
    Refused
        It is no positive number, or faster than what is configured.
    """
    if rate_k_per_min is None:
        return most_k_per_s
    most = "" if math.isinf(most_k_per_s) else f" and at most {most_k_per_s * _S_PER_MIN:g} K/min"
    expected = f"expected a rate above 0{most}, in K/min"
    if not is_finite_number(rate_k_per_min):
        raise Refused(f"{expected}, got {rate_k_per_min!r}")
    rate_k_per_s = float(rate_k_per_min) / _S_PER_MIN  # type: ignore[arg-type]
    if not 0.0 < rate_k_per_s <= most_k_per_s * (1.0 + 1e-9):
        raise Refused(f"{expected}, got {rate_k_per_min:g}")
    return rate_k_per_s
