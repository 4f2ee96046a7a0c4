r"""Heat that a block still holds, and for how long it goes on giving it.

A block can be told to be colder, but it cools down only as fast as it gives its heat away. With a
heater that gives :math:`K\,p` at power p, in K by which it would keep the block above the bath,

.. math:: \tau\,\dot T_b = K\,p - (T_b - T),

and a block that shall fall to some temperature brings :math:`\tau` times what it is above that
into the bath. K and :math:`\tau` follow from how it moves: from the first warm-up, before it has
ever been told to fall. Everything is filtered alike, so that no reading has to be differentiated.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from thermoctl.quantities import clamp

FILTER_S = 10.0
"""Time constant of the filters: a tenth of a kelvin of noise is then a hundredth in K/s."""
MOVES_K_PER_S = 0.03
"""A block that moves less than this tells nothing of how it moves."""
MEMORY = 1000.0
"""So many samples of movement count; a bath that is filled anew is another one."""
ENOUGH = 30.0
"""So many are needed, and of power and movement so much that the one does not explain the other."""
APART = 0.02
LONGEST_S = 600.0
"""No block is taken to be slower."""
GAP_S = 60.0


class Sums(NamedTuple):
    """Sums over the samples of movement: of their number, and of products.

    `power`, `rate` and `above` stand for the filtered p, rate and block less bath.
    """

    samples: float = 0.0
    power_power: float = 0.0
    power_rate: float = 0.0
    rate_rate: float = 0.0
    power_above: float = 0.0
    rate_above: float = 0.0


class StoredHeat(NamedTuple):
    """What is known of the heat that a block keeps.

    Parameters
    ----------
    t_s : float
        Time of the last sample; NaN before one.
    power, block_c, above_k : float
        What the heater gave, the block, and by how much it is warmer than what it heats: filtered.
    sums : Sums
        What has been seen of its movements.
    """

    t_s: float = math.nan
    power: float = 0.0
    block_c: float = math.nan
    above_k: float = 0.0
    sums: Sums = Sums()

    def after(self, t_s: float, power: float, block_c: float, bath_c: float) -> StoredHeat:
        """Return the same after `power` until `t_s` and two readings of then, in degC.

        What is not finite is a gap: the filters begin anew, and what is known stays.
        """
        if not math.isfinite(t_s + power + block_c + bath_c):
            return StoredHeat(sums=self.sums)
        above_k, interval_s = block_c - bath_c, t_s - self.t_s
        if not 0.0 < interval_s <= GAP_S:  # NaN too
            return StoredHeat(t_s, block_c=block_c, sums=self.sums)  # all filters at rest, alike
        share = interval_s / (FILTER_S + interval_s)
        smooth_c = self.block_c + share * (block_c - self.block_c)
        rate = (smooth_c - self.block_c) / interval_s
        given = self.power + share * (power - self.power)
        above = self.above_k + share * (above_k - self.above_k)
        return StoredHeat(t_s, given, smooth_c, above, _with(self.sums, given, rate, above))

    @property
    def lasts_s(self) -> float:
        """Time constant with which the block gives its heat away, in s; 0: not known."""
        n, pp, pr, rr, pa, ra = self.sums
        apart = pp * rr - pr * pr
        if n < ENOUGH or apart <= APART * pp * rr:
            return 0.0
        return clamp((pr * pa - pp * ra) / apart, 0.0, LONGEST_S)


def _with(sums: Sums, power: float, rate: float, above_k: float) -> Sums:
    """Return `sums` with another sample, unless the block hardly moves in it."""
    if abs(rate) < MOVES_K_PER_S:
        return sums
    left = 1.0 - 1.0 / MEMORY
    new = (1.0, power * power, power * rate, rate * rate, power * above_k, rate * above_k)
    return Sums(*(left * before + more for before, more in zip(sums, new, strict=True)))
