"""Whether the set point can be held, with which power, and when it is reached.

A balance of heat is kept beside every controller, in every mode. It needs what was applied and what
was read, and from the controller no more than its lag. Readings are gathered over stretches of some
seconds, so that a sample costs next to nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from thermoctl.quantities import Uncertain, clamp
from thermoctl.regulator.alarms import AlarmRegister
from thermoctl.regulator.balance import heat_loss
from thermoctl.regulator.balance.foretold import Nearing, Settling, Slip
from thermoctl.regulator.balance.heat_belief import HeatBelief
from thermoctl.regulator.balance.heat_loss import Stretch
from thermoctl.regulator.balance.reach_alarms import Given, ReachAlarms
from thermoctl.regulator.balance.wanted import Wanted as Wanted
from thermoctl.regulator.guard import Failure
from thermoctl.regulator.supervisor import Emit
from thermoctl.signals import Feasible

STRETCH_S = 10.0
LAG_GUESS_S = 30.0
"""Lag in s that is assumed while the controller knows none."""
ARRIVED_K = 0.1
"""Distance in K from the set point within which it counts as reached."""
SD_MOST_K = 50.0
POWER_SD_MOST = 0.3
"""A limit known to no better than SD_MOST_K, and a holding power known to no better than
POWER_SD_MOST of full power, are not reported."""
REST_SHARE = 0.8
"""Time constant of the last heat, as a share of the lag: that of its slowest part."""
LAG_DOUBT = 0.4
"""Standard deviation of the time that the last heat takes, as a share of it and of the lag."""
UNSEEN_S = 60.0
"""Time in s without a reading after which no forecast is reported, and no alarm comes or goes."""
FAILED = "balance.failed"


@dataclass(slots=True)
class Gathered:
    """Sums over a stretch; open to change, for a new one every sample takes longer."""

    span_s: float = 0.0
    heat_s: float = 0.0
    late_s: float = 0.0
    total_c: float = 0.0
    readings: int = 0

    @property
    def mean_c(self) -> float:
        """Mean reading; NaN without one."""
        return self.total_c / self.readings if self.readings else math.nan


class Feasibility:
    """Keeps the balance of heat of a loop; says when a set point is out of reach.

    Parameters
    ----------
    period_s : float
        Nominal time between two samples.
    alarms : AlarmRegister
        Where the alarm is raised.
    emit : callable
        Called as ``emit(name, **fields)`` when a set point turns out to be out of reach.
    """

    def __init__(self, period_s: float, alarms: AlarmRegister, emit: Emit) -> None:
        self._unknown_s = max(60.0, 10.0 * period_s)
        self._emit = emit
        self._belief: HeatBelief | None = None
        self._gathered = Gathered()
        self._before = Gathered()
        self._lag_s = LAG_GUESS_S
        self._heat = 0.0  # power that has reached the sensor
        self._asked = 0.0  # of it, what was commanded; below 0 that of another actuator
        self._reading_c = math.nan
        self._unseen_s = 0.0
        self._slip, self._settling, self._nearing = Slip(), Settling(), Nearing()
        self._reach = ReachAlarms(alarms, emit)
        self._failed = False
        self.known = Feasible()

    @property
    def heat(self) -> float:
        """Power that has reached the sensor."""
        return self._heat

    @property
    def belief(self) -> HeatBelief | None:
        """What is believed of gain and loss; None before the first stretch."""
        return self._belief

    def observe(
        self,
        interval_s: float,
        applied: float,
        reading_c: float,
        lag_s: float | None,
        beyond: float = 0.0,
    ) -> bool:
        """Gather a sample; return whether it completed a stretch.

        Parameters
        ----------
        interval_s : float
            Time since the last sample.
        applied : float
            Power that the plant got meanwhile.
        reading_c : float
            Good reading, else NaN.
        lag_s : float or None
            Lag from heater to reading, where the controller knows it.
        beyond : float
            By how much `applied` is more than what was commanded.
        """
        if interval_s > self._unknown_s:
            self.forget()
            return False
        if lag_s is not None and lag_s > 0.0:
            self._lag_s = lag_s
        # A cooler beside the heater has a gain of its own.
        warming = applied if applied > 0.0 else 0.0
        share = -math.expm1(-interval_s / self._lag_s)
        self._heat += share * (warming - self._heat)
        asked = applied - beyond
        self._asked += share * ((asked if asked < warming else warming) - self._asked)
        heat, sums = self._heat, self._gathered
        sums.span_s += interval_s
        sums.heat_s += interval_s * heat
        sums.late_s += interval_s * (abs(warming - heat) + warming - applied)
        if reading_c == reading_c:
            self._reading_c = reading_c
            sums.total_c += reading_c
            sums.readings += 1
        return sums.span_s >= STRETCH_S

    def forget(self) -> None:
        """Begin anew, with nothing known."""
        self._belief, self._gathered, self._before = None, Gathered(), Gathered()
        self._heat, self._asked, self.known = 0.0, 0.0, Feasible()
        self._reach.forget()
        self._nearing.clear()

    def fail(self, failure: Failure) -> None:
        """Begin anew after a computation that failed, and say so once.

        No power depends on it, so none is taken away.
        """
        self.forget()
        if not self._failed:
            self._failed = True
            self._emit(FAILED, text=failure.text, trace=failure.trace)

    def reckon(self, wanted: Wanted, t_s: float) -> None:
        """Learn from the stretch that is complete, and say what it means for `wanted`."""
        now, before = self._gathered, self._before
        self._before, self._gathered = now, Gathered()
        reading_c = now.mean_c
        if self._belief is None:
            if math.isfinite(reading_c):
                self._belief = heat_loss.start(reading_c)
            return
        belief = heat_loss.after(
            self._belief,
            Stretch(
                0.5 * (before.span_s + now.span_s),
                0.5 * (before.heat_s + now.heat_s),
                reading_c,
                0.5 * (before.late_s + now.late_s),
            ),
        )
        if not belief.finite:
            self.forget()
            return
        self._belief = belief
        self._unseen_s = 0.0 if now.readings else self._unseen_s + now.span_s
        if self._unseen_s > UNSEEN_S:
            self.known = Feasible()
            return
        # A set point that never rests says nothing of what can be held, nor of an arrival.
        self.known = Feasible() if wanted.led else self._feasible(belief, wanted, t_s)
        given = Given(now.span_s, self._heat, self._asked)
        nears = self._nearing.arrives(wanted.setpoint_c)
        self._reach.tell(self.known, belief, wanted, given, t_s, nears=nears)

    # -- what follows ----------------------------------------------------------------------------

    def _feasible(self, belief: HeatBelief, wanted: Wanted, t_s: float) -> Feasible:
        """Return what is known well enough to be told."""
        held = heat_loss.holding(belief, wanted.setpoint_c)
        holding = self._settling.doubted(held, wanted.setpoint_c, t_s)
        highest = _within(heat_loss.reach(belief, wanted.power_max), SD_MOST_K)
        self._nearing.seen(highest, math.copysign(1.0, belief.gain), t_s)
        if wanted.beyond_ceiling:
            highest = Uncertain(wanted.ceiling_c, ARRIVED_K)
        arrival = self._slip.doubted(self._arrival(belief, wanted, holding), wanted.setpoint_c, t_s)
        arrival = _within(arrival, arrival.mean + self._lag_s)
        return Feasible(*_within(holding, POWER_SD_MOST), *highest, *arrival)

    def _arrival(self, belief: HeatBelief, wanted: Wanted, holding: Uncertain) -> Uncertain:
        """Return how long it takes with all power there is, and none at the end."""
        way_k = wanted.setpoint_c - self._reading_c
        left_k = abs(way_k)
        if left_k <= ARRIVED_K:
            return Uncertain(0.0, 0.0)
        setpoint_c = wanted.setpoint_c - math.copysign(ARRIVED_K, way_k)
        gain, lag_s = belief.gain, self._lag_s
        held = clamp(holding.mean, 0.0, wanted.power_max)
        coasting_c = self._reading_c + gain * lag_s * (self._heat - held)
        towards = (setpoint_c - coasting_c) * gain > 0.0
        power = wanted.power_max if towards else 0.0
        last_k = abs(gain) * lag_s * abs(power - held)
        if abs(setpoint_c - coasting_c) <= ARRIVED_K:
            last_k = left_k
        rest_s = REST_SHARE * lag_s * math.log(max(1.0, last_k / ARRIVED_K))
        rest = Uncertain(rest_s, LAG_DOUBT * (rest_s + lag_s))
        if abs(setpoint_c - coasting_c) <= ARRIVED_K:
            return rest
        arrival = heat_loss.arrival(belief, coasting_c, setpoint_c, power, rest)
        slower = wanted.ramp_s > arrival.mean
        return Uncertain(wanted.ramp_s, LAG_DOUBT * lag_s) if slower else arrival


def _within(known: Uncertain, sd_most: float) -> Uncertain:
    """Return what is known, or nothing where it is too vague to be told."""
    return known if known.sd <= sd_most else Uncertain()
