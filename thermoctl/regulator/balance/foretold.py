"""Errors of past forecasts for a set point; they widen those of the next.

The errors of a balance of heat are those of its own model. No model is the plant: a wall follows
more slowly than was thought, a controller is more careful than it need be. Either shows in what was
told a while ago, and what was wrong by so much may be wrong by as much again.
"""

from __future__ import annotations

import math

from thermoctl.quantities import Uncertain

SLIPS_S, SETTLES_S, NEARS_S = 600.0, 600.0, 1800.0
"""Time constants in s with which past values are forgotten: of how late an arrival was, of the
holding power, and of the farthest temperature that can be held."""
MOVED_SDS, STAYS_SDS, SURELY_SDS = 1.5, 0.5, 3.0
"""The farthest temperature that can be held counts as moving when it has moved by MOVED_SDS
standard deviations, until it has moved by less than STAYS_SDS. SURELY_SDS of them are subtracted
for what can surely be held."""
WITHIN_S = 86_400.0
"""Time in s in which it has to come to the set point at that pace: goods take no longer than a
day."""


class Slip:
    """How much later than forecast a set point is reached.

    An arrival supposes all the power there is. A controller that is more careful, for whatever
    reason, does not come nearer in time as the clock goes on.
    """

    def __init__(self) -> None:
        self._setpoint_c = self._due_s = self._told_s = math.nan
        self._late_s = 0.0

    def doubted(self, arrival: Uncertain, setpoint_c: float, t_s: float) -> Uncertain:
        """Return an arrival forecast at `t_s`, in doubt by the errors of earlier ones."""
        if setpoint_c != self._setpoint_c:
            self._setpoint_c, self._due_s, self._late_s = setpoint_c, math.nan, 0.0
        elif self._late_s > 0.0:
            self._late_s *= math.exp((self._told_s - t_s) / SLIPS_S)
        there, due_s = arrival.mean == 0.0, t_s + arrival.mean
        if not there and math.isfinite(due_s - self._due_s):
            self._late_s = max(0.0, self._late_s + due_s - self._due_s)
        self._due_s, self._told_s = math.nan if there else due_s, t_s
        return arrival if there else Uncertain(arrival.mean, math.hypot(arrival.sd, self._late_s))


class Settling:
    """How far a holding power is from what was reported before.

    It goes on changing for as long as walls of any kind take up heat, or give it back.
    """

    def __init__(self) -> None:
        self._setpoint_c = self._told_s = self._before = math.nan

    def doubted(self, holding: Uncertain, setpoint_c: float, t_s: float) -> Uncertain:
        """Return a holding power told at `t_s`, in doubt by its changes of late."""
        if not math.isfinite(holding.mean):
            return holding
        if setpoint_c != self._setpoint_c or math.isnan(self._before):
            self._setpoint_c, self._before = setpoint_c, holding.mean
        else:
            keep = math.exp((self._told_s - t_s) / SETTLES_S)
            self._before = holding.mean + keep * (self._before - holding.mean)
        self._told_s = t_s
        return Uncertain(holding.mean, math.hypot(holding.sd, holding.mean - self._before))


class Nearing:
    """Whether the farthest temperature that power holds moves to the set point.

    Goods behind quick air give off heat for hours. It looks like a loss with a steep slope, and so
    like an end of the way; but that end moves on as they follow. That of a plant which loses as
    much for good stays where it was found, within its error, and what surely can be held moves on
    only until it is known.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self._sign = self._told_s = math.nan
        self._here = self._past = Uncertain()
        self._sure = self._sure_past = math.nan
        self._moves = False

    def seen(self, farthest: Uncertain, sign: float, t_s: float) -> None:
        """Take in the farthest that power holds, told at `t_s`.

        Power drives in the direction `sign`.
        """
        here, sd = sign * farthest.mean, farthest.sd
        if not math.isfinite(here):
            return
        sure = here - SURELY_SDS * sd
        if sign != self._sign:
            self.clear()
            self._sign, self._told_s, self._sure, self._sure_past = sign, t_s, sure, sure
        past, keep = self._past, math.exp((self._told_s - t_s) / NEARS_S)
        if here >= past.mean:
            self._past = Uncertain(here + keep * (past.mean - here), sd + keep * (past.sd - sd))
        else:  # it was never as near as was thought, or is seen for the first time
            self._past = Uncertain(here, sd)
        self._sure = max(self._sure, sure)
        self._sure_past = self._sure + keep * (self._sure_past - self._sure)
        self._here, self._told_s = Uncertain(here, sd), t_s

    def arrives(self, setpoint_c: float) -> bool:
        """Return whether it comes to `setpoint_c` within a day, as it has moved of late.

        That it does ends later than it begins.
        """
        moved_k = self._here.mean - self._past.mean
        sds = STAYS_SDS if self._moves else MOVED_SDS
        surely_k = min(moved_k, self._sure - self._sure_past)
        left_k = self._sign * setpoint_c - self._here.mean
        self._moves = (
            moved_k > sds * max(self._here.sd, self._past.sd)
            and surely_k * WITHIN_S / NEARS_S > left_k
        )
        return self._moves
