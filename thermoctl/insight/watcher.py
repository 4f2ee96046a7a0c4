"""One loop, watched: finished steps go in, an `Insight` comes out.

Fed beside the loop, never by its thread: see ``thermoctl/app/daemon/insight_watch.py``. A step
costs a tenth of a millisecond; a judgement, once a minute of the loop's time, some ten.
"""

from __future__ import annotations

import math
from collections import deque

from thermoctl.insight.assay import Assay
from thermoctl.insight.assay_schedule import AssaySchedule
from thermoctl.insight.change_words import change_of, change_of_gain, dilution, jump_at
from thermoctl.insight.changes import ChangeWatch, Found
from thermoctl.insight.faults import ELEMENT, TURN_LAGS, TURN_S, Faults
from thermoctl.insight.gate import GateWatch
from thermoctl.insight.performance import PerformanceWatch
from thermoctl.insight.rest import Rest
from thermoctl.insight.restless import Restless
from thermoctl.insight.rows import rows
from thermoctl.insight.samples import Samples
from thermoctl.insight.told_gain import ToldGain, is_seen
from thermoctl.insight.values import Change, Drift, Insight
from thermoctl.insight.witness import Witness
from thermoctl.quantities import Uncertain
from thermoctl.signals import Event, Mode, PlantBelief, Quality, State, Step

CHANGES = 10
"""Number of changes that are remembered."""
SETTLED_LAGS, SETTLED_S = 10.0, 60.0
"""Time at rest after which the plant is taken as known: in lags and in s, the longer of the two."""
CALM_S, CALM_LAGS = 600.0, 30.0
"""Time after a move in which glass and corners still follow, and no line is fitted: in s and in
lags, the longer of the two."""
SURE = 0.15
"""Relative standard deviation of a gain from which on it is not known."""
ROWS_S = 5.0
"""Time from one set of rows to the next."""
GAIN_MOVED = 1.1
"""Factor by which a gain has to move for the balance to begin anew."""
LAG_MOVED, LAG_HOLDS_S = 2.5, 3_600.0
"""Factor by which a lag has to move, and time in s for which, for everything to begin anew."""


class Insights:
    """Watches one loop.

    Parameters
    ----------
    period_s : float
        Time between two samples.
    heater_w : float, optional
        Rated power of the heater in W; without it nothing is told in watts, joules or litres.
    power_max, power_min : float
        Most and least power that is ever given, as a fraction; below 0 it cools.

    Raises
    ------
    ValueError
        A parameter is not positive and finite.
    """

    def __init__(
        self,
        period_s: float = 1.0,
        heater_w: float | None = None,
        power_max: float = 1.0,
        power_min: float = 0.0,
    ) -> None:
        named = (("period_s", period_s), ("heater_w", heater_w), ("power_max", power_max))
        for name, value in named:
            if value is not None and not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive and finite, got {value!r}")
        self._period_s, self._heater_w = period_s, heater_w
        self._witness, self._gate, self._rest = Witness(period_s), GateWatch(), Rest()
        self._performance = PerformanceWatch(period_s, power_min, power_max)
        self._restless = Restless()
        self._faults = Faults()
        self._samples = Samples(period_s)
        self._told_gain, self._gain = ToldGain(), Uncertain()
        self._known: _WatchedPlant | None = None
        self._changes: deque[Change] = deque(maxlen=CHANGES)
        self._applied, self._power = 0.0, _Turn()
        self._rows_due_s = self._jumped_s = -math.inf
        self._moving = True
        self._now = Insight()

    @property
    def now(self) -> Insight:
        """What is told after the last step."""
        return self._now

    def after(self, step: Step, accepted_power: float) -> tuple[Event, ...]:
        """Take a finished step; return what is news for the journal.

        Parameters
        ----------
        step : Step
            The regulator's step.
        accepted_power : float
            What the hardware took, until the next step; NaN when it took nothing.
        """
        applied = self._applied
        self._applied = accepted_power if math.isfinite(accepted_power) else 0.0
        plant = self._witness.after(step, applied)
        if plant is None:
            return ()
        before = dict(self._faults.active)
        newest = self._changes[0] if self._changes else None
        if self._rest.after(step, plant.noise_sd_k):
            self._moved(step)
        self._watch(step, plant, applied)
        self._tell(step, plant)
        return (*self._news_of_changes(step.t_s, newest), *self._news_of_drifts(step.t_s, before))

    # -- watching --------------------------------------------------------------------------------

    def _moved(self, step: Step) -> None:
        """Forget what another set point or mode has made worthless."""
        self._moving = True
        self._faults.settle_anew()
        self._power = _Turn()
        if step.mode is not Mode.AUTO:
            why = "not in mode auto"
        elif step.state is not State.RUN:
            why = f"nothing is judged in state {step.state}"
        else:
            why = "collecting: moved a moment ago"
        self._performance.forget(why)
        self._restless.begin()

    def _watch(self, step: Step, plant: PlantBelief, applied: float) -> None:
        """Show the step to everyone who watches."""
        good = step.measurement.quality is Quality.GOOD
        reading_c = step.measurement.temperature_c if good else math.nan
        self._samples.take(step.t_s, reading_c, applied, plant.lag_s)
        self._gain = self._told_gain.after(plant, reading_c)
        known = self._known_after(step, plant)
        gain_k_per_s = plant.gain_k_per_s if known is None else known.gain_k_per_s
        if self._performance.now.index is None and self._rest.lasts_s(step.t_s) < CALM_S:
            self._judge_unrest(step, plant.lag_s, gain_k_per_s)
        if known is None:
            return
        if self._moving and self._rest.lasts_s(step.t_s) >= max(CALM_S, CALM_LAGS * known.lag_s):
            self._moving = False
        if self._moving:
            known.changes.forget()
        found = known.changes.after(step.t_s, reading_c, applied, plant.noise_sd_k)
        if found is not None:
            self._found(known, step.t_s, found)
        if plant.jumped:
            self._jumped(known, step.t_s)
        assay = known.assays.after(step.t_s, self._rest) if known.is_sound else None
        if assay is not None:
            self._assayed(known, step.t_s, assay)
        if good and self._rest.lasts_s(step.t_s) > 0.0 and not known.changes.busy:
            self._at_rest(step, plant, reading_c, gain_k_per_s)

    def _known_after(self, step: Step, plant: PlantBelief) -> _WatchedPlant | None:
        """Return what is known of the plant, which begins when the loop is first at rest."""
        if self._known is not None and not self._known.outlived(step.t_s, plant, self._rest):
            return self._known
        settled_s = max(SETTLED_S, SETTLED_LAGS * plant.lag_s)
        sure = 0.0 < plant.gain_sd_k_per_s < SURE * abs(plant.gain_k_per_s)
        settled = sure and self._rest.lasts_s(step.t_s) >= settled_s
        self._known = (
            _WatchedPlant(self._period_s, plant, self._gain, self._samples, self._applied)
            if settled
            else None
        )
        return self._known

    def _judge_unrest(self, step: Step, lag_s: float, gain_k_per_s: float) -> None:
        """Judge what is held, and never at rest for long."""
        if step.mode is not Mode.AUTO or step.state is not State.RUN:
            return
        near = self._rest.lasts_s(step.t_s) > 0.0
        told = self._restless.after(
            step.t_s, self._samples, step.setpoint_c, lag_s, gain_k_per_s, near=near
        )
        if told is not None:
            self._performance.now = told

    def _at_rest(
        self, step: Step, plant: PlantBelief, reading_c: float, gain_k_per_s: float
    ) -> None:
        """Judge what can only be judged at rest."""
        self._performance.after(
            step.t_s,
            reading_c,
            step.setpoint_c,
            self._applied,
            plant.lag_s,
            plant.noise_sd_k,
            gain_k_per_s,
        )
        turn_s = max(TURN_S, TURN_LAGS * plant.lag_s)
        mean = self._power.after(step.t_s, self._applied, turn_s)
        if mean is not None:
            self._faults.turn(step.t_s, mean, plant.noise_sd_k)

    def _found(self, known: _WatchedPlant, t_s: float, found: Found) -> None:
        self._changes.appendleft(change_of(found, known.gain, self._given_w()))
        known.assays.disturb(t_s)
        self._power = _Turn()
        if found.step_k is not None:
            self._faults.add_cold(dilution(found))

    def _jumped(self, known: _WatchedPlant, t_s: float) -> None:
        """Date a jump that nobody can measure, because the loop was moved as well."""
        first = t_s - self._jumped_s > known.lag_s * SETTLED_LAGS
        self._jumped_s = t_s
        moving = t_s - self._rest.moved_s < max(SETTLED_S, 2.0 * SETTLED_LAGS * known.lag_s)
        if first and moving and not known.changes.busy:
            self._changes.appendleft(jump_at(t_s))

    def _assayed(self, known: _WatchedPlant, t_s: float, found: Assay) -> None:
        compared = self._faults.take_gain(t_s, found.gain)
        known.take(found, self._applied)
        if compared is not None:
            self._changes.appendleft(change_of_gain(self._rest.moved_s, compared))

    # -- telling ---------------------------------------------------------------------------------

    def _tell(self, step: Step, plant: PlantBelief) -> None:
        if step.measurement.quality is not Quality.GOOD:
            return
        known, told = self._known, self._now.rows
        if step.t_s >= self._rows_due_s:
            self._rows_due_s = step.t_s + ROWS_S
            told = rows(
                plant,
                self._gain if known is None else known.gain,
                None if known is None else known.slope,
                self._given_w(),
            )
        self._now = Insight(
            step.t_s,
            self._gate.after(step.t_s, plant),
            told,
            tuple(self._changes),
            tuple(self._faults.active.values()),
            self._performance.now,
        )

    def _given_w(self) -> float | None:
        """Return what the heater gives: less than it is rated where its element is weak."""
        weak = self._faults.active.get(ELEMENT)
        if weak is None or self._heater_w is None:
            return self._heater_w
        return self._heater_w * weak.now / weak.before

    def _news_of_changes(self, t_s: float, newest: Change | None) -> list[Event]:
        """Return the events of changes since `newest`, oldest first."""
        news = []
        for change in self._changes:
            if change is newest:
                break
            fields = {
                "kind": change.kind,
                "size": change.size,
                "unit": change.unit,
                "text": change.text,
                "began_s_ago": round(t_s - change.t_s, 1),
            }
            news.append(Event(t_s, "plant.changed", fields))
        return news[::-1]

    def _news_of_drifts(self, t_s: float, before: dict[str, Drift]) -> list[Event]:
        active = self._faults.active
        begun = [each for name, each in active.items() if name not in before]
        ended = [each for name, each in before.items() if name not in active]
        return [_drifted(t_s, each, True) for each in begun] + [
            _drifted(t_s, each, False) for each in ended
        ]


def _drifted(t_s: float, drift: Drift, active: bool) -> Event:
    fields = {"drift": drift.name, "active": active, "text": drift.text}
    return Event(t_s, "plant.drift", fields)


class _Turn:
    """The mean power of a turn at rest."""

    def __init__(self) -> None:
        self._begin_s, self._sum, self._count = math.nan, 0.0, 0

    def after(self, t_s: float, power: float, turn_s: float) -> float | None:
        """Take a power; return the mean of the turn that it ends."""
        if math.isnan(self._begin_s):
            self._begin_s = t_s
        self._sum += power
        self._count += 1
        if t_s - self._begin_s < turn_s:
            return None
        mean = self._sum / self._count
        self._begin_s, self._sum, self._count = t_s, 0.0, 0
        return mean


class _WatchedPlant:
    """A plant that can be watched: its lag and gain, and who watches with them.

    `gain` is what is told of it, NaN where nothing is fit to be told; `gain_k_per_s` is what it is
    watched with, sound or not.
    """

    def __init__(
        self,
        period_s: float,
        plant: PlantBelief,
        gain: Uncertain,
        samples: Samples,
        power: float,
    ) -> None:
        self._period_s, self.lag_s = period_s, plant.lag_s
        self.gain, self.gain_k_per_s = gain, plant.gain_k_per_s
        self.slope: Uncertain | None = None
        self._alike_s, self._strays = math.nan, False
        self.assays = AssaySchedule(self.lag_s, self.gain_k_per_s, samples)
        self.changes = ChangeWatch(period_s, self.lag_s, self.gain_k_per_s, power)

    @property
    def is_sound(self) -> bool:
        """Whether its gain is fit to be told, and the noise beside it to be learnt."""
        return math.isfinite(self.gain.mean)

    def outlived(self, t_s: float, plant: PlantBelief, rest: Rest) -> bool:
        """Return whether the plant has another lag by now, and not just for a while.

        A lag that begins to stray at rest, or that nobody can see, is that of the noise.
        """
        seen, alike = is_seen(plant), 1.0 / LAG_MOVED <= plant.lag_s / self.lag_s <= LAG_MOVED
        calm = rest.lasts_s(t_s) >= max(CALM_S, CALM_LAGS * self.lag_s)
        if seen and not calm and not self.is_sound:
            return True
        self._strays = seen and not alike and (self._strays or not calm)
        if not self._strays or math.isnan(self._alike_s):
            self._alike_s = t_s
        return t_s - self._alike_s > LAG_HOLDS_S

    def take(self, found: Assay, power: float) -> None:
        """Take over a gain that was assayed on a move."""
        self.gain, self.slope = found.gain, found.slope or self.slope
        self.gain_k_per_s = found.gain.mean
        if not 1.0 / GAIN_MOVED <= self.gain_k_per_s / self.changes.gain_k_per_s <= GAIN_MOVED:
            self.changes = ChangeWatch(self._period_s, self.lag_s, self.gain_k_per_s, power)
