"""Outputs that do not give quite what they are asked for."""

from __future__ import annotations

import math
from typing import NamedTuple

from thermoctl.ports import Situation
from thermoctl.quantities import clamp

INEXACT_S, INEXACT = 30.0, 0.1
"""Time constant in s of the mean error of an output, and the largest error in power that counts. An
output that gives less by more than that is limited, not inexact."""
PULSES_S = 900.0
"""Time in s for which an output that has given far more than its command is taken for a relay;
where 2 % of power hold a plant, one of 10 s rests for eight minutes."""
AHEAD_S = 60.0
"""Most heat, in s of full power, that an output is taken to be ahead of its commands."""


class Inexact(NamedTuple):
    """Error of an output against its commands.

    Parameters
    ----------
    more : float
        Mean error of the power: above 0 it gives more than the command.
    pulses_s : float
        Time in s for which it still counts as a relay, which gives more and then nothing.
    """

    more: float = 0.0
    pulses_s: float = 0.0

    def after(self, situation: Situation) -> Inexact:
        """Return the same after a sample; the pauses of a relay are no error of it."""
        more, pulses_s = self
        off = situation.applied - situation.commanded
        if off == 0.0 == more and pulses_s == 0.0:  # nearly always
            return self
        if pulses_s > 0.0:
            pulses_s = max(pulses_s - situation.interval_s, 0.0)
        if abs(situation.applied) > abs(situation.commanded) + INEXACT:
            return Inexact(more, PULSES_S)
        if pulses_s > 0.0 and situation.applied == 0.0:
            off = 0.0
        if abs(off) <= INEXACT:
            share = situation.interval_s / INEXACT_S
            more += (off - more) * (1.0 if share > 1.0 else share)
        return Inexact(more, pulses_s)

    def made_up_for(self, power: float) -> float:
        """Return what to command so that the output gives `power`; none stays none.

        A law knows what was given, and so what the plant will do. It would never learn that it is
        not given what it asks for.
        """
        exact = power - self.more
        if power > 0.0:
            return 0.0 if exact < 0.0 else exact
        return min(exact, 0.0) if power < 0.0 else power


EXACT = Inexact()
"""Before the first sample."""


def ahead(before_s: float, situation: Situation) -> float:
    """Return by how much an output is ahead of its commands after this sample.

    Limits never give more than was asked for, relays do, and then less: those are on or off.
    """
    beyond = abs(situation.applied) - abs(situation.commanded)
    if beyond > INEXACT or (beyond < 0.0 and before_s > 0.0):
        return clamp(before_s + beyond * situation.interval_s, 0.0, AHEAD_S)
    return before_s


def given(situation: Situation, *, pulses: bool) -> float:
    """Return the power that limits and others have left of what was asked for.

    An output that gives more than the command, or a little less, is not exact, and its error is for
    an integral to find: a law that follows it adds it to its own power at every sample. Nor is one
    limited that leaves out what it gave too much before: it `pulses`.
    """
    applied, commanded = situation.applied, situation.commanded
    limited = abs(applied) < abs(commanded) - INEXACT and not pulses
    return applied if limited or math.isnan(commanded) else commanded
