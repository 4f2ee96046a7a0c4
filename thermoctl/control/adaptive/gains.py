"""Gains of the filters: at rest they are reckoned at every fifteenth sample.

The covariance of a Kalman filter does not depend on what is read. In a plant at rest it has come to
where a reading takes away what a period has added, and the gains are those of the sample before. To
find them again costs more than all that is done with them. So once they have settled they are kept,
as those of a steady filter are; whatever is more than rest is met by a full sample.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import NamedTuple

from thermoctl.control.adaptive import filters
from thermoctl.control.adaptive.evidence import Weights
from thermoctl.control.adaptive.filters import Block, D, PerPeriod
from thermoctl.quantities import Array, frozen

GOOD_SAMPLES = 14
"""Number of samples for which settled gains are kept after the one that computed them."""
SETTLED = 0.05
"""Largest relative change of K S, which binds the loss to the reading, since gains were computed
before, for which they have settled. It is the slowest part; R wanders, and does not count."""
KNOWN = 0.9
"""Least weight of the hypotheses that know the gain of the plant, for gains to have settled. Where
it is not known, rest is still telling of it, and binding it to the loss."""


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
    weights: Weights,
    constants: PerPeriod,
) -> Gains:
    """Return the gains of a `step` of rest, after those that were reckoned `before`.

    Its block is given what P has missed since it was left alone, as in the `last` one; in place.
    """
    S, known = step.S, filters.gain_known(step.predicted, constants)
    K = filters.gains_at_rest(step.predicted, S, known)
    if before is not None and before.kept and last is not None:
        K[D] *= filters.caught_up(step.block, last, before.kept)
    frozen(K)
    frozen(S)
    if before is None:
        return Gains(K, S)
    m = weights.likeliest
    now, then = K.item(D, m) * S.item(m), before.K.item(D, m) * before.S.item(m)
    settled = abs(now - then) <= SETTLED * abs(now) and float(weights.share.dot(known)) >= KNOWN
    return Gains(K, S, 0, 0, settled)
