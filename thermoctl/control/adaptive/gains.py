"""Gains of the filters: at rest they are reckoned at every fifteenth sample.

The covariance of a Kalman filter does not depend on what is read. In a plant at rest it has come to
where a reading takes away what a period has added, and the gains are those of the sample before. To
find them again costs more than all that is done with them. So once they have settled they are kept,
as those of a steady filter are; whatever is more than rest has them reckoned at once.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import NamedTuple

from thermoctl.control.adaptive import filters
from thermoctl.control.adaptive.filters import Block, D, PerPeriod
from thermoctl.quantities import Array

GOOD_SAMPLES = 14
"""For so many samples after the one that reckoned them gains are good, once they have settled."""
SETTLED = 0.05
"""They have settled when what binds the loss to the reading, K S, has changed by no more than this
share since they were reckoned before: it is the slowest, and R, which wanders, does not count."""


class Gains(NamedTuple):
    """What filters make of an innovation in a plant at rest.

    Parameters
    ----------
    K : ndarray, shape (4, n)
        By how much the states of each go with its innovation.
    S : ndarray, shape (n,)
        Variances of the innovations.
    age, kept : int
        Samples since these were reckoned, and in how many of them P was left as it was.
    settled : bool
        Whether they are about what they were when reckoned before.
    """

    K: Array
    S: Array
    age: int = 0
    kept: int = 0
    settled: bool = False

    @property
    def fresh(self) -> bool:
        """Whether they need not be reckoned yet."""
        return self.age < GOOD_SAMPLES

    def older(self, *, kept: bool) -> Gains:
        """Return the same, a sample later in which P was `kept` or not."""
        return Gains(self.K, self.S, self.age + 1, self.kept + kept, self.settled)


class Corrected(NamedTuple):
    """A full step: the block predicted for a reading, the one corrected by it, and S."""

    predicted: Block
    block: Block
    S: Array


def reckoned(
    before: Gains | None,
    step: Corrected,
    last: Block | None,
    likeliest: int,
    constants: PerPeriod,
) -> Gains:
    """Return the gains of a `step` of rest, after those that were reckoned `before`.

    Its block is given what P has missed since it was left alone, as in the `last` one; in place.
    """
    S, K = step.S, filters.gains_at_rest(step.predicted, step.S, constants)
    if before is not None and before.kept and last is not None:
        K[D] *= filters.caught_up(step.block, last, before.kept)
    for array in (K, S):
        array.setflags(write=False)
    if before is None:
        return Gains(K, S)
    now = K.item(D, likeliest) * S.item(likeliest)
    then = before.K.item(D, likeliest) * before.S.item(likeliest)
    return Gains(K, S, 0, 0, abs(now - then) <= SETTLED * abs(now))
