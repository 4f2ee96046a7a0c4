"""Whether the set point can be held, with which power, and when it is reached.

A balance of heat is kept beside every controller, in every mode. It needs what was applied and what
was read, and from the controller no more than its lag. Readings are gathered over stretches of some
seconds, so that a sample costs next to nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from thermoctl.quantities import Uncertain, clamp
from thermoctl.regulator.alarms import AlarmRegister
from thermoctl.regulator.balance import heat_loss
from thermoctl.regulator.balance.foretold import Nearing, Settling, Slip
from thermoctl.regulator.balance.heat_belief import HeatBelief, T
from thermoctl.regulator.balance.heat_loss import Stretch
from thermoctl.regulator.balance.left_alone import PATIENCE_S, Beyond, LeftAlone
from thermoctl.regulator.guard import Failure
from thermoctl.regulator.supervisor import Emit
from thermoctl.signals import Alarm, Feasible, Mode

STRETCH_S = 10.0
LAG_GUESS_S = 30.0
"""Lag in s that is assumed while the controller knows none."""
ARRIVED_K = 0.1
"""Distance in K from the set point within which it counts as reached."""
SURE_SDS, OVER_SDS = 3.0, 1.0
"""An alarm comes when its condition holds by more than SURE_SDS standard deviations, and goes when
it holds by less than OVER_SDS."""
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
FULL = 0.95
"""Share of the most power from which on it counts as full."""
STEADY = 12
"""Number of stretches in a row that must agree before an alarm comes or goes."""

UNREACHABLE = "setpoint.unreachable"
DRIVEN = "plant.driven"
FAILED = "balance.failed"
_PRIORITY = 2
NONE = 0.02
"""Commanded power up to which the plant counts as unpowered. Heat that an output gives beyond its
command, because it cannot keep it back, drives the plant all the same."""
BEYOND_K = 0.5
"""Distance in K beyond the set point from which on a plant is driven, and distance of a set point
beyond the ceiling from which on it is out of reach. Less is regulation."""


class Gathered(NamedTuple):
    """Sums over a stretch that is not complete."""

    span_s: float = 0.0
    heat_s: float = 0.0
    late_s: float = 0.0
    total_c: float = 0.0
    readings: int = 0

    @property
    def mean_c(self) -> float:
        """Mean reading; NaN without one."""
        return self.total_c / self.readings if self.readings else math.nan


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is to be held, in `mode`: a set point in degC, with at most `power_max`.

    `ramp_s` is how long the reference is still on its way there; `power_cools` says what power does
    where it is wired as it should be. `led`: it is another loop that wants it, and never all of it
    at once: nothing is told of such a set point. `ceiling_c` is what the plant was seen to come to,
    and not to pass for all its power.
    """

    setpoint_c: float
    power_max: float
    mode: Mode
    ramp_s: float = 0.0
    power_cools: bool = False
    led: bool = False
    ceiling_c: float = math.nan

    @property
    def counts(self) -> bool:
        """Whether anybody is told that it cannot be held."""
        return self.mode is Mode.AUTO and not self.led

    @property
    def beyond_ceiling(self) -> bool:
        """Whether the plant has been seen not to come near the set point."""
        beyond_k = self.setpoint_c - self.ceiling_c
        return (-beyond_k if self.power_cools else beyond_k) > BEYOND_K


class Standing:
    """Whether a condition has held for long enough; it ends more slowly."""

    def __init__(self) -> None:
        self.stands, self._contrary = False, 0

    def weigh(self, sds: float, *, counts: bool) -> bool:
        """Take in its standard deviations in a stretch; return whether it changed."""
        stood, far = self.stands, sds > (OVER_SDS if self.stands else SURE_SDS)
        self._contrary = 0 if far is stood else self._contrary + 1
        if self._contrary >= STEADY or not counts:
            self.stands, self._contrary = far and counts, 0
        return self.stands is not stood


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
        self._alarms = alarms
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
        self._alone = LeftAlone()
        self._failed = False
        self._standings = {UNREACHABLE: Standing(), DRIVEN: Standing()}
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
        heat, seen = self._heat, reading_c == reading_c
        if seen:
            self._reading_c = reading_c
        span_s, heat_s, late_s, total_c, readings = self._gathered
        self._gathered = Gathered(
            span_s + interval_s,
            heat_s + interval_s * heat,
            late_s + interval_s * (abs(warming - heat) + warming - applied),
            total_c + reading_c if seen else total_c,
            readings + seen,
        )
        return self._gathered.span_s >= STRETCH_S

    def forget(self) -> None:
        """Begin anew, with nothing known."""
        self._belief, self._gathered, self._before = None, Gathered(), Gathered()
        self._heat, self._asked, self.known = 0.0, 0.0, Feasible()
        self._alone.clear()
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
        self._tell(belief, wanted, t_s)

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

    def _driven_sds(self, belief: HeatBelief, wanted: Wanted, none: bool) -> float:
        """Return by how many standard deviations a plant without power is driven.

        It leaves the set point behind, or does not come back to it: something else heats what
        should be heated, the air or an output that is stuck at too little for `heater.stuck_on`.
        The first needs no gain: what has been stuck on since before a start is all that this run
        has seen of its heater. Nor does it need one that a plant stands still where it is, or goes
        on: a controller that takes its power back in vain teaches that power does the opposite.
        """
        sign = -1.0 if wanted.power_cools else 1.0
        here_c, gain = sign * belief.x[T], sign * belief.gain
        self._alone.seen(here_c)
        way_k = here_c - sign * wanted.setpoint_c
        known = belief.gain_known
        reversed_ = known and gain < 0.0 and not self._alone.knows
        if not (none and way_k >= BEYOND_K):
            self._alone.clear()
            return 0.0
        away = heat_loss.spare(belief, sign * here_c, 0.0, belief.ahead_k)
        plant = Beyond(here_c, gain, -sign * away.mean) if known else Beyond(here_c, 0.0, 0.0)
        missing = self._alone.missing(plant, self._before.span_s, math.sqrt(belief.R))
        stays = self._alone.stays(here_c, way_k, self._before.span_s)
        if reversed_:
            return SURE_SDS * stays
        leaves = known or self._alone.waited
        leaves_sds = sign * away.mean / away.sd if leaves else 0.0
        return max(leaves_sds, SURE_SDS * missing, SURE_SDS * stays)

    def _tell(self, belief: HeatBelief, wanted: Wanted, t_s: float) -> None:
        """Raise the alarms, or clear them."""
        full, none = self._heat >= FULL * wanted.power_max, abs(self._asked) <= NONE
        missing_sds = _missing_sds(belief, wanted, full)
        if self._nearing.arrives(wanted.setpoint_c) and not wanted.beyond_ceiling:
            missing_sds = 0.0  # the limit moves on to the set point
        driven_sds = self._driven_sds(belief, wanted, none)
        for code, sds, words in (
            (UNREACHABLE, missing_sds, _missing_words),
            (DRIVEN, driven_sds, _driven_words),
        ):
            standing = self._standings[code]
            news = standing.weigh(sds, counts=wanted.counts)
            if standing.stands:
                text = words(self.known, belief, wanted)
                if self._alarms.set(Alarm(code, None, _PRIORITY, t_s, text)) and news:
                    self._emit(code, text=text)
            elif news:
                self._alarms.clear(code)


def _within(known: Uncertain, sd_most: float) -> Uncertain:
    """Return what is known, or nothing where it is too vague to be told."""
    return known if known.sd <= sd_most else Uncertain()


def _missing_sds(belief: HeatBelief, wanted: Wanted, full: bool) -> float:
    """Return by how many standard deviations the most power does not reach the set point.

    That is the better of two ways to be sure: by the slope that was learnt, and by how slowly the
    plant still moves, which also tells of one that stands at its limit from the start.
    """
    if wanted.beyond_ceiling:
        return math.inf
    here_c = belief.x[T]
    way_k = wanted.setpoint_c - here_c
    towards = math.copysign(1.0, way_k)
    if belief.gain_known and towards * belief.gain < 0.0:
        return 0.0  # a heater is not asked to cool
    here = heat_loss.spare(belief, here_c, wanted.power_max)
    slow = (abs(way_k) / PATIENCE_S - towards * here.mean) / here.sd
    if not belief.gain_known:
        return slow if full else 0.0
    there = heat_loss.spare(belief, wanted.setpoint_c, wanted.power_max, straight=True)
    return max(slow, -towards * there.mean / there.sd)


def _driven_words(_: Feasible, belief: HeatBelief, wanted: Wanted) -> str:
    """Return what was expected of a plant without power, and what came."""
    minute_k = 60.0 * heat_loss.spare(belief, belief.x[T], 0.0).mean
    return (
        f"expected the plant to come to {wanted.setpoint_c:g} degC without power, it moves by "
        f"{minute_k:+.2f} K a minute at {belief.x[T]:.1f} degC"
    )


def _missing_words(known: Feasible, belief: HeatBelief, wanted: Wanted) -> str:
    """Return what was expected of the set point, and what came."""
    here_c = belief.x[T]
    side = "most" if wanted.setpoint_c > here_c else "least"
    which = "full power" if wanted.power_max == 1.0 else f"a power of {wanted.power_max:g}"
    limit = f"{known.highest_c:.1f} +-{known.highest_sd_k:.1f} degC"
    if not math.isfinite(known.highest_c):
        limit = f"about {here_c:.1f} degC"
    return (
        f"expected at {side} {limit}, which {which} can hold, "
        f"got a set point of {wanted.setpoint_c:g} degC"
    )
