"""A reading that goes up and down, and whether the power can have made it do so.

Explained in ``docs/insight.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from thermoctl.insight.harris import autocorrelation
from thermoctl.insight.wording import plain
from thermoctl.quantities import Array

SWING = 0.5
"""A loop swings when the autocorrelation of its error is above SWING after a period, and below
-SWING after half of one."""
TURNS = 4
"""Number of periods over which a cycle keeps its phase; then it may begin anew."""
NOT_MADE = 0.5
"""Share of a cycle that the power can have made, below which it has not made it."""


@dataclass(frozen=True, slots=True)
class Swing:
    """A cycle of a reading.

    Parameters
    ----------
    turn_s : float
        How long a turn takes.
    made : float
        The most of it that the power can have made, as a share; NaN where nobody knows the gain.
    """

    turn_s: float
    made: float

    @property
    def elsewhere(self) -> bool:
        """Whether something else than the power makes it."""
        return self.made < NOT_MADE

    @property
    def words(self) -> str:
        """The cycle, and what makes it where that is known."""
        cycle = f"a cycle of {plain(self.turn_s)} s"
        if not self.elsewhere:
            return cycle
        return (
            f"{cycle} that the power told here cannot make: an output that pulses, a load that "
            "comes and goes, or hum"
        )


def swing_of(
    error: Array, power: Array, period_s: float, lag_s: float, gain_k_per_s: float
) -> Swing | None:
    r"""Return the cycle of a reading, None where it does not swing.

    Power of the amplitude U moves water by $g U / \omega$ about its mean. Loss and lag only take
    from that, so a reading that swings by much more is moved by something else.

    Parameters
    ----------
    error, power : ndarray, shape (N,)
        Control errors in K, and the power given then, as a fraction.
    period_s, lag_s : float
        Time between two samples, total lag of the plant.
    gain_k_per_s : float
        Heating rate at full power, NaN where nobody knows it.
    """
    turn_s = cycle_s(error, period_s, lag_s)
    if turn_s is None:
        return None
    turn = turn_s / period_s
    moved_k = abs(gain_k_per_s) * turn_s / (2.0 * math.pi) * _amplitude(power, turn)
    return Swing(turn_s, moved_k / max(_amplitude(error, turn), 1e-9))


def _amplitude(values: Array, turn: float) -> float:
    """Return by how much `values` swing with this turn, in samples."""
    length = min(round(TURNS * turn), len(values))
    whole = values[: len(values) // length * length].reshape(-1, length)
    wave = np.exp(-2j * math.pi / turn * np.arange(length))
    parts = 2.0 / length * (whole - whole.mean(axis=1, keepdims=True)) @ wave
    return float(np.sqrt(np.mean(np.abs(parts) ** 2)))


def cycle_s(error: Array, period_s: float, lag_s: float) -> float | None:
    """Return the period of a cycle in s, None where the loop does not swing.

    The autocorrelation of a cycle is as negative after half a turn as it is positive after a whole
    one; that of a filtered noise has died down by then.
    """
    reach = min(len(error) // 4, math.ceil(20.0 * lag_s / period_s))
    e = error - error.mean()
    if reach < 4 or not float(e @ e) > 0.0:
        return None
    r = autocorrelation(e, reach)
    below = np.flatnonzero(r < 0.0)
    if not len(below):
        return None
    trough = int(below[0])
    back = np.flatnonzero(r[trough:] > 0.0)
    if not len(back):
        return None
    half = trough + int(np.argmin(r[trough : trough + int(back[0])]))
    peak = trough + int(back[0]) + int(np.argmax(r[trough + int(back[0]) :]))
    if r[half] < -SWING and r[peak] > SWING:
        return peak * period_s
    return None
