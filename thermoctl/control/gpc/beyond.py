r"""The terminal cost: what powers cost beyond the horizon, on a straight line.

Once the lag is over, nothing is left of the model but heat put in less heat lost. The reading that
all heat under way leads to is

.. math::

    z(t+j) = y(t) + h(t) + \frac{B(1)}{A(1)} \sum_{i=1}^{j} u_i - \frac{\ell}{A(1)}\,j,

where h is what comes of the past if power only holds from now on; at rest it is 0, and z is y.
A few samples of :math:`(z - r)^2` stand for as many blocks as lie between them. A horizon of
that length would cost its whole way through the model, at every sample. Without it a sensor that
is slow beside the horizon is made to arrive early by water that is too hot.

Implements section 10 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from thermoctl.quantities import Array

STRETCHES = 3
"""Number of horizons added to the first. With none, a tank whose element and sensor lag by 40 s
each is overshot by 0.2 K; five move the power farther and gain little more."""


@dataclass(frozen=True, slots=True, eq=False)
class Beyond:
    """The cost of the powers from the end of a horizon on.

    Parameters
    ----------
    length : int
        Blocks of the horizon.
    moves : int
        Powers that are asked for; the last of them is kept.
    """

    length: int
    moves: int
    _blocks: Array = field(init=False, repr=False)
    _shares: Array = field(init=False, repr=False)
    _square: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        blocks = self.length * np.arange(2.0, STRETCHES + 2.0)
        shares = np.ones((STRETCHES, self.moves))  # of z: how many blocks each power has lasted
        shares[:, -1] = blocks - (self.moves - 1.0)
        object.__setattr__(self, "_blocks", blocks)
        object.__setattr__(self, "_shares", self.length * shares)
        object.__setattr__(self, "_square", self.length * (shares.T @ shares))

    def cost(self, error_k: float, loss_k: float, gain_k: float) -> tuple[Array, Array]:
        """Return H and g of the cost ``x' H x / 2 - g' x``.

        Parameters
        ----------
        error_k : float
            Set point minus reading and heat under way.
        loss_k, gain_k : float
            What a block loses, and what full power adds to it, in the end.
        """
        errors_k = error_k + loss_k * self._blocks
        return gain_k * gain_k * self._square, gain_k * (errors_k @ self._shares)
