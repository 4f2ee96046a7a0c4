"""What is learnt beside every controller, in every mode."""

from __future__ import annotations

import math

from thermoctl.estimation.identifier import Identifier, IdentifierBelief
from thermoctl.ports import Situation
from thermoctl.quantities import Array
from thermoctl.regulator.guard import Guard
from thermoctl.regulator.holding import Holding
from thermoctl.regulator.reference import Reference
from thermoctl.regulator.steering import Pole
from thermoctl.regulator.supervisor import Supervisor
from thermoctl.signals import Estimate

_FAILED = "estimator.failed"
_NO_POLE: Pole = None, None

_Learnt = tuple[IdentifierBelief, IdentifierBelief | None, bool]
"""The belief after a sample, what is foreseen without one, and whether all of it is finite."""


class Learning:
    """Keeps the model of a loop and the power that holds it.

    Parameters
    ----------
    identifier : Identifier
        The law.
    supervisor : Supervisor
        Who is told of a belief that is not finite.
    guard : Guard
        What stands between the law and the loop.
    """

    def __init__(self, identifier: Identifier, supervisor: Supervisor, guard: Guard) -> None:
        self._identifier = identifier
        self._supervisor = supervisor
        self._guard = guard
        self._belief: IdentifierBelief = identifier.start()
        self._foreseen: IdentifierBelief | None = None
        self._holding = Holding()
        self.kept_s = 0.0
        """Time constant in s with which the body that acts cools when power is reduced."""

    @property
    def estimate(self) -> Estimate:
        """What is believed of the parameters."""
        return self._belief.estimate

    def observe(self, temperature_c: float, applied: float, t_s: float) -> None:
        """Learn from the sample; a belief that is not finite is never kept.

        Without a reading, what the model foresees is kept beside the belief, for RIDE to act on.
        """
        kept: _Learnt = (self._belief, None, True)
        after, self._foreseen, finite = self._guard.call(
            _FAILED, t_s, kept, self._learn, temperature_c, applied
        )
        if finite:
            self._belief = after
        else:
            text = "expected finite parameters, went back to the last good ones"
            self._supervisor.fail("estimator.reset", 11, text, t_s)

    def _learn(self, temperature_c: float, applied: float) -> _Learnt:
        before, foreseen = self._belief, None
        if math.isnan(temperature_c):
            foreseen = self._identifier.foresee(self._foreseen or before, applied)
        after = self._identifier.update(before, temperature_c, applied)
        estimate = after.estimate
        return after, foreseen, _all_finite(estimate.theta) and _all_finite(estimate.P)

    def hold(self, deviation_k: float, applied: float, seen_s: float) -> None:
        """Note which power was `applied` while the plant was held, or not."""
        self._holding = self._holding.after(deviation_k, applied, seen_s)

    def situation(
        self,
        t_s: float,
        interval_s: float,
        measured_c: float,
        reference: Reference,
        applied: float,
        commanded: float,
    ) -> Situation:
        """Return what controllers may know of this sample."""
        known = self._belief if self._foreseen is None else self._foreseen
        return Situation(
            t_s,
            interval_s,
            known.y_past_c.item(0),
            reference.value_c,
            applied,
            known.estimate,
            known.y_past_c,
            known.u_past,
            measured_c,
            reference.rate_k_per_s,
            reference.target_c,
            commanded,
            self.kept_s,
        )

    def pole(self, t_s: float) -> Pole:
        """Return the pole that is learnt and its sd, as far as the structure has one."""
        return self._guard.call(_FAILED, t_s, _NO_POLE, self._pole)

    def _pole(self) -> Pole:
        estimate = self._belief.estimate
        return self._identifier.structure.pole(estimate.theta, estimate.P)

    @property
    def holding_power(self) -> float | None:
        """The power that has been holding the plant, None while it is not known."""
        return self._holding.known


def _all_finite(values: Array) -> bool:
    """Return whether every number is finite; plain floats, which add up without a warning."""
    if values.size == 1:  # one parameter, as in most models
        return math.isfinite(values.item())
    return math.isfinite(sum(values.ravel().tolist()))
