"""What was told of a set point before, and has turned out otherwise since.

The errors of a balance of heat are those of its own model. No model is the plant: a wall follows
more slowly than was thought, a controller is more careful than it need be. Either shows in what was
told a while ago, and what was wrong by so much may be wrong by as much again.
"""

from __future__ import annotations

import math

from thermoctl.control.heat_belief import Known

SLIPS_S, SETTLES_S = 600.0, 600.0
"""Memory of how late an arrival was, and of the power that was told to hold."""


class Slip:
    """By how much a set point is reached later than was told.

    An arrival supposes all the power there is. A controller that is more careful, for whatever
    reason, does not come nearer in time as the clock goes on.
    """

    def __init__(self) -> None:
        self._setpoint_c = self._due_s = self._told_s = math.nan
        self._late_s = 0.0

    def doubted(self, arrival: Known, setpoint_c: float, t_s: float) -> Known:
        """Return an arrival told at `t_s` with what those before it were wrong by."""
        if setpoint_c != self._setpoint_c:
            self._setpoint_c, self._due_s, self._late_s = setpoint_c, math.nan, 0.0
        elif self._late_s > 0.0:
            self._late_s *= math.exp((self._told_s - t_s) / SLIPS_S)
        there, due_s = arrival.mean == 0.0, t_s + arrival.mean
        if not there and math.isfinite(due_s - self._due_s):
            self._late_s = max(0.0, self._late_s + due_s - self._due_s)
        self._due_s, self._told_s = math.nan if there else due_s, t_s
        return arrival if there else Known(arrival.mean, math.hypot(arrival.sd, self._late_s))


class Settling:
    """How far the power that holds a set point is from what it was said to be.

    It goes on changing for as long as walls of any kind take up heat, or give it back.
    """

    def __init__(self) -> None:
        self._setpoint_c = self._told_s = self._before = math.nan

    def doubted(self, holding: Known, setpoint_c: float, t_s: float) -> Known:
        """Return a holding power told at `t_s` with what it has changed by lately."""
        if not math.isfinite(holding.mean):
            return holding
        if setpoint_c != self._setpoint_c or math.isnan(self._before):
            self._setpoint_c, self._before = setpoint_c, holding.mean
        else:
            keep = math.exp((self._told_s - t_s) / SETTLES_S)
            self._before = holding.mean + keep * (self._before - holding.mean)
        self._told_s = t_s
        return Known(holding.mean, math.hypot(holding.sd, holding.mean - self._before))
