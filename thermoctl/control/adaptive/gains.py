"""Gains of the filters, which at rest are reckoned at every fifteenth sample only.

The covariance of a Kalman filter does not depend on what is read. In a plant at rest it has come to
where a reading takes away what a period has added, and the gains are those of the sample before. To
find them again costs more than all that is done with them. So once they have settled they are kept,
as those of a steady filter are; whatever is more than rest has them reckoned at once.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import NamedTuple

from thermoctl.control.adaptive.filters import D
from thermoctl.quantities import Array

KEPT_SAMPLES = 14
"""For so many samples after the one that reckoned them gains are good."""
SETTLED = 0.01
"""Gains have settled when what binds the loss to the reading, K S, changes by no more than this
share: of all it is the slowest, and R, which wanders, does not count."""


class Gains(NamedTuple):
    """What filters make of an innovation in a plant at rest.

    Parameters
    ----------
    K : ndarray, shape (4, n)
        By how much the states of each go with its innovation.
    S : ndarray, shape (n,)
        Variances of the innovations.
    age : int
        Samples since these were reckoned.
    settled : bool
        Whether they are about what they were when reckoned before.
    """

    K: Array
    S: Array
    age: int = 0
    settled: bool = False

    @property
    def lasting(self) -> bool:
        """Whether they may be kept for another sample of rest."""
        return self.settled and self.age < KEPT_SAMPLES

    def older(self) -> Gains:
        """Return the same, a sample later."""
        return Gains(self.K, self.S, self.age + 1, self.settled)


def reckoned(before: Gains | None, K: Array, S: Array, likeliest: int) -> Gains:
    """Return the gains of a sample of rest; `before` are those of the last one."""
    if before is None:
        return Gains(K, S)
    now = K.item(D, likeliest) * S.item(likeliest)
    then = before.K.item(D, likeliest) * before.S.item(likeliest)
    return Gains(K, S, 0, abs(now - then) <= SETTLED * abs(now))
