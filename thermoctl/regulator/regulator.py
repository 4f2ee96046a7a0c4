"""One measurement in, one step out.

Anything can drive a regulator: the loop, a replay, a study, somebody else's simulator. It knows no
clock, no hardware and no file. The walk of a sample through it is `Regulator.step`, top to bottom.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from thermoctl.errors import Refused
from thermoctl.estimation.identifier import Identifier, IdentifierBelief
from thermoctl.ports import Controller, Situation
from thermoctl.quantities import Array, clamp, is_finite_number
from thermoctl.regulator.guard import Guard
from thermoctl.regulator.holding import Holding
from thermoctl.regulator.judge import Verdict
from thermoctl.regulator.limits import Limits, accept_power
from thermoctl.regulator.mind import Mind
from thermoctl.regulator.shadow import Shadow
from thermoctl.regulator.steering import Steering
from thermoctl.regulator.supervisor import Supervisor
from thermoctl.signals import (
    Acknowledge,
    Alarm,
    Beliefs,
    ChooseController,
    Command,
    Event,
    ManualPower,
    Measurement,
    Mode,
    Request,
    SetPoint,
    State,
    Step,
)

_NAN_IN_A_ROW = 3
_EARLIER_TEXT = "latched before this start: {}"


@dataclass(frozen=True, slots=True)
class Plan:
    """What a regulator is made of; every part is frozen.

    Parameters
    ----------
    limits : Limits
        What may never be left.
    identifier : Identifier
        The model that is learnt beside every controller, in every mode.
    controller : Controller
        The law in charge in mode AUTO.
    setpoint_c : float
        Set point at the start, in degC.
    mode : Mode
        Mode at the start.
    shadow : Controller, optional
        Another law, asked beside the one in charge and not obeyed until it is put in charge.

    Raises
    ------
    ValueError
        The mode is PROGRAM: there is none to begin with. Or both laws have one name: nobody could
        choose between them.
    """

    limits: Limits
    identifier: Identifier
    controller: Controller
    setpoint_c: float
    mode: Mode = Mode.OFF
    shadow: Controller | None = None

    def __post_init__(self) -> None:
        if self.mode is Mode.PROGRAM:
            raise ValueError("mode must be off, manual or auto at the start, got 'program'")
        if self.shadow is not None and self.shadow.name == self.controller.name:
            raise ValueError(
                f"shadow must be another kind than the controller's, got {self.shadow.name!r} twice"
            )


class Regulator:
    """Keeps one loop: what is wanted, what is believed, what the heater may do.

    Parameters
    ----------
    plan : Plan
        Its parts.
    latched : Alarm, optional
        A latch of an earlier run; the heater stays off until it is acknowledged.
    """

    def __init__(self, plan: Plan, latched: Alarm | None = None) -> None:
        self._plan = plan
        self._limits = plan.limits
        self._setpoint_c = plan.limits.accept_setpoint(plan.setpoint_c)
        self._mode = plan.mode
        self._events: list[tuple[str, dict[str, object]]] = []
        self._supervisor = Supervisor(plan.limits, self._emit)
        self._guard = Guard(self._supervisor)
        self._steering = Steering(Mind(plan.controller), self._guard, self._emit)
        self._shadow = Shadow(plan.shadow, plan.limits.power_max, self._emit)
        self._identified: IdentifierBelief = plan.identifier.start()
        self._foreseen: IdentifierBelief | None = None
        self._holding = Holding()
        self._jump_k = plan.limits.jump_k
        self._t_s: float | None = None
        self._manual_power = 0.0
        self._command = Command(0.0, -math.inf, "start")
        self._applied: float | None = None
        self._unknown_powers = 0
        if latched is not None:
            text = _EARLIER_TEXT.format(latched.text)
            self._supervisor.latch(latched.code, latched.fault, text, 0.0)

    # -- what the operator wants -----------------------------------------------------------------

    @property
    def mode(self) -> Mode:
        """The operator's mode."""
        return self._mode

    @property
    def setpoint_c(self) -> float:
        """The set point in degC."""
        return self._setpoint_c

    def request(self, request: Request) -> None:
        """Grant a request, or raise `Refused` and change nothing.

        Raises
        ------
        Refused
            The request is none, out of range, or not possible now; the text says what was expected.
        """
        match request:
            case Mode():
                self._request_mode(request)
            case SetPoint(value_c):
                accepted_c = self._limits.accept_setpoint(value_c)
                if accepted_c != self._setpoint_c:
                    self._emit("setpoint.changed", before_c=self._setpoint_c, after_c=accepted_c)
                self._setpoint_c = accepted_c
            case ManualPower(power):
                self._manual_power = accept_power(power)
            case ChooseController(name):
                self._choose(name)
            case Acknowledge(code):
                self._supervisor.acknowledge(code)
            case _:
                raise Refused(
                    "expected a Mode, SetPoint, ManualPower, ChooseController or Acknowledge, got "
                    f"{request!r}"
                )

    def _request_mode(self, mode: Mode) -> None:
        if mode is Mode.PROGRAM:
            raise Refused("expected off, manual or auto: this loop has no program")
        if mode is self._mode:
            return
        if mode is Mode.MANUAL:  # bumpless: manual goes on with what is given now
            self._manual_power = self._applied_power()
        self._emit("mode.changed", before=self._mode.value, after=mode.value)
        self._mode = mode

    def _choose(self, name: object) -> None:
        """Let the controllers in charge and in shadow change places, if `name` is in shadow.

        Bumpless: both have seen every sample, and every power that was applied, from the start.
        """
        charge, shadow = self._steering.name, self._shadow.name
        if isinstance(name, str) and name == charge:
            return
        if shadow is None:
            raise Refused(f"expected {charge!r}, for none is in its shadow, got {name!r}")
        if not isinstance(name, str) or name != shadow:
            raise Refused(f"expected {charge!r} or, in its shadow, {shadow!r}, got {name!r}")
        self._steering.mind = self._shadow.exchanged(self._steering.mind)
        self._emit("controller.changed", before=charge, after=shadow)

    # -- the walk of a sample --------------------------------------------------------------------

    def step(self, measurement: Measurement) -> Step:
        """Return what is made of `measurement`; never raises, whatever it holds."""
        t_s, interval_s = self._time(measurement.t_s)
        applied = self._applied_power()
        verdict = self._supervisor.judge(measurement, t_s, interval_s, self._jump_k)
        temperature_c = float(measurement.temperature_c) if verdict is Verdict.GOOD else math.nan
        self._identify(temperature_c, self._given(applied, interval_s), t_s)
        seen_s = self._limits.seen_s(interval_s)
        self._holding = self._holding.after(temperature_c - self._setpoint_c, applied, seen_s)
        situation = self._situation(t_s, interval_s, temperature_c, applied)
        self._shadow.observe(situation, self._steering.mind)
        self._steering.observe(situation)
        known = self._guard.call(self._model_beliefs, Beliefs(), "estimator.failed", t_s)
        beliefs = self._steering.beliefs(situation, known)
        self._jump_k = self._jump_for(beliefs)
        state = self._supervisor.rule(t_s, self._ride_s(situation, beliefs))
        asked, reason = self._ask(situation, state, beliefs)
        self._steering.tell_remarks(t_s)
        self._command = self._supervisor.bound(asked, reason, t_s)
        steered = self._mode is Mode.AUTO and state is State.RUN
        self._shadow.decide(situation, self._command.power, seen_s, steered=steered)
        self._notice_unknown_power(t_s)
        self._applied = None
        return self._finish(measurement, situation, beliefs)

    def applied(self, power: float) -> None:
        """Tell which power the actuator took; when never told, it took the command's."""
        known = is_finite_number(power)
        taken = float(power) if known else math.nan
        self._supervisor.check_applied(self._command.power, taken, self._t_s or 0.0)
        if known:
            self._applied = clamp(taken, 0.0, 1.0)

    def fault(self, code: str, fault: int | None, text: str) -> None:
        """Report that something outside failed: SAFE from the next step on.

        Parameters
        ----------
        code : str
            Name of the alarm, such as ``output.refused``.
        fault : int or None
            Row of the fault table.
        text : str
            What was expected and what came.
        """
        self._supervisor.fail(code, fault, text, self._t_s or 0.0)
        self._applied = 0.0

    def _applied_power(self) -> float:
        return self._command.power if self._applied is None else self._applied

    def _given(self, applied: float, interval_s: float) -> float:
        """Return what was given since the last sample, in power times nominal periods.

        Commands expire, so after a long gap nobody knows what was: NaN, and nothing is learnt.
        """
        period_s = self._limits.period_s
        known = interval_s <= max(self._limits.RIDE_S, 10.0 * period_s)
        return applied * interval_s / period_s if known else math.nan

    def _time(self, t_s: float) -> tuple[float, float]:
        """Return the time of this step, and since the last; time that stands still goes on anyway.

        Patience with a lost sensor is counted in this time, so it must never stop.
        """
        period_s, before_s = self._limits.period_s, self._t_s
        if before_s is None:
            self._t_s = float(t_s) if is_finite_number(t_s) else 0.0
            return self._t_s, period_s
        if is_finite_number(t_s) and t_s > before_s:
            self._t_s = float(t_s)
            return self._t_s, self._t_s - before_s
        self._t_s = before_s + period_s  # lost in rounding where a time is absurd, hence:
        return self._t_s, period_s

    def _identify(self, temperature_c: float, applied: float, t_s: float) -> None:
        """Learn from the sample; a belief that is not finite is never kept.

        Without a reading, what the model foresees is kept beside the belief, for RIDE to act on.
        """
        before, identifier = self._identified, self._plan.identifier
        seen = not math.isnan(temperature_c)
        last = before if self._foreseen is None else self._foreseen

        def learn() -> tuple[IdentifierBelief, IdentifierBelief | None, bool]:
            foreseen = None if seen else identifier.foresee(last, applied)
            after = identifier.update(before, temperature_c, applied)
            estimate = after.estimate
            return after, foreseen, _all_finite(estimate.theta) and _all_finite(estimate.P)

        kept: tuple[IdentifierBelief, IdentifierBelief | None, bool] = (before, None, True)
        after, self._foreseen, finite = self._guard.call(learn, kept, "estimator.failed", t_s)
        if finite:
            self._identified = after
        else:
            text = "expected finite parameters, went back to the last good ones"
            self._supervisor.fail("estimator.reset", 11, text, t_s)

    def _situation(
        self, t_s: float, interval_s: float, measured_c: float, applied: float
    ) -> Situation:
        known = self._identified if self._foreseen is None else self._foreseen
        return Situation(
            t_s,
            interval_s,
            float(known.y_past_c[0]),
            self._setpoint_c,
            applied,
            known.estimate,
            known.y_past_c,
            known.u_past,
            measured_c,
        )

    def _model_beliefs(self) -> Beliefs:
        """Return what is known beside every controller: the pole, and the power seen to hold."""
        estimate = self._identified.estimate
        a, a_sd = self._plan.identifier.structure.pole(estimate.theta, estimate.P)
        return Beliefs(a=a, a_sd=a_sd, holding_power=self._holding.known)

    def _jump_for(self, beliefs: Beliefs) -> float:
        """Return how far the next reading may lie off before it is an outlier."""
        gain, gain_sd = beliefs.gain, beliefs.gain_sd
        if not is_finite_number(gain):
            return self._limits.jump_k
        sd = float(gain_sd) if is_finite_number(gain_sd) else 0.0  # type: ignore[arg-type]
        return self._limits.jump_for(float(gain), sd)  # type: ignore[arg-type]

    def _ride_s(self, situation: Situation, beliefs: Beliefs) -> float:
        """Return how long the model may steer without a sensor: 0 until it is known."""
        if self._mode is not Mode.AUTO:
            return 0.0
        return self._steering.ride_s(situation, beliefs, self._limits.RIDE_S)

    def _ask(self, situation: Situation, state: State, beliefs: Beliefs) -> tuple[object, str]:
        """Return the power that mode, state and controller ask for, and who asked."""
        if self._mode is Mode.OFF:
            return 0.0, "off"
        if state is State.HOLD:
            held = self._supervisor.last_power
            return (min(held, self._manual_power) if self._mode is Mode.MANUAL else held), "hold"
        if self._mode is Mode.MANUAL:
            return self._manual_power, "manual"
        if state in (State.SAFE, State.LATCHED):
            return 0.0, state.value
        if not math.isfinite(situation.temperature_c):
            return 0.0, "unknown"
        asked = self._steering.decide(situation)
        if state is State.RIDE and is_finite_number(asked):
            holding = clamp(beliefs.holding_power or 0.0, 0.0, 1.0)
            return clamp(float(asked), 0.0, holding), "ride"  # type: ignore[arg-type]
        return asked, "control"

    def _notice_unknown_power(self, t_s: float) -> None:
        if self._command.reason != "output.nan":
            self._unknown_powers = 0
            return
        self._unknown_powers += 1
        if self._unknown_powers == 1:
            self._emit("output.nan", controller=self._steering.name)
        if self._unknown_powers >= _NAN_IN_A_ROW:
            text = f"expected a power, got {self._unknown_powers} in a row that are none"
            self._supervisor.fail("output.nan", 11, text, t_s)

    def _finish(self, measurement: Measurement, situation: Situation, beliefs: Beliefs) -> Step:
        events: tuple[Event, ...] = ()
        if self._events:
            events = tuple(Event(situation.t_s, name, fields) for name, fields in self._events)
            self._events.clear()
        return Step(
            t_s=situation.t_s,
            measurement=measurement,
            mode=self._mode,
            state=self._supervisor.state,
            setpoint_c=self._setpoint_c,
            command=self._command,
            controller=self._steering.name,
            estimate=self._identified.estimate,
            beliefs=beliefs,
            alarms=self._supervisor.alarms.rows(),
            events=events,
            shadow=self._shadow.name,
            shadow_power=self._shadow.power,
            shadow_score=self._shadow.score,
        )

    def _emit(self, name: str, **fields: object) -> None:
        self._events.append((name, fields))


def _all_finite(values: Array) -> bool:
    """Return whether every number is finite; plain floats, which add up without a warning."""
    return math.isfinite(sum(values.ravel().tolist()))
