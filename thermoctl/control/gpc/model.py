r"""An ARX model of changes: one pole of the plant at 1, and a loss that is learnt.

.. math::

    \Delta y(t) + a_1 \Delta y(t-1) + \dots + a_{n-1} \Delta y(t-n+1)
        = b_1 u(t-d) + \dots + b_m u(t-d-m+1) - \ell

y are mean temperatures of blocks and u mean powers. Of the n poles of the plant one is 1: water
keeps its heat over the horizon of a controller, and what it loses is the offset :math:`\ell`.

Implements section 10 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from operator import mul

import numpy as np

from thermoctl.model.arx import Arx
from thermoctl.quantities import Array

N_MAX, M_MAX, DELAY_MAX = 3, 12, 60


@dataclass(frozen=True, slots=True)
class ChangeModel:
    """The structure, and what follows from its parameters.

    theta is (a_1 ... a_(n-1), b_1 ... b_m, loss), b's and loss in K a block.

    Parameters
    ----------
    n : int
        Poles, the one at 1 included; 1 to 3.
    m, delay : int
        Inputs, 1 to 12, and blocks to the first of them, 1 to 60: with 1 the power of a block has
        an effect on the mean of the same block.

    Raises
    ------
    ValueError
        An argument is outside its range.
    """

    n: int
    m: int
    delay: int
    changes: Arx = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name, most in (("n", N_MAX), ("m", M_MAX), ("delay", DELAY_MAX)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
                raise ValueError(f"{name} must be an integer from 1 to {most}, got {value!r}")
        object.__setattr__(self, "changes", Arx(self.n - 1, self.m, self.delay))

    @property
    def parameters(self) -> int:
        """Length of theta."""
        return self.n + self.m

    @property
    def inputs(self) -> slice:
        """Where the b's stand in theta."""
        return slice(self.n - 1, self.n - 1 + self.m)

    @property
    def u_memory(self) -> int:
        """How many blocks of power the model takes."""
        return self.delay + self.m - 1

    @property
    def memory(self) -> int:
        """How many blocks a change and its regressor reach back."""
        return max(self.n + 1, self.u_memory)

    def regressor(self, changes_k: Array, powers: Array) -> Array:
        """Return phi, shape (parameters,), of pasts that run newest first."""
        phi = np.empty(self.parameters)
        phi[:-1] = self.changes.regressor(changes_k, powers)
        phi[-1] = -1.0
        return phi

    def gain_k(self, theta: Array) -> float:
        """Return what full power comes to in the end, in K a block; B(1)/A(1)."""
        a, b = theta[: self.n - 1], theta[self.inputs]
        return float(b.sum()) / (1.0 + float(a.sum()))

    def holding(self, theta: Array) -> float:
        """Return the power that makes up for the loss."""
        return float(theta[-1]) / float(theta[self.inputs].sum())

    def lag(self, theta: Array) -> float:
        """Return the mean delay of B/A, in blocks, 0 for the newest block of power."""
        a, b = theta[: self.n - 1], theta[self.inputs]
        numerator = float(b @ np.arange(self.delay - 1.0, self.delay - 1.0 + self.m))
        poles = float(a @ np.arange(1.0, float(self.n)))
        return numerator / float(b.sum()) - poles / (1.0 + float(a.sum()))

    def under_way_k(self, theta: Array, changes_k: Array, powers: Array) -> float:
        """Return what is still to come of the past if power only holds, in K.

        Parameters
        ----------
        theta : ndarray, shape (parameters,)
            The model.
        changes_k : ndarray, shape (n - 1,) or longer
            Past changes, newest first.
        powers : ndarray, shape (delay + m - 2,) or longer
            Past powers less the one that holds, newest first.
        """
        values, poles = theta.tolist(), self.n - 1
        given, changes = powers.tolist(), changes_k.tolist()
        felt = self.delay - 1  # newest powers that a b has not met yet
        moved = sum(b * sum(given[: felt + k]) for k, b in enumerate(values[self.inputs]))
        moved -= sum(a * sum(changes[: i + 1]) for i, a in enumerate(values[:poles]))
        return float(moved / (1.0 + sum(values[:poles])))

    def foreseen(
        self, theta: Array, changes_k: Array, powers: Array, power: float, length: int
    ) -> list[float]:
        """Return how far the temperature will have moved after each block to come, in K.

        Parameters
        ----------
        theta : ndarray, shape (parameters,)
            The model.
        changes_k : ndarray, shape (n - 1,) or longer
            Past changes, newest first.
        powers : ndarray, shape (delay + m - 2,) or longer
            Past powers, newest first.
        power : float
            Every power to come.
        length : int
            Blocks to look ahead.
        """
        values = theta.tolist()
        a, b, loss = values[: self.n - 1], values[self.inputs], values[-1]
        recent = changes_k[: self.n - 1].tolist()
        # given[j : j + m] are the powers that block j + 1 regresses on, oldest first
        given = powers[: self.u_memory - 1][::-1].tolist() + [power] * length
        b.reverse()
        moved, foreseen = 0.0, []
        for j in range(length):
            change = sum(map(mul, b, given[j : j + self.m])) - sum(map(mul, a, recent)) - loss
            recent.insert(0, change)
            moved += change
            foreseen.append(moved)
        return foreseen

    def step_response(self, theta: Array, length: int) -> list[float]:
        """Return what one step of full power will have moved after each block, in K."""
        bare = theta.copy()
        bare[-1] = 0.0
        return self.foreseen(bare, np.zeros(self.n), np.zeros(self.u_memory), 1.0, length)
