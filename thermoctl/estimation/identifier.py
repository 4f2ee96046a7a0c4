"""From temperatures and applied powers to a belief about the plant.

Implements section 3 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from thermoctl.estimation.belief import scalar, start
from thermoctl.filling import quickly_filled
from thermoctl.model.arx import Structure
from thermoctl.ports import Estimator
from thermoctl.quantities import Array, frozen
from thermoctl.signals import Estimate


@quickly_filled
@dataclass(frozen=True, slots=True, eq=False)
class IdentifierBelief:
    """An estimate and the past of its next regressor; arrays read-only.

    Parameters
    ----------
    estimate : Estimate
        Belief about the parameters.
    y_past_c : ndarray, shape (structure.y_memory,)
        Temperatures, newest first; NaN for one that was missing or came before the start.
    u_past : ndarray, shape (structure.u_memory,)
        Applied powers, newest first; NaN before the start.
    """

    estimate: Estimate
    y_past_c: Array
    u_past: Array


@dataclass(frozen=True, slots=True, eq=False)
class Identifier:
    """A structure and a law of estimation, put together.

    A sample is learned from only when all of its regressor is known. One that is missing leaves a
    gap in the past, and learning pauses until the gap has passed through the regressor.

    Parameters
    ----------
    structure : Structure
        What is regressed on what.
    law : Estimator
        How it is learned, guards included.
    theta0, P0
        First guess and its covariance, as in `thermoctl.estimation.start`.

    Raises
    ------
    ValueError
        `theta0` or `P0` does not fit the structure.
    """

    structure: Structure
    law: Estimator
    theta0: npt.ArrayLike | None = None
    P0: float | npt.ArrayLike = 1.0
    _first: IdentifierBelief = field(init=False, repr=False)

    def __post_init__(self) -> None:
        first = IdentifierBelief(
            start(self.structure.parameters, self.P0, self.theta0),
            frozen(np.full(self.structure.y_memory, np.nan)),
            frozen(np.full(self.structure.u_memory, np.nan)),
        )
        object.__setattr__(self, "_first", first)

    def start(self) -> IdentifierBelief:
        """Return the belief before the first sample, with nothing known of the past."""
        return self._first

    def update(
        self, belief: IdentifierBelief, temperature_c: float, applied: float
    ) -> IdentifierBelief:
        """Return the belief after one sample.

        Parameters
        ----------
        belief : IdentifierBelief
            What was believed before; it is not changed.
        temperature_c : float
            This sample in degC; NaN when it is missing.
        applied : float
            Power the actuator took during the interval that has just ended; NaN when not known.

        Returns
        -------
        IdentifierBelief
            The new belief; its estimate is ``rejected`` when the sample could not be used.

        Raises
        ------
        ValueError
            `temperature_c` or `applied` is no number.
        """
        temperature_c = scalar("temperature_c", temperature_c)
        applied = scalar("applied", applied)
        u_past = pushed(belief.u_past, applied)
        phi = self.structure.regressor(belief.y_past_c, u_past)
        target = self.structure.target(temperature_c, u_past)
        estimate = self.law.update(belief.estimate, phi, target)
        return IdentifierBelief(estimate, pushed(belief.y_past_c, temperature_c), u_past)

    def predict(self, belief: IdentifierBelief, applied: float) -> float:
        """Return the next temperature in degC under `applied`; NaN: not known."""
        u_past = pushed(belief.u_past, applied)
        phi = self.structure.regressor(belief.y_past_c, u_past)
        return self.structure.temperature(float(belief.estimate.theta.dot(phi)), u_past)

    def foresee(self, belief: IdentifierBelief, applied: float) -> IdentifierBelief:
        """Return the belief one sample on, a prediction in place of a reading.

        Nothing is learned. Meant for riding through a short gap, beside the belief that keeps the
        gap: learning from one's own predictions would only confirm them.
        """
        temperature_c = self.predict(belief, applied)
        return IdentifierBelief(
            belief.estimate,
            pushed(belief.y_past_c, temperature_c),
            pushed(belief.u_past, applied),
        )


def pushed(past: Array, newest: float) -> Array:
    """Return `past` with `newest` in front and the oldest gone."""
    n = len(past)
    if n == 0:
        return past
    pushed = np.empty(n)
    pushed[0] = newest
    if n > 1:
        pushed[1:] = past[:-1]
    return frozen(pushed)
