"""A second controller, asked at every sample and never obeyed."""

from __future__ import annotations

import math

from thermoctl.ports import Controller, Situation
from thermoctl.quantities import clamp, is_finite_number
from thermoctl.regulator.guard import Failure, attempt
from thermoctl.regulator.mind import Mind
from thermoctl.regulator.supervisor import Emit
from thermoctl.regulator.tally import Tally
from thermoctl.signals import ShadowScore


class Shadow:
    """Keeps the controller in shadow, and the score between it and the one in charge.

    One that fails is dropped for good, with an event: it costs neither heat nor patience.

    Parameters
    ----------
    controller : Controller or None
        The law; None for a loop without a shadow, which then costs nothing.
    power_min, power_max : float
        Least and most power that is ever given.
    emit : callable
        Called as ``emit(name, **fields)`` when the law has failed.

    Attributes
    ----------
    mind : Mind or None
        The controller with what it remembers, None without one.
    power : float or None
        What it would give, within the limit of power; None while it has no answer.
    """

    def __init__(
        self, controller: Controller | None, power_min: float, power_max: float, emit: Emit
    ) -> None:
        self.mind = None if controller is None else Mind(controller)
        self._least, self._most = power_min, power_max
        self._emit = emit
        self.power: float | None = None
        self._surprise_k = self._shadow_surprise_k = math.nan
        self._tally = Tally()

    @property
    def name(self) -> str | None:
        """The name of the controller in shadow, None without one."""
        return None if self.mind is None else self.mind.name

    @property
    def score(self) -> ShadowScore | None:
        """How the two compare; None before the first minute."""
        return self._tally.score

    def exchanged(self, charge: Mind) -> Mind:
        """Put `charge` into the shadow and return who stood there; the score begins anew."""
        assert self.mind is not None
        mind, self.mind = self.mind, charge
        self.power, self._tally = None, Tally()
        return mind

    def replace(self, controller: Controller | None) -> None:
        """Put another law into the shadow, with nothing learnt yet; None: nobody."""
        self.mind = None if controller is None else Mind(controller)
        self.power, self._tally = None, Tally()

    def observe(self, situation: Situation, charge: Mind) -> None:
        """Show it the sample, after `charge` has seen it; note how surprised both were."""
        mind = self.mind
        if mind is None:
            return
        of_shadow = attempt(_surprised_k, mind, situation)
        of_charge = attempt(charge.surprise_k, situation)  # a score costs no heat
        self._surprise_k, self._shadow_surprise_k = _number(of_charge), _number(of_shadow)
        if isinstance(of_shadow, Failure):
            self._drop(of_shadow)

    def decide(self, situation: Situation, given: float, seen_s: float, *, steered: bool) -> None:
        """Ask it for the power of this sample, and compare that with what is given.

        Parameters
        ----------
        situation : Situation
            As the one in charge knows it.
        given : float
            Power of the command.
        seen_s : float
            Time that the sample stands for.
        steered : bool
            Whether the one in charge decided that power.
        """
        mind, self.power = self.mind, None
        if mind is None:
            return
        if math.isfinite(situation.temperature_c):
            asked = attempt(mind.decide, situation)
            if isinstance(asked, Failure):
                self._drop(asked)
                return
            if is_finite_number(asked):
                self.power = clamp(float(asked), self._least, self._most)  # type: ignore[arg-type]
        if steered and self.power is not None:
            self._tally.add(seen_s, given, self.power, self._surprise_k, self._shadow_surprise_k)
        else:
            self._tally.pause()

    def _drop(self, failure: Failure) -> None:
        self._emit("shadow.failed", controller=self.name, text=failure.text, trace=failure.trace)
        self.mind, self.power, self._tally = None, None, Tally()


def _surprised_k(mind: Mind, situation: Situation) -> float:
    """Return how far the sample is from what `mind` expected of it, in K; shown to it now."""
    mind.observe(situation)
    return mind.surprise_k(situation)


def _number(told: object) -> float:
    """Return `told` as a number; NaN for what is none."""
    return float(told) if is_finite_number(told) else math.nan  # type: ignore[arg-type]
