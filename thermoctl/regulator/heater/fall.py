"""A reading that falls faster than any heater can make it."""

from __future__ import annotations

from collections.abc import Collection

from thermoctl.regulator.heater.question import slope
from thermoctl.regulator.heater.response import Gain, Seen

WILD, RESTS = 1.3, 0.5
"""A fall, less the loss, is too fast for any heater beyond WILD times its gain, and over below
RESTS times: ice in the water, or a sensor in the air. What follows the cut is then no answer, so
the next heat has to be answered, and soon. From then on no fall is too fast: ice does not come and
go with the power, but a reversed actuator does, and a Peltier element heats by more than it
cools."""
WILD_S = 60.0
"""Least time in s that such a fall must last to be questioned, at the limit that holds after a bad
answer: longer than water takes to mix."""
OVER = "the reading fell faster than any heater can make it: the next heat is what it is asked by"


def wild(rows: Collection[Seen], froms_s: tuple[float, ...], known: Gain, loss: float) -> bool:
    """Return whether it fell so since any of `froms_s`; it loses `loss` in K/s."""
    return any(_fell(rows, from_s, loss) > WILD * known.mean for from_s in froms_s)


def over(rows: Collection[Seen], from_s: float, known: Gain, loss: float) -> bool:
    """Return whether it has not fallen so since `from_s`."""
    return not _fell(rows, from_s, loss) > RESTS * known.mean


def _fell(rows: Collection[Seen], from_s: float, loss: float) -> float:
    """Return how much faster than by its loss the reading fell, in K/s; NaN for too few rows."""
    return -slope(rows, from_s) - max(loss, 0.0)
