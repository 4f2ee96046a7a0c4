"""Two balances of heat where a plant is heated and cooled.

One goes by the heater, one by the cooler. Each takes what the other one gives for a load that
nobody knows, and so needs no word of how strong the two are beside each other. The heater's says
what lies too high and the cooler's what lies too low; what is told at a moment is of the one that
acts.

A heater that holds a temperature makes up for every draught, and a balance that does not count its
heat takes the plant for one that always comes back there. Against a strong heater a cooler's would
learn nothing else, so it begins anew after it.
"""

from __future__ import annotations

import math
from dataclasses import replace

from thermoctl.regulator.alarms import AlarmRegister
from thermoctl.regulator.balance.feasible import Feasibility
from thermoctl.regulator.balance.reach_alarms import NONE
from thermoctl.regulator.balance.wanted import Wanted
from thermoctl.regulator.guard import Failure
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.supervisor import Emit
from thermoctl.signals import Feasible


class FeasibilitySides:
    """Keeps a balance by the heater and one by the cooler.

    Parameters
    ----------
    period_s : float
        Nominal time between two samples.
    power_min : float
        Least power there is, below 0: all of the cooler's.
    alarms : AlarmRegister
        Where an alarm is raised.
    emit : callable
        Called as ``emit(name, **fields)`` when a set point turns out to be out of reach.
    """

    def __init__(
        self, period_s: float, power_min: float, alarms: AlarmRegister, emit: Emit
    ) -> None:
        self._power_min = power_min
        self._due = (False, False)
        self._heater = Feasibility(period_s, alarms, emit)
        self._cooler = Feasibility(period_s, alarms, emit)

    @property
    def known(self) -> Feasible:
        """What is known by whichever acts; the power that holds has its sign."""
        if self._heater.heat >= self._cooler.heat:
            return self._heater.known
        known = self._cooler.known
        return replace(known, holding_power=-known.holding_power)

    def observe(
        self,
        interval_s: float,
        applied: float,
        reading_c: float,
        lag_s: float | None,
        beyond: float = 0.0,
    ) -> bool:
        """Gather a sample for both; return whether it completed a stretch."""
        if applied > NONE:
            self._cooler.forget()
        self._due = (
            self._heater.observe(interval_s, applied, reading_c, lag_s, beyond),
            self._cooler.observe(interval_s, -applied, reading_c, lag_s, -beyond),
        )
        return any(self._due)

    def reckon(self, wanted: Wanted, t_s: float) -> None:
        """Learn from the stretch that is complete, and say what it means for `wanted`."""
        heater_due, cooler_due = self._due
        if heater_due:
            self._heater.reckon(wanted, t_s)
        if cooler_due:
            most, none = -self._power_min, math.nan  # what the heater comes to is no bound of this
            cold = replace(wanted, power_max=most, power_cools=True, ceiling_c=none)
            self._cooler.reckon(cold, t_s)

    def fail(self, failure: Failure) -> None:
        """Begin anew after a computation that failed, and say so once."""
        self._cooler.forget()
        self._heater.fail(failure)


def balance_for(
    limits: Limits, alarms: AlarmRegister, emit: Emit
) -> Feasibility | FeasibilitySides:
    """Return the balance of a loop, or both where it heats and cools."""
    if limits.power_min < 0.0:
        return FeasibilitySides(limits.period_s, limits.power_min, alarms, emit)
    return Feasibility(limits.period_s, alarms, emit)
