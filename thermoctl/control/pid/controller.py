"""A PID that can find its gains by itself.

Implements section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

from thermoctl.control.cooling import RATIO_MAX, RATIO_MIN, heat_of, power_for_heat
from thermoctl.control.inexact import ahead, given
from thermoctl.control.mirror import mirrored
from thermoctl.control.pid.autotune import AutoTune, Experiment, Found, GivenUp, Tuning
from thermoctl.control.pid.relay import RelayTest
from thermoctl.control.pid.remembered import as_remembered, found_before
from thermoctl.control.pid.simc import Gains
from thermoctl.control.pid.step_test import StepTest
from thermoctl.control.pid.terms import PidTerms, Terms
from thermoctl.ports import Situation
from thermoctl.quantities import is_finite_number
from thermoctl.ranges import check_ranges, ranged
from thermoctl.signals import Beliefs


@dataclass(frozen=True, slots=True)
class PidBelief:
    """What the controller remembers.

    Parameters
    ----------
    terms : Terms
        Of the law.
    tuning : Tuning
        How its gains came about, or will.
    kept : Gains or None
        What an earlier run has found; in force until a test of this one has found something.
    ahead_s : float
        What a pulsing output gave beyond its commands and has not left out since, in seconds of
        full power.
    """

    terms: Terms = field(default_factory=Terms)
    tuning: Tuning = field(default_factory=Tuning)
    kept: Gains | None = None
    ahead_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Pid:
    r"""Proportional, integral and derivative of the error, with gains given or found.

    .. math::

        u = K \Bigl[ b r - y + \frac{1}{T_i} \int (r - y)\,dt \Bigr]
            - K \frac{T_d s}{1 + s T_d/N} y

    Its integral follows the power that was applied whenever somebody else steers, so it takes over
    without a bump, and cannot wind up, whoever limits the power.

    Parameters
    ----------
    gain_per_k : float
        K, power per kelvin. Gains are used as they are when `tuning` is fixed; else before it has
        come to an end, and after when it has failed, which the defaults are careful enough for.
    integral_s : float
        Ti.
    derivative_s : float
        Td; 0 is a PI.
    derivative_filter : float
        N: the derivative is filtered with Td/N; from 1 to 100.
    setpoint_weight : float
        b, from 0 to 1: the share of a step of the set point that meets the power at once.
    tuning : str
        ``fixed``: the gains as given. ``simc``: from the first warm-up of 3 K or more in mode auto.
        ``relay``: from a swing about the set point. What is found is told by an event, and kept
        over restarts; for good by whoever writes it here, with ``fixed``.
    tuned_form : str
        What is tuned: ``pi``, or ``pid``, which settles sooner, is no steadier at rest, and moves
        the power ten times as far.
    tuning_limit_s : float
        How long a test may take; the gains stay as given when it has not ended by then.
    relay_amplitude : float
        How far the relay goes from its middle, 0.02 to 0.5 of full power. Its highest power has to
        be well above the one that holds the set point, and begins at twice this.
    period_s : float
        Time between two samples, as the loop has it.
    action : {'heat', 'cool', 'heat-cool'}
        What power does to the plant; heat-cool: a positive one heats and a negative one cools, by
        the same gains in units of heat, and tests are made with the heater.
    cooling_ratio : float
        For heat-cool: what the cooler takes out at full power over what the heater brings in, from
        0.02 to 10. Its gains below 0 are those of the heater over this.

    Raises
    ------
    ValueError
        An argument is outside its range.
    """

    gain_per_k: float = 0.1
    integral_s: float = 600.0
    derivative_s: float = 0.0
    derivative_filter: float = ranged(10.0, 1.0, 100.0)
    setpoint_weight: float = ranged(0.7, 0.0, 1.0)
    tuning: Literal["fixed", "simc", "relay"] = "simc"
    tuned_form: Literal["pi", "pid"] = "pi"
    tuning_limit_s: float = 14400.0
    relay_amplitude: float = ranged(0.25, 0.02, 0.5)
    period_s: float = 1.0
    action: Literal["heat", "cool", "heat-cool"] = "heat"
    cooling_ratio: float = ranged(1.0, RATIO_MIN, RATIO_MAX)
    autotune: AutoTune | None = field(init=False, repr=False, compare=False)

    name: ClassVar[str] = "pid"

    def __post_init__(self) -> None:
        for name in ("gain_per_k", "integral_s", "tuning_limit_s", "period_s"):
            value = getattr(self, name)
            if not is_finite_number(value) or not value > 0.0:
                raise ValueError(f"{name} must be positive, got {value!r}")
        if not is_finite_number(self.derivative_s) or self.derivative_s < 0.0:
            raise ValueError(f"derivative_s must be at least 0, got {self.derivative_s!r}")
        check_ranges(self)
        if self.tuning not in ("fixed", "simc", "relay"):
            raise ValueError(f"tuning must be 'fixed', 'simc' or 'relay', got {self.tuning!r}")
        if self.action not in ("heat", "cool", "heat-cool"):
            raise ValueError(f"action must be 'heat', 'cool' or 'heat-cool', got {self.action!r}")
        if self.tuned_form not in ("pi", "pid"):
            raise ValueError(f"tuned_form must be 'pi' or 'pid', got {self.tuned_form!r}")
        object.__setattr__(self, "autotune", self._autotune())

    def _autotune(self) -> AutoTune | None:
        """Return what finds the gains, None where they are fixed."""
        if self.tuning == "fixed":
            return None
        derivative = self.tuned_form == "pid"
        test: Experiment = RelayTest(derivative, self.relay_amplitude, self.period_s)
        if self.tuning == "simc":
            test = StepTest(derivative, self.period_s)
        return AutoTune(test, self.tuning_limit_s, self.period_s)

    def start(self) -> PidBelief:
        """Return the belief before the first sample."""
        return PidBelief()

    def start_from(self, remembered: Mapping[str, Any], age_s: float) -> PidBelief:
        """Return the belief before the first sample, with gains of an earlier run.

        With `tuning` simc they hold until a warm-up tells anew, so that a plant that has changed
        meanwhile is found out at the first one. With relay there is no swing any more.

        Raises
        ------
        ValueError
            They were found in another way or at another period, or no test finds such.
        """
        found = found_before(remembered, self.tuning, self.tuned_form, self.period_s)
        if self.tuning == "relay":
            return PidBelief(tuning=Tuning(outcome=found), kept=found.gains)
        return PidBelief(kept=found.gains)

    def remember(self, belief: PidBelief) -> Mapping[str, Any] | None:
        """Return the gains that were found; None before, and where they are given."""
        outcome = belief.tuning.outcome
        if not isinstance(outcome, Found):
            return None
        return as_remembered(outcome, self.tuning, self.tuned_form, self.period_s)

    def origin(self, belief: PidBelief) -> str:
        """Return whether gains of an earlier run are in force."""
        return "stored" if belief.kept is not None and belief.kept == self.gains(belief) else "new"

    def observe(self, belief: PidBelief, situation: Situation) -> PidBelief:
        """Return the belief after this sample, whoever steered up to it."""
        # how exact an output is, is a matter of its power; what the plant was given, one of heat
        ahead_s = ahead(belief.ahead_s, situation)
        left = heat_of(given(situation, pulses=ahead_s > 0.0), self.cooling_ratio)
        situation = self._seen(situation)
        tuning, law = belief.tuning, self._law(belief)
        if self.autotune is not None:
            tuning = self.autotune.observe(tuning, situation)
        before, interval_s, setpoint_c = belief.terms, situation.interval_s, situation.setpoint_c
        terms = law.see(before, situation.temperature_c, interval_s)
        known = math.isfinite(before.seen_c) and math.isfinite(setpoint_c)
        if known and math.isfinite(before.asked) and interval_s < law.gains.integral_s:
            keeps = situation.kept_s > 0.0
            terms = law.integrate(terms, setpoint_c, left, interval_s, keeps=keeps)
        elif known:
            terms = law.track(terms, setpoint_c, left)
        return PidBelief(replace(terms, asked=math.nan), tuning, belief.kept, ahead_s)

    def decide(self, belief: PidBelief, situation: Situation) -> tuple[PidBelief, float]:
        """Return the power of the law or of its test, not bounded; NaN when not known."""
        situation = self._seen(situation)
        temperature_c, setpoint_c = situation.temperature_c, situation.setpoint_c
        terms, tuning = belief.terms, belief.tuning
        if not (math.isfinite(temperature_c) and math.isfinite(setpoint_c)):
            return belief, math.nan
        if self.autotune is not None:
            tuning, power = self.autotune.decide(tuning, situation)
            if power is not None:
                return replace(belief, tuning=tuning), power
        law = self._law(replace(belief, tuning=tuning))
        if math.isnan(terms.integral) or tuning.outcome is not belief.tuning.outcome:
            holding = tuning.outcome.holding_power if isinstance(tuning.outcome, Found) else 0.0
            terms = law.at_rest(terms, setpoint_c, holding)
        heat = law.power(terms, setpoint_c)
        belief = replace(belief, terms=replace(terms, asked=heat), tuning=tuning)
        return belief, power_for_heat(heat, self.cooling_ratio)

    def gains(self, belief: PidBelief) -> Gains:
        """Return the gains in force."""
        outcome = belief.tuning.outcome
        if isinstance(outcome, Found):
            return outcome.gains
        if belief.kept is not None:
            return belief.kept
        return Gains(self.gain_per_k, self.integral_s, self.derivative_s)

    def _law(self, belief: PidBelief) -> PidTerms:
        return PidTerms(self.gains(belief), self.setpoint_weight, self.derivative_filter)

    def beliefs(self, belief: PidBelief, situation: Situation) -> Beliefs:
        """Return the gain of the plant, once it was found."""
        outcome = belief.tuning.outcome
        if not isinstance(outcome, Found):
            return Beliefs()
        return Beliefs(-outcome.slope_k_per_s if self.action == "cool" else outcome.slope_k_per_s)

    def _seen(self, situation: Situation) -> Situation:
        """Return `situation` as a law that heats meets it, with the heat that was applied."""
        if self.action == "cool":
            return mirrored(situation)
        if situation.applied < 0.0:
            return replace(situation, applied=heat_of(situation.applied, self.cooling_ratio))
        return situation

    def ride_s(self, belief: PidBelief) -> float:
        """Return 0: it has no model to steer by without a sensor."""
        return 0.0

    def remarks(self, belief: PidBelief) -> Mapping[str, str]:
        """Return that a test is under way, or what it has come to."""
        tuning = belief.tuning
        if isinstance(tuning.outcome, Found):
            return {"controller.tuned": f"{_in_words(self.gains(belief))}: {tuning.outcome.text}"}
        if isinstance(tuning.outcome, GivenUp):
            whose = "as given" if belief.kept is None else "of an earlier run"
            text = f"{tuning.outcome.text}; {_in_words(self.gains(belief))} {whose}"
            return {"controller.tuning_failed": text}
        if tuning.run is not None:
            return {"controller.tuning": f"{self.tuning}, at most {self.tuning_limit_s:g} s"}
        return {}


def _in_words(gains: Gains) -> str:
    words = f"gain {gains.gain_per_k:.3g} per K, integral {gains.integral_s:.3g} s"
    return f"{words}, derivative {gains.derivative_s:.3g} s" if gains.derivative_s else words
