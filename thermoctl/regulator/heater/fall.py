"""A reading that falls faster than any heater can make it."""

from __future__ import annotations

from collections.abc import Collection

from thermoctl.regulator.heater.doubt import Seen
from thermoctl.regulator.heater.question import slope
from thermoctl.regulator.heater.response import Gain

WILD, RESTS = 1.3, 0.5
"""A reading that falls faster than a heater which cools this much better than it heated: ice in the
water, or a sensor in the air. What follows the cut is then no answer; it is over at the second.
That nothing explains the fall is no answer either: the next heat has to be answered, and soon. Then
no fall is wild: ice does not come and go with the power, but an actuator that is turned round does,
and a Peltier element heats by more than it cools."""
WILD_S = 60.0
"""Such a fall is a doubt as soon as after a bad answer, once it lasts longer than water mixes."""
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
