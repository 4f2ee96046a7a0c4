"""One measurement in, one step out.

Anything can drive a regulator: the loop, a replay, a study, somebody else's simulator. It knows no
clock, no hardware and no file. The walk of a sample through it is `Regulator.step`, top to bottom.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from thermoctl.errors import Refused
from thermoctl.ports import Controller, Remembered, Situation
from thermoctl.quantities import clamp, is_finite_number
from thermoctl.regulator.balance.feasible import Wanted
from thermoctl.regulator.balance.sides import balance_for
from thermoctl.regulator.guard import Failure, Guard, attempt
from thermoctl.regulator.heater.sides import Watch, named, watch_for
from thermoctl.regulator.judge import Verdict
from thermoctl.regulator.learning import Learning
from thermoctl.regulator.load import KnownLoad
from thermoctl.regulator.mind import Mind
from thermoctl.regulator.pairing import Pairing
from thermoctl.regulator.plan import Plan
from thermoctl.regulator.recollection import (
    NOTHING,
    origin,
    recall,
    recall_heater,
    remembering,
)
from thermoctl.regulator.shadow import Shadow
from thermoctl.regulator.steering import Steering
from thermoctl.regulator.supervisor import Supervisor
from thermoctl.regulator.wishes import Wishes
from thermoctl.signals import (
    Acknowledge,
    Alarm,
    Beliefs,
    ChooseController,
    ChooseShadow,
    Command,
    Event,
    Load,
    ManualPower,
    Measurement,
    Mode,
    Request,
    SetPoint,
    State,
    Step,
)

_NAN_IN_A_ROW = 3
_BLIND = (Verdict.MISSING, Verdict.SPIKE)
_EARLIER_TEXT = "latched before this start: {}"


class Regulator:
    """Keeps one loop: what is wanted, what is believed, what the heater may do.

    Parameters
    ----------
    plan : Plan
        Its parts.
    latched : Alarm, optional
        A latch of an earlier run; the heater stays off until it is acknowledged.
    remembered : mapping, optional
        What controllers of an earlier run have learnt, by their names, and the heater check.
    """

    def __init__(
        self,
        plan: Plan,
        latched: Alarm | None = None,
        remembered: Mapping[str, Remembered] = NOTHING,
    ) -> None:
        self.plan = plan
        self._limits = limits = plan.limits
        self._events: list[tuple[str, dict[str, object]]] = []
        rate_k_per_s = plan.setpoint_rate_k_per_s
        self._wishes = Wishes(plan.limits, plan.setpoint_c, plan.mode, self._emit, rate_k_per_s)
        self._supervisor = Supervisor(plan.limits, self._emit)
        self._guard = Guard(self._supervisor)
        self._steering = Steering(Mind(plan.controller), self._guard, self._emit)
        self._shadow = Shadow(plan.shadow, limits.power_min, limits.power_max, self._emit)
        self._learning = Learning(plan.identifier, self._supervisor, self._guard)
        self._feasibility = balance_for(plan.limits, self._supervisor.alarms, self._emit)
        self._load = KnownLoad(self._emit)
        self._pairing = Pairing(limits, plan.disagreement_k, self._supervisor.alarms, self._emit)
        self._watch: Watch | None = None
        if plan.heater_check is not None:
            check = plan.heater_check
            self._watch = watch_for(check, limits.period_s, self._supervisor, self._emit)
        self._watches = named(self._watch)
        self._unknown_s = max(limits.RIDE_S, 10.0 * limits.period_s)
        self._beliefs = Beliefs()
        self._t_s: float | None = None
        self._command = Command(0.0, -math.inf, "start")
        self._applied: float | None = None
        self._unknown_powers = 0
        recall((self._steering.mind, self._shadow.mind), remembered, self._emit)
        recall_heater(self._watch, remembered, self._emit)
        if latched is not None:
            text = _EARLIER_TEXT.format(latched.text)
            self._supervisor.latch(latched.code, latched.fault, text, 0.0)

    # -- what the operator wants -----------------------------------------------------------------

    @property
    def mode(self) -> Mode:
        """The operator's mode."""
        return self._wishes.mode

    @property
    def setpoint_c(self) -> float:
        """The set point in degC."""
        return self._wishes.setpoint_c

    def request(self, request: Request) -> None:
        """Grant a request, or raise `Refused` and change nothing.

        Raises
        ------
        Refused
            The request is none, out of range, or not possible now; the text says what was expected.
        """
        match request:
            case Mode():
                self._wishes.want_mode(request, self._applied_power())
            case SetPoint(value_c, rate_k_per_min):
                self._wishes.want_setpoint(value_c, rate_k_per_min)
            case ManualPower(power):
                self._wishes.want_power(power)
            case Load(power, duration_s):
                self._load.want(power, duration_s)
            case ChooseController(name):
                self._choose(name)
            case ChooseShadow(law):
                self._cast(law)
            case Acknowledge(code):
                self._supervisor.acknowledge(code)
            case _:
                raise Refused(
                    "expected a Mode, SetPoint, ManualPower, Load, ChooseController, ChooseShadow "
                    f"or Acknowledge, got {request!r}"
                )

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

    # -- a loop within a loop --------------------------------------------------------------------

    @property
    def released(self) -> bool:
        """Whether power may be given: neither off, nor SAFE or LATCHED, nor tripping."""
        return self._wishes.mode is not Mode.OFF and self._supervisor.released

    def lead(self, setpoint_c: float, *, released: bool) -> None:
        """Follow another loop: hold `setpoint_c`, give no power unless `released`.

        Asked at every sample, before `step`; a set point from anybody else is refused then.
        """
        self._wishes.follow(setpoint_c)
        self._supervisor.master_released = released

    def _cast(self, law: object) -> None:
        """Put `law` in the shadow, where it learns; None ends the shadow."""
        charge, before = self._steering.name, self._shadow.name
        if law is not None and not isinstance(law, Controller):
            raise Refused(f"expected a controller for the shadow, got {law!r}")
        name = None if law is None else law.name
        if name == charge:
            raise Refused(f"expected another kind than {charge!r}, which is in charge")
        if name == before:
            return
        self._shadow.replace(law)
        self._emit("shadow.changed", before=before, after=name)

    # -- the walk of a sample --------------------------------------------------------------------

    def fuse(self, first: Measurement, second: Measurement) -> Measurement:
        """Return what two sensors of this plant show together, for `step` to take."""
        return self._pairing.fuse(first, second)

    def step(self, measurement: Measurement) -> Step:
        """Return what is made of `measurement`; never raises, whatever it holds."""
        t_s, interval_s = self._time(measurement.t_s)
        load = self._load.mean(t_s, interval_s)
        taken, command = self._applied_power(), self._commanded_power()
        applied, commanded = taken - load, command - load
        verdict = self._supervisor.judge(measurement, t_s, interval_s, self._jump_k)  # 5. judge
        temperature_c = float(measurement.temperature_c) if verdict is Verdict.GOOD else math.nan
        self._learning.observe(temperature_c, self._given(applied, interval_s), t_s)  # 6. identify
        if self._watch is not None:
            self._watch.observe(t_s, interval_s, temperature_c, applied)  # 7. check the heater
        seen_s = self._supervisor.seen_s
        self._learning.hold(temperature_c - self._wishes.setpoint_c, applied, seen_s)
        reference = self._wishes.approach(temperature_c, seen_s, self._supervisor.state)
        situation = self._learning.situation(
            t_s, interval_s, temperature_c, reference, applied, commanded
        )
        self._steering.observe(situation)  # 8. observe
        self._shadow.observe(situation, self._steering.mind)
        pole, holding_power = self._learning.pole(t_s), self._learning.holding_power
        self._beliefs = beliefs = self._steering.beliefs(situation, pole, holding_power)
        weighed = attempt(self._weigh, interval_s, applied, taken - command, temperature_c)
        if isinstance(weighed, Failure):  # 9. forecast
            self._feasibility.fail(weighed)
        ride_s = self._ride_s(situation, beliefs) if verdict in _BLIND else 0.0
        state = self._supervisor.rule(t_s, ride_s)  # 10. rule
        load = self._load.at(t_s)
        asked, reason = self._ask(situation, state, beliefs, load)  # 11. decide
        self._steering.tell_remarks(t_s)
        self._command = self._supervisor.bound(asked, reason, t_s)  # 12. bound
        steered = self._wishes.mode is Mode.AUTO and state is State.RUN
        self._shadow.decide(situation, self._command.power - load, seen_s, steered=steered)
        self._notice_unknown_power(t_s)
        self._applied = None
        return self._finish(measurement, situation, beliefs, load)

    def applied(self, power: float, kept_s: float = 0.0) -> None:
        """Record the power accepted, NaN for unknown, and its decay time constant."""
        self._learning.kept_s = kept_s
        known = is_finite_number(power)
        taken = float(power) if known else math.nan
        possible = self._supervisor.check_applied(self._command.power, taken, self._t_s or 0.0)
        if known:
            self._applied = possible

    def fault(self, code: str, fault: int | None, text: str) -> None:
        """Report that something outside failed: SAFE from the next step on.

        Parameters
        ----------
        code : str
            Name of the alarm, such as ``output.refused``.
        fault : int or None
            Number of the fault.
        text : str
            What was expected and what came.
        """
        self._supervisor.fail(code, fault, text, self._t_s or 0.0)
        self._applied = 0.0

    def _applied_power(self) -> float:
        return self._command.power if self._applied is None else self._applied

    def _commanded_power(self) -> float:
        """Return the commanded power; NaN where it is the set point of a following loop.

        That loop takes its time, and what it is off by is no error of an output.
        """
        return self._command.power if self._limits.applied_tolerance < 1.0 else math.nan

    def _given(self, applied: float, interval_s: float) -> float:
        """Return the heat given since the last sample, in power times nominal periods.

        Commands expire, so after a long gap nobody knows what was: NaN, and nothing is learnt.
        """
        heat = -applied if self._limits.power_cools else applied
        known = interval_s <= self._unknown_s
        return heat * interval_s / self._limits.period_s if known else math.nan

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
        self._t_s = before_s + period_s  # an absurdly large time rounds it away:
        return self._t_s, period_s

    def _weigh(self, interval_s: float, applied: float, off: float, temperature_c: float) -> None:
        """Add to the balance of heat; `off` is output less command, NaN: unknown."""
        beyond, lag_s = off if math.isfinite(off) else 0.0, self._beliefs.lag_s
        if self._feasibility.observe(interval_s, applied, temperature_c, lag_s, beyond):
            self._feasibility.reckon(self._wanted(), self._t_s or 0.0)

    def _wanted(self) -> Wanted:
        wishes = self._wishes
        limits = self._limits
        return Wanted(
            wishes.setpoint_c,
            limits.power_max,
            wishes.mode,
            wishes.ramp_s,
            limits.power_cools,
            wishes.led,
            math.nan if self._watch is None else self._watch.ceiling_c,
        )

    def _jump_k(self) -> float:
        """Return how far a reading may lie off before it is an outlier."""
        gain, gain_sd = self._beliefs.gain, self._beliefs.gain_sd
        if not is_finite_number(gain):
            return self._limits.jump_k
        sd = float(gain_sd) if is_finite_number(gain_sd) else 0.0  # type: ignore[arg-type]
        return self._limits.jump_for(float(gain), sd)  # type: ignore[arg-type]

    def _ride_s(self, situation: Situation, beliefs: Beliefs) -> float:
        """Return how long the model may steer without a sensor: 0 until it is known."""
        if self._wishes.mode is not Mode.AUTO:
            return 0.0
        return self._steering.ride_s(situation, beliefs, self._limits.RIDE_S)

    def _ask(
        self, situation: Situation, state: State, beliefs: Beliefs, load: float
    ) -> tuple[object, str]:
        """Return the power that mode, state and controller ask for, and who asked."""
        if self._wishes.mode is Mode.OFF:
            return 0.0, "off"
        if self._watch is not None and self._watch.asks:
            return 0.0, "heater.check"
        if state is State.HOLD:
            held = self._supervisor.last_power
            manual = self._wishes.mode is Mode.MANUAL
            return _up_to(self._wishes.manual_power, held) if manual else held, "hold"
        if self._wishes.mode is Mode.MANUAL:
            return self._wishes.manual_power, "manual"
        if state in (State.SAFE, State.LATCHED):
            return 0.0, state.value
        if not math.isfinite(situation.temperature_c):
            return 0.0, "unknown"
        asked = self._steering.decide(situation)
        if not is_finite_number(asked):
            return asked, "control"
        power = float(asked)  # type: ignore[arg-type]
        if state is State.RIDE:
            holding = self._limits.possible(beliefs.holding_power)
            return _up_to(holding, power) + load, "ride"
        return power + load, "control"

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

    def _finish(
        self, measurement: Measurement, situation: Situation, beliefs: Beliefs, load: float
    ) -> Step:
        events: tuple[Event, ...] = ()
        if self._events:
            events = tuple(Event(situation.t_s, name, fields) for name, fields in self._events)
            self._events.clear()
        charge, beside = self._steering.mind, self._shadow.mind
        return Step(  # in the order of its fields: by their names it would take twice as long
            situation.t_s,
            measurement,
            self._wishes.mode,
            self._supervisor.state,
            self._wishes.setpoint_c,
            self._command,
            charge.name,
            self._learning.estimate,
            beliefs,
            self._supervisor.alarms.rows(),
            events,
            None if beside is None else beside.name,
            self._shadow.power,
            self._shadow.score,
            self._feasibility.known,
            situation.setpoint_c,  # reference_c
            load,
            self._steering.tell(beside),
            origin(charge),
            remembering((charge, beside), self._watches),
        )

    def _emit(self, name: str, **fields: object) -> None:
        self._events.append((name, fields))


def _up_to(most: float, power: float) -> float:
    """Return `power` limited to what lies between 0 and `most`, of whatever sign."""
    return clamp(power, min(most, 0.0), max(most, 0.0))
