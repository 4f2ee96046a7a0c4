"""Decides what heater and cooler may do, whatever anybody wants or asks for.

The states and what moves them (times are those of `thermoctl.regulator.limits.Limits`):

==========  ======================================  ==========================================
state       power                                   left for
==========  ======================================  ==========================================
RUN         what mode and controller ask, bounded   RIDE, HOLD, SAFE, LATCHED
RIDE        from prediction, at most holding power  RUN at a good reading, SAFE when too long
HOLD        the last one; 0 if a trip is pending    RUN at a good reading, SAFE when too long
SAFE        0                                       RUN after 30 s of good readings
LATCHED     0                                       SAFE when acknowledged and the cause gone
==========  ======================================  ==========================================

How long is too long is counted in seconds without a reading, and a good reading pays back only the
time it stands for. A sensor that answers once a minute therefore cannot renew RIDE or HOLD for
ever, while one that drops every other sample is controlled on the rest. All of it is added up from
the intervals between samples and not read off their times, so that no jump of those times makes
patience longer.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from thermoctl.errors import Refused
from thermoctl.quantities import clamp, is_finite_number
from thermoctl.regulator.alarms import AlarmRegister
from thermoctl.regulator.changeover import Changeover
from thermoctl.regulator.judge import Judged, Verdict, farthest, judge
from thermoctl.regulator.limits import Limits, command_lasts_s
from thermoctl.regulator.overdrawn import IN_ORDER
from thermoctl.signals import Alarm, Command, Measurement, State

_CIRCUITS = {Verdict.OPEN: ("sensor.open", 1), Verdict.SHORT: ("sensor.short", 2)}
_TRIPS = {
    Verdict.OVER: ("trip.over_temperature", 9),
    Verdict.UNDER: ("trip.under_temperature", None),
}
_SENSOR_CODES = tuple(code for code, _ in (*_CIRCUITS.values(), *_TRIPS.values()))

Emit = Callable[..., None]


class Supervisor:
    """Judges readings, keeps the state, bounds the power, raises and clears alarms.

    Parameters
    ----------
    limits : Limits
        What may never be left.
    emit : callable
        Called as ``emit(name, **fields)`` for every change worth a line in the journal.
    """

    def __init__(self, limits: Limits, emit: Emit) -> None:
        self.limits = limits
        self.alarms = AlarmRegister()
        self.state = State.RUN
        self._emit = emit
        self._judged = Judged()
        self._measurement = Measurement(math.nan)
        self._good_s = 0.0  # good readings without a break
        self._blind_s = 0.0  # time without a good reading that was not paid back yet
        self._forsaken = False  # SAFE for missing readings alone; one more is no new fault
        self._tripping: Verdict | None = None
        self._tripped_lately = False
        self._opened_s: deque[float] = deque(maxlen=limits.OPEN_COUNT)
        self._overdrawn = IN_ORDER
        self._interval_s = limits.period_s
        self._lasts_s = command_lasts_s(limits.period_s)  # half a period late, and a second
        self._last_power = 0.0
        self._taken = 0.0  # the last command, or what the actuators made of it
        # Heat and cold take turns only where there are both: then power goes below 0.
        self._changeover = Changeover() if limits.power_min < 0.0 else None
        self.seen_s = 0.0
        """How much of the time since the last sample a good reading answers for."""
        self.master_released = True
        """Whether the loop above this one, if there is one, may give power itself."""

    @property
    def released(self) -> bool:
        """Whether power may pass: not in SAFE or LATCHED, nor while a trip is pending."""
        sound = self.state not in (State.SAFE, State.LATCHED) and self._tripping is None
        return sound and self.master_released

    @property
    def verdict(self) -> Verdict:
        """What the last reading was worth."""
        return self._judged.verdict

    # -- judging ---------------------------------------------------------------------------------

    def judge(
        self,
        measurement: Measurement,
        t_s: float,
        interval_s: float,
        jump_k: Callable[[], float] | None = None,
    ) -> Verdict:
        """Return what `measurement`, `interval_s` after the last, is worth.

        `jump_k` returns the jump that the plant could make, that of the limits when not given.
        """
        before = self._judged.verdict
        self._judged = judged = judge(self._judged, measurement, self.limits, jump_k)
        self._measurement = measurement
        self._interval_s = interval_s
        self.seen_s = seen_s = self.limits.seen_s(interval_s)
        verdict = judged.verdict
        if verdict is Verdict.GOOD:
            self._good_s += seen_s if before is Verdict.GOOD else 0.0
            self._blind_s = max(0.0, self._blind_s - seen_s) if self._blind_s else 0.0
            return verdict
        forgiven = self._forsaken and verdict is Verdict.MISSING
        self._good_s = max(0.0, self._good_s - interval_s) if forgiven else 0.0
        self._blind_s += interval_s
        if verdict is Verdict.SPIKE:
            ignored = self._judged.outliers
            self._emit("sensor.spike", temperature_c=measurement.temperature_c, ignored=ignored)
        if verdict is Verdict.OPEN and before is not Verdict.OPEN:
            self._opened_s.append(t_s)
        return verdict

    # -- state -----------------------------------------------------------------------------------

    def rule(self, t_s: float, ride_s: float) -> State:
        """Return the state after the last reading; the model may steer for `ride_s`."""
        verdict = self.verdict
        if verdict is Verdict.GOOD:
            self._good()
        elif verdict in _TRIPS:
            self._trip(verdict, t_s)
        elif verdict in _CIRCUITS:
            self._circuit(verdict, t_s)
        else:
            rides = verdict is Verdict.MISSING or self.state is State.RIDE  # no spike ends a ride
            self._blind(t_s, ride_s if rides else 0.0)
        return self.state

    def _trip(self, verdict: Verdict, t_s: float) -> None:
        code, fault = _TRIPS[verdict]
        limits = self.limits
        got_c = farthest(self._measurement, limits)[verdict is Verdict.UNDER]
        text = (
            f"expected {limits.trip_below_c:g} to {limits.trip_above_c:g} degC, "
            f"got {got_c:.2f} degC"
        )
        if self._tripping is verdict:
            self.latch(code, fault, text, t_s)
        elif self._tripped_lately:  # good readings in between: one of the two is lying
            self._tripping = verdict
            self.fail(code, fault, text, t_s)
        else:
            self._tripping, self._tripped_lately = verdict, True
            self._raise(code, fault, text, t_s)
            if self.state in (State.RUN, State.RIDE):
                self._enter(State.HOLD, code)

    def _circuit(self, verdict: Verdict, t_s: float) -> None:
        code, fault = _CIRCUITS[verdict]
        self.fail(
            code, fault, f"expected a sensor, got {'an ' * (fault == 1)}{verdict} circuit", t_s
        )
        times = self._opened_s
        often = len(times) == times.maxlen and times[-1] - times[0] <= self.limits.OPEN_WINDOW_S
        if verdict is Verdict.OPEN and often:
            self.latch(code, fault, f"open {len(times)} times in {times[-1] - times[0]:.0f} s", t_s)

    def _good(self) -> None:
        self._tripping = None
        settled = self._good_s >= self.limits.RETURN_S
        self._tripped_lately = self._tripped_lately and not settled
        if self.alarms.rows():
            for code in _SENSOR_CODES:
                self.alarms.clear(code)
            if self._blind_s == 0.0:
                self.alarms.clear("sensor.missing")
        if self.state is State.RUN:  # nearly always
            return
        if self.state in (State.RIDE, State.HOLD):
            self._enter(State.RUN, "sensor.good")
        elif self.state is State.SAFE and settled:
            self._blind_s = 0.0
            for row in self.alarms.rows():
                self.alarms.clear(row.code)
            self._enter(State.RUN, "sensor.good")

    def _blind(self, t_s: float, ride_s: float) -> None:
        """No reading to act on: ride on the model, else hold, else be safe."""
        limits, blind_s = self.limits, self._blind_s
        missing = self.verdict is Verdict.MISSING
        patience_s = limits.hold_s if missing else limits.unsteady_s
        rides, holds = blind_s < min(ride_s, limits.RIDE_S), blind_s < patience_s
        if not (rides or holds) or ((missing or rides) and blind_s >= limits.RIDE_ALARM_S):
            self._raise("sensor.missing", 16, self._unseen(), t_s, priority=1 if not rides else 2)
        if self.state in (State.SAFE, State.LATCHED):
            return
        self._forsaken, self._good_s = missing, 0.0
        self._enter(
            State.RIDE if rides else State.HOLD if holds else State.SAFE,
            f"sensor.{self.verdict.value}",
        )

    def _unseen(self) -> str:
        """Return in words for how long nothing was to be believed, and why it was not."""
        every, none = f"every {self.limits.period_s:g} s", f"none for {self._blind_s:.0f} s"
        off_k = abs(self._judged.suspect_c - self._judged.last_good_c)
        if self.verdict is Verdict.MISSING or not math.isfinite(off_k):
            return f"expected a reading {every}, {none}"
        return f"expected a believable reading {every}, {none}: the last is {off_k:.1f} K off"

    def fail(
        self, code: str, fault: int | None, text: str, t_s: float, trace: str | None = None
    ) -> None:
        """Go to SAFE for the fault `code`; good readings for 30 s end it.

        The event comes once while the alarm is active, with a `trace` if there is one.
        """
        self._raise(code, fault, text, t_s, trace=trace)
        self._forsaken, self._good_s = False, 0.0
        if self.state is not State.LATCHED:
            self._enter(State.SAFE, code)

    def latch(self, code: str, fault: int | None, text: str, t_s: float) -> None:
        """Go to LATCHED for the fault `code`; only an acknowledgement ends it."""
        self.alarms.set(Alarm(code, fault, 1, t_s, text, latched=True))
        self._enter(State.LATCHED, code)

    def acknowledge(self, code: str | None) -> None:
        """Acknowledge an alarm, or all; raise `Refused` while a latch has its cause."""
        known = [row.code for row in self.alarms.rows()]
        if code is not None and code not in known:
            raise Refused(f"expected an alarm of {known or 'none'}, got {code!r}")
        meant = [row for row in self.alarms.latched() if code in (None, row.code)]
        if meant and (self.verdict in _CIRCUITS or self.verdict in _TRIPS):
            raise Refused(f"{meant[0].code} still stands: {meant[0].text}")
        for each in self.alarms.acknowledge(code):
            self._emit("alarm.acknowledged", code=each)
        if meant and not self.alarms.latched():  # the last one; any other goes on latching
            self._tripping = None
            self._good_s = 0.0
            self._opened_s.clear()
            self._enter(State.SAFE, "latch.cleared")

    # -- power -----------------------------------------------------------------------------------

    def bound(self, asked: object, reason: str, t_s: float) -> Command:
        """Return the command for the power `asked` for; what is no number becomes 0.

        The one place where limits hold. Falling is never slowed; nothing at all passes in SAFE,
        LATCHED or while a trip waits to be confirmed: safe is 0, for heater and cooler alike.
        """
        if self._changeover is not None:
            self._changeover = self._changeover.after(self._taken, self.seen_s)
        if self.state in (State.SAFE, State.LATCHED):
            power, reason = 0.0, self._why_off()
        elif self._tripping is not None:
            power, reason = 0.0, _TRIPS[self._tripping][0]
        elif not self.master_released:
            power, reason = 0.0, "master.off"
        elif not is_finite_number(asked):
            power, reason = 0.0, "output.nan"
        else:
            power, reason = self._limited(float(asked), reason)  # type: ignore[arg-type]
        self._last_power = self._taken = power
        return Command(power, t_s + self._lasts_s, reason)

    @property
    def last_power(self) -> float:
        """The power of the last command."""
        return self._last_power

    def _limited(self, asked: float, reason: str) -> tuple[float, str]:
        limits = self.limits
        power = clamp(asked, limits.power_min, limits.power_max)
        if power != asked:
            reason = "limit.high" if asked > power else "limit.low"
        if self._changeover is not None and self._changeover.waits(power, limits.changeover_s):
            return 0.0, "limit.changeover"
        if limits.rise_per_s == math.inf:
            return power, reason
        most = max(math.copysign(self._last_power, self._last_power * power), 0.0)
        most += limits.rise_per_s * self.seen_s
        if abs(power) > most:
            return math.copysign(most, power), "limit.rate"
        return power, reason

    def _why_off(self) -> str:
        rows = self.alarms.rows()
        return next((row.code for row in rows if row.latched or row.active), self.state.value)

    def check_applied(self, commanded: float, applied: float, t_s: float) -> float:
        """Return what was taken; more than the command, twice in a row, is a fault.

        More of either: a cooler that is on while the heater was asked for is no less a fault. An
        output that may be late has its window first; one that does not say what it took has none.
        """
        limits = self.limits
        tolerance = limits.applied_tolerance
        most = (0.0 if commanded < 0.0 else commanded) + tolerance
        beyond, window_s = applied - most, limits.window_s
        if applied < 0.0 and limits.power_min < 0.0:
            beyond, window_s = min(commanded, 0.0) - tolerance - applied, limits.cooler_window_s
        if math.isfinite(applied):
            self._taken = limits.possible(applied)
        else:
            beyond = math.inf
        if beyond > 0.0 or self._overdrawn is not IN_ORDER:
            self._charge(beyond, window_s, commanded, applied, t_s)
        return self._taken

    def _charge(
        self, beyond: float, window_s: float, commanded: float, applied: float, t_s: float
    ) -> None:
        """Keep the account of what the output gave beyond its commands."""
        before = self._overdrawn
        after = before.after(beyond, self._interval_s, window_s)
        self._overdrawn = IN_ORDER if after.settled else after
        if after.stuck:
            text = (
                f"expected at most {commanded:.3f} of full power, the output reports {applied:.3f}"
            )
            if window_s > 0.0:
                text += f", and its window of {window_s:g} s is over"
            self.fail("output.readback", 25, text, t_s)
        elif before.stuck:
            self._emit("output.in_order", after_s=after.lasted_s)

    # -- words -----------------------------------------------------------------------------------

    def _raise(
        self,
        code: str,
        fault: int | None,
        text: str,
        t_s: float,
        priority: int = 1,
        trace: str | None = None,
    ) -> None:
        if self.alarms.set(Alarm(code, fault, priority, t_s, text)):
            self._emit(code, text=text, **({} if trace is None else {"trace": trace}))

    def _enter(self, state: State, why: str) -> None:
        if state is not self.state:
            self._emit("state.changed", before=self.state.value, after=state.value, why=why)
            self.state = state
