"""What is shown, derived from the cycles of one loop; knows no terminal."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from thermoctl.app.live.scale import Scale, range_for
from thermoctl.app.live.sentences import Sentence, continued, sentence
from thermoctl.app.live.trend import Trend, TrendRecorder
from thermoctl.insight import Change, Drift, Insight, Row
from thermoctl.quantities import Array
from thermoctl.signals import Beliefs, Cycle, Event, Mode, Quality, Step

RECENT = 300
"""Samples that whiteness and tick time are judged on."""

FEWEST = 30
"""Pairs of samples before whiteness is judged at all."""

DEVIATION_SAMPLES = 600
"""Samples the standard deviation is taken from: ten minutes at one a second."""

STEERED = frozenset({Mode.AUTO, Mode.PROGRAM})
"""Modes in which the controller decides the power, and its model is judged."""

STALE_PERIODS = 3.0
CHANGED, DRIFT = "plant.changed", "plant.drift"
_EVENTS_KEPT = 200
_LARGEST = 1e9  # beyond it a number is a fault, and its square would soon overflow
_NAN = math.nan


@dataclass(frozen=True, slots=True)
class Facts:
    """What does not change while the view is open.

    Parameters
    ----------
    loop : str
        Name of the loop whose cycles are shown.
    period_s : float
        Time between two samples in s, greater than zero.
    setpoint_low_c, setpoint_high_c : float
        Limits of the set point.
    zero : datetime
        Wall time at loop time 0.
    simulated : bool
        Whether the plant is a simulation.
    speed : float or None
        Simulated seconds per second; None is as fast as it goes.
    """

    loop: str
    period_s: float
    setpoint_low_c: float
    setpoint_high_c: float
    zero: datetime
    simulated: bool = True
    speed: float | None = 1.0

    def __post_init__(self) -> None:
        if not self.period_s > 0.0:
            raise ValueError(f"period_s must be positive, got {self.period_s!r}")
        if not self.setpoint_low_c <= self.setpoint_high_c:
            raise ValueError(
                f"setpoint_low_c {self.setpoint_low_c!r} must not lie above "
                f"setpoint_high_c {self.setpoint_high_c!r}"
            )


@dataclass(frozen=True, slots=True)
class Whiteness:
    """Lag-one autocorrelation of the innovations, and its limit when white."""

    autocorrelation: float
    limit: float

    @property
    def verdict(self) -> str:
        """Return the judgement: within the limit, within twice the limit, or beyond."""
        if abs(self.autocorrelation) <= self.limit:
            return "white"
        return "nearly white" if abs(self.autocorrelation) <= 2.0 * self.limit else "not white"


def whiteness(innovations: Array) -> Whiteness | None:
    """Return how white `innovations` are; None before `FEWEST` neighbouring pairs.

    The mean is not taken off: innovations of a right model have mean zero, and one that keeps its
    sign is as much a fault of the model as one that alternates. The limit is two standard
    deviations of the autocorrelation of white noise, ``2 / sqrt(N)``.

    Parameters
    ----------
    innovations : ndarray, shape (N,)
        Oldest first, in units of their own σ; NaN breaks a pair.
    """
    e = innovations
    paired = np.isfinite(e[:-1]) & np.isfinite(e[1:])
    count = int(paired.sum())
    power = float(np.mean(np.square(e[np.isfinite(e)]))) if count else 0.0
    if count < FEWEST or not 0.0 < power < math.inf:
        return None
    r1 = float(np.mean(e[:-1][paired] * e[1:][paired])) / power
    return Whiteness(r1, 2.0 / math.sqrt(count))


@dataclass(frozen=True, slots=True, eq=False)
class Recent:
    """Figures of the last samples; NaN where too few are known.

    Parameters
    ----------
    innovations : ndarray
        The last ones, oldest first, each in its own σ; NaN where a sample was not used.
    whiteness : Whiteness or None
        Of those innovations that were made while the law steered; None when it cannot be judged.
    deviation_sd_k, deviation_max_k : float
        Standard deviation, about the mean, and largest size of the deviation from the set point,
        over the last `DEVIATION_SAMPLES`.
    tick_us, tick_99_us : float
        CPU time of the last cycle, and what 99 % of the recent ones stayed below.
    """

    innovations: Array
    whiteness: Whiteness | None
    deviation_sd_k: float
    deviation_max_k: float
    tick_us: float
    tick_99_us: float


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One moment of a run: all that `thermoctl.app.live.render.render` needs.

    `insight` is what is told of the plant beside its controller, None where nobody looks; `lost`
    says why nothing more is heard of the loop, and is empty while it is.
    """

    facts: Facts
    now_s: float
    step: Step | None
    accepted_power: float
    last_good_s: float
    trend: Trend
    range_s: float
    scale: Scale
    recent: Recent
    events: tuple[Sentence, ...]
    insight: Insight | None = None
    prompt: str = ""
    paused: bool = False
    lost: str = ""

    @property
    def steered(self) -> bool:
        """Return whether the mode leaves the power to the controller."""
        return self.step is not None and self.step.mode in STEERED

    @property
    def age_s(self) -> float:
        """Return how long ago the last good sample was; NaN when there was none."""
        age_s = self.now_s - self.last_good_s
        return 0.0 if age_s < 0.0 else age_s  # NaN stays NaN

    @property
    def stale(self) -> bool:
        """Return whether nothing good came for three periods, or nobody tells."""
        late = not self.age_s <= STALE_PERIODS * self.facts.period_s
        return self.step is not None and (late or bool(self.lost))

    @property
    def temperature_c(self) -> float:
        """Return the temperature of the last step; NaN unless it was a good sample."""
        if self.step is None or self.step.measurement.quality is not Quality.GOOD:
            return _NAN
        return _known(self.step.measurement.temperature_c)

    @property
    def setpoint_c(self) -> float:
        """Return the set point; NaN before the first step."""
        return _NAN if self.step is None else _known(self.step.setpoint_c)

    @property
    def followed_c(self) -> float:
        """Return where the ramp to the set point is; the set point where there is none."""
        return _NAN if self.step is None else _followed(self.step)

    @property
    def deviation_k(self) -> float:
        """Return temperature minus what is followed; NaN when either is not known."""
        return self.temperature_c - self.followed_c

    @property
    def beliefs(self) -> Beliefs:
        """Return the last beliefs."""
        return Beliefs() if self.step is None else self.step.beliefs


def _followed(step: Step) -> float:
    """Return the temperature a controller that steers is after; else the set point."""
    ramp_c = _known(step.reference_c) if step.mode in STEERED else _NAN
    return _known(step.setpoint_c) if ramp_c != ramp_c else ramp_c


def told(insight: Insight | None, name: str) -> Row | None:
    """Return the row `name` of `insight`, None where it has no value."""
    rows = () if insight is None else insight.rows
    return next((row for row in rows if row.name == name and row.value is not None), None)


def _known(value: float | None) -> float:
    """Return `value`, or NaN when it is none, not finite, or too large to be believed."""
    return value if value is not None and -_LARGEST < value < _LARGEST else _NAN


def to_hold(step: Step, insight: Insight | None) -> tuple[float, float]:
    """Return the power that holds the set point and its standard deviation.

    From the balance of heat where that has come to know it, else from the controller in charge;
    NaN is unknown.
    """
    if math.isfinite(step.feasible.holding_power):
        return step.feasible.holding_power, step.feasible.holding_sd
    own, row = step.beliefs.holding_power, told(insight, "holding_power")
    error = None if row is None else row.error  # twice the standard deviation, in per cent
    return _NAN if own is None else own, _NAN if error is None else 0.005 * error


def _believed(step: Step, insight: Insight | None) -> tuple[float, ...]:
    """Return gain in K/min, pole, holding power, loss in K/min and lag in s; NaN is unknown."""
    beliefs = step.beliefs
    gain, loss, lag = (told(insight, name) for name in ("gain", "loss", "lag"))
    own = None if beliefs.gain is None else 60.0 * beliefs.gain
    return (
        _known(own if gain is None else gain.value),
        _known(beliefs.a),
        _known(to_hold(step, insight)[0]),
        _known(None if loss is None else loss.value),
        _known(beliefs.lag_s if lag is None else lag.value),
    )


def _in_sigma(step: Step) -> float:
    """Return the innovation of `step` in its own σ; NaN when there was none."""
    estimate = step.estimate
    if estimate.rejected or not estimate.innovation_var > 0.0:
        return _NAN
    return _known(estimate.innovation / math.sqrt(estimate.innovation_var))


class LiveModel:
    """Takes the cycles of one loop, gives a `View` at any moment; bounded.

    Parameters
    ----------
    facts : Facts
        What does not change. Cycles of other loops are passed over.
    """

    def __init__(self, facts: Facts) -> None:
        self.facts = facts
        self._cycle: Cycle | None = None
        self._insight: Insight | None = None
        self._changes: tuple[Change, ...] = ()
        self._drifts: dict[str, Drift] = {}
        self._last_good_s = _NAN
        self._first_s = _NAN
        self._recorder = TrendRecorder(facts.period_s)
        self._scale = Scale()
        self._range_s = 0.0
        self._innovations: deque[float] = deque(maxlen=RECENT)
        self._judged: deque[float] = deque(maxlen=RECENT)
        self._ticks_us: deque[float] = deque(maxlen=RECENT)
        self._deviations_k: deque[float] = deque(maxlen=DEVIATION_SAMPLES)
        self._events: deque[Sentence] = deque(maxlen=_EVENTS_KEPT)

    def feed(self, cycle: Cycle, insight: Insight | None = None) -> None:
        """Take one finished cycle, and what is told of the plant after it."""
        step = cycle.step
        if cycle.loop != self.facts.loop:
            return
        self._cycle, self._insight = cycle, insight
        measurement = step.measurement
        temperature_c = _NAN
        if measurement.quality is Quality.GOOD:
            temperature_c = _known(measurement.temperature_c)
            if temperature_c == temperature_c:
                self._last_good_s = step.t_s
        if self._first_s != self._first_s:
            self._first_s = step.t_s
        setpoint_c = _known(step.setpoint_c)
        followed_c = _followed(step)
        deviation_k = temperature_c - followed_c
        innovation = _in_sigma(step)
        self._innovations.append(innovation)
        self._judged.append(innovation if step.mode in STEERED else _NAN)
        self._deviations_k.append(deviation_k)
        self._ticks_us.append(_known(cycle.tick_us))
        self._scale.grow(temperature_c)
        self._scale.grow(setpoint_c)
        self._recorder.add(
            step.t_s,
            (temperature_c, 1e3 * deviation_k, _known(cycle.accepted_power)),
            (_known(step.estimate.inflation), followed_c, *_believed(step, insight)),
        )
        for event in step.events:
            if insight is None or event.name not in (CHANGED, DRIFT):
                self.note(event)
        if insight is not None:
            self._note_news(step.t_s, insight)

    def _note_news(self, t_s: float, insight: Insight) -> None:
        """Take changes and drifts that are new, dated; whoever joins late has the last ones too.

        They are in the journal of a daemon as well, but not among the events of its cycles.
        """
        for change in reversed(insight.changes):
            if change not in self._changes:
                self.note(Event(change.t_s, CHANGED, {"text": change.text}))
        self._changes = insight.changes
        now = {drift.name: drift for drift in insight.drifts}
        for name, drift in now.items():
            if name not in self._drifts:
                self.note(Event(drift.since_s, DRIFT, {"active": True, "text": drift.text}))
        for name, drift in self._drifts.items():
            if name not in now:
                self.note(Event(t_s, DRIFT, {"active": False, "text": drift.text}))
        self._drifts = now

    def note(self, event: Event) -> None:
        """Take an event, also one that came by another way than a step.

        A change that goes on with the last one takes its place, or a key that is held down would
        push all else off the screen.
        """
        if self._events and (whole := continued(self._events[-1], event)) is not None:
            self._events[-1] = whole
        else:
            self._events.append(sentence(event))

    def view(self, now_s: float, prompt: str = "", *, paused: bool = False, lost: str = "") -> View:
        """Return what to show at loop time `now_s`, `prompt` in the row of keys."""
        cycle = self._cycle
        self._range_s = max(self._range_s, range_for(now_s - self._first_s))
        return View(
            facts=self.facts,
            now_s=now_s,
            step=None if cycle is None else cycle.step,
            accepted_power=_NAN if cycle is None else _known(cycle.accepted_power),
            last_good_s=self._last_good_s,
            trend=self._recorder.trend(),
            range_s=self._range_s,
            scale=self._scale.copy(),
            recent=self._recent(),
            events=tuple(self._events),
            insight=self._insight,
            prompt=prompt,
            paused=paused,
            lost=lost,
        )

    def _recent(self) -> Recent:
        """Return the figures of the last samples."""
        deviations = np.array(self._deviations_k)
        deviations = deviations[np.isfinite(deviations)]
        ticks = np.array(self._ticks_us)
        ticks = ticks[np.isfinite(ticks)]
        innovations = np.array(self._innovations)
        enough = deviations.size >= FEWEST
        return Recent(
            innovations=innovations,
            whiteness=whiteness(np.array(self._judged)),
            deviation_sd_k=float(deviations.std()) if enough else _NAN,
            deviation_max_k=float(np.abs(deviations).max()) if enough else _NAN,
            tick_us=self._ticks_us[-1] if self._ticks_us else _NAN,
            tick_99_us=float(np.quantile(ticks, 0.99)) if ticks.size >= FEWEST else _NAN,
        )
