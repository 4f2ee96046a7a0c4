"""Alarms of the balance of heat: set point out of reach, plant that is driven.

Each comes when its condition holds by several standard deviations for some stretches in a row, and
goes more slowly.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from thermoctl.regulator.alarms import AlarmRegister
from thermoctl.regulator.balance import heat_loss
from thermoctl.regulator.balance.heat_belief import HeatBelief, T
from thermoctl.regulator.balance.left_alone import PATIENCE_S, Beyond, LeftAlone
from thermoctl.regulator.balance.wanted import BEYOND_K, Wanted
from thermoctl.regulator.supervisor import Emit
from thermoctl.signals import Alarm, Feasible

SURE_SDS, OVER_SDS = 3.0, 1.0
"""An alarm comes when its condition holds by more than SURE_SDS standard deviations, and goes when
it holds by less than OVER_SDS."""
FULL = 0.95
"""Share of the most power from which on it counts as full."""
STEADY = 12
"""Number of stretches in a row that must agree before an alarm comes or goes."""

UNREACHABLE = "setpoint.unreachable"
DRIVEN = "plant.driven"
_PRIORITY = 2
NONE = 0.02
"""Commanded power up to which the plant counts as unpowered. Heat that an output gives beyond its
command, because it cannot keep it back, drives the plant all the same."""


class Given(NamedTuple):
    """What a plant got in a stretch of `span_s`.

    Parameters
    ----------
    span_s : float
        How long it was.
    heat : float
        Power that has reached the sensor by its end.
    asked : float
        Of it, what was commanded; below 0 that of another actuator.
    """

    span_s: float
    heat: float
    asked: float


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


class ReachAlarms:
    """Raises the two alarms of a loop, and clears them.

    Parameters
    ----------
    alarms : AlarmRegister
        Where they are raised.
    emit : callable
        Called as ``emit(name, **fields)`` when one begins.
    """

    def __init__(self, alarms: AlarmRegister, emit: Emit) -> None:
        self._alarms, self._emit = alarms, emit
        self._alone = LeftAlone()
        self._standings = {UNREACHABLE: Standing(), DRIVEN: Standing()}

    def forget(self) -> None:
        """Begin anew with a plant of which nothing is known."""
        self._alone.clear()

    def tell(
        self,
        known: Feasible,
        belief: HeatBelief,
        wanted: Wanted,
        given: Given,
        t_s: float,
        *,
        nears: bool,
    ) -> None:
        """Raise the alarms, or clear them.

        Parameters
        ----------
        known : Feasible
            What was told of the set point.
        belief : HeatBelief
            What is believed of gain and loss.
        wanted : Wanted
            What is to be held.
        given : Given
            What the plant got in the last stretch.
        t_s : float
            Time of the loop.
        nears : bool
            Whether the farthest that power holds moves on to the set point.
        """
        full, none = given.heat >= FULL * wanted.power_max, abs(given.asked) <= NONE
        missing_sds = _missing_sds(belief, wanted, full)
        if nears and not wanted.beyond_ceiling:
            missing_sds = 0.0
        driven_sds = self._driven_sds(belief, wanted, given.span_s, none=none)
        for code, sds, words in (
            (UNREACHABLE, missing_sds, _missing_words),
            (DRIVEN, driven_sds, _driven_words),
        ):
            standing = self._standings[code]
            news = standing.weigh(sds, counts=wanted.counts)
            if standing.stands:
                text = words(known, belief, wanted)
                if self._alarms.set(Alarm(code, None, _PRIORITY, t_s, text)) and news:
                    self._emit(code, text=text)
            elif news:
                self._alarms.clear(code)

    def _driven_sds(
        self, belief: HeatBelief, wanted: Wanted, span_s: float, *, none: bool
    ) -> float:
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
        missing = self._alone.missing(plant, span_s, math.sqrt(belief.R))
        stays = self._alone.stays(here_c, way_k, span_s)
        if reversed_:
            return SURE_SDS * stays
        leaves = known or self._alone.waited
        leaves_sds = sign * away.mean / away.sd if leaves else 0.0
        return max(leaves_sds, SURE_SDS * missing, SURE_SDS * stays)


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
