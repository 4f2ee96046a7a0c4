"""What travels through the house: frozen values, one a step of the walk.

    RawSample -> Measurement -> Estimate -> Command -> Step -> Cycle

Requests travel the other way, through one queue that is read at the top of a cycle. They stand in
`thermoctl.requests`, and can be had from here as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Final

from thermoctl.filling import quickly_filled
from thermoctl.quantities import Array
from thermoctl.requests import Acknowledge as Acknowledge
from thermoctl.requests import ChooseController as ChooseController
from thermoctl.requests import ChooseShadow as ChooseShadow
from thermoctl.requests import Load as Load
from thermoctl.requests import ManualPower as ManualPower
from thermoctl.requests import Mode as Mode
from thermoctl.requests import Request as Request
from thermoctl.requests import SetPoint as SetPoint


class Quality(StrEnum):
    """What is known of a reading. Its temperature is NaN unless GOOD or STALE."""

    GOOD = "good"
    MISSING = "missing"
    OPEN = "open"
    SHORT = "short"
    STALE = "stale"


class State(StrEnum):
    """What the supervisor allows; never mixed with the mode."""

    RUN = "run"
    RIDE = "ride"
    HOLD = "hold"
    SAFE = "safe"
    LATCHED = "latched"


@quickly_filled
@dataclass(frozen=True, slots=True)
class RawSample:
    """One input as the converter saw it.

    Parameters
    ----------
    t_s : float
        Time of the SAMPLE (not of the call) on the loop's monotonic clock, in s.
    counts : float
        Converter word, or the sum of a burst of them.
    full_scale : float
        Counts at the reference voltage; for a burst of N conversions of 10 bits, N * 1024.
    sequence : int or None
        The board's own sample counter; one that stands still is a frozen converter.
    """

    t_s: float
    counts: float
    full_scale: float
    sequence: int | None = None


@quickly_filled
@dataclass(frozen=True, slots=True)
class Measurement:
    """A temperature and what is known of it."""

    t_s: float
    temperature_c: float = math.nan
    quality: Quality = Quality.GOOD
    ends_c: tuple[float, float] | None = None  # of two sensors the lower and the higher reading


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """A belief about ARX parameters; its arrays are read-only.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        theta(t|t), the parameters after the last sample.
    P : ndarray, shape (n, n)
        P(t+1|t), what the next update starts from.
    innovation : float
        e(t) = y(t) - phi(t)' theta(t-1|t-1); NaN before the first update.
    innovation_var : float
        S(t), the variance the law expected of e(t); NaN before the first update.
    inflation : float
        lambda*(t) of O21 (26), or 1/lambda(t) for least squares; 1 for the plain filter.
    rejected : bool
        The last sample was not used (non-finite input, or a guard refused it).
    """

    theta: Array
    P: Array
    innovation: float = math.nan
    innovation_var: float = math.nan
    inflation: float = 1.0
    rejected: bool = False


@quickly_filled
@dataclass(frozen=True, slots=True)
class Beliefs:
    """An estimate in the operator's words; None where the model in use says nothing.

    `gain` is the heating rate at full power in K/s, `a` the pole of the first-order law (27),
    `lag_s` the time from heater to reading; ``*_sd`` is one standard deviation.
    """

    gain: float | None = None
    gain_sd: float | None = None
    a: float | None = None
    a_sd: float | None = None
    holding_power: float | None = None
    lag_s: float | None = None


@dataclass(frozen=True, slots=True)
class PlantBelief:
    """A plant as its controller sees it after a sample.

    Parameters
    ----------
    gain_k_per_s, gain_sd_k_per_s : float
        Heating rate at full power and its standard deviation; negative where power cools.
    loss_k_per_s, loss_sd_k_per_s : float
        How fast the water would cool without power.
    holding_power, holding_power_sd : float
        Power that makes up for the loss, as a fraction.
    lag_s, lag_low_s, lag_high_s : float
        Total lag from heater to reading: mean, 5 % and 95 % quantile.
    coasting_c : float
        Where the water would come to rest with holding power from now on, in degC.
    noise_sd_k : float
        Standard deviation of a reading.
    learning : bool
        Whether the last sample counted as evidence for or against a lag.
    jumped : bool
        Whether the last sample showed the water somewhere else than it could be.
    """

    gain_k_per_s: float
    gain_sd_k_per_s: float
    loss_k_per_s: float
    loss_sd_k_per_s: float
    holding_power: float
    holding_power_sd: float
    lag_s: float
    lag_low_s: float
    lag_high_s: float
    coasting_c: float
    noise_sd_k: float
    learning: bool
    jumped: bool


@quickly_filled
@dataclass(frozen=True, slots=True)
class Feasible:
    """What is said of a set point before it is reached; NaN where not known.

    Computed every ten seconds or so, from a balance of heat that is kept beside every controller.

    Parameters
    ----------
    holding_power, holding_sd : float
        Power that holds the set point, as a fraction, and its standard deviation; beyond what there
        is where the set point is out of reach.
    highest_c, highest_sd_k : float
        Temperature that the most power there is can hold, and its standard deviation; the lowest
        one where power cools.
    arrival_s, arrival_sd_s : float
        Time until the plant rests at the set point, with all power there is until the last moment,
        and its standard deviation; 0 once it is there.
    """

    holding_power: float = math.nan
    holding_sd: float = math.nan
    highest_c: float = math.nan
    highest_sd_k: float = math.nan
    arrival_s: float = math.nan
    arrival_sd_s: float = math.nan


@dataclass(frozen=True, slots=True)
class ShadowScore:
    """Two controllers side by side over the last minutes; None where nobody can tell.

    Both saw the same samples, but only one of them moved the plant. So this says how far the two
    are apart and whose model foresees the readings better, NOT how well the shadow would hold the
    set point: a restless shadow is never punished by the temperatures it would have caused.

    Parameters
    ----------
    span_s : float
        Time that is looked at, in s: only samples at which the one in charge decided the power.
    apart : float
        Mean distance of the two powers, in [0, 1].
    travel_per_min, shadow_travel_per_min : float
        How far each moved what it asked for, in full ranges a minute.
    surprise_k, shadow_surprise_k : float or None
        Root mean square of reading minus what the law had expected of it, in K.
    """

    span_s: float
    apart: float
    travel_per_min: float
    shadow_travel_per_min: float
    surprise_k: float | None = None
    shadow_surprise_k: float | None = None


@quickly_filled
@dataclass(frozen=True, slots=True)
class Command:
    """A power that expires: without a fresh command the output falls to zero.

    Parameters
    ----------
    power : float
        Fraction in [0, 1], finite, already bounded; in [-1, 1] where there is a cooler.
    valid_until_s : float
        Loop time after which no level may go on giving this power.
    reason : str
        Which rule decided the power: ``control``, ``off``, ``sensor.open``, ``limit.rate``, ...
    """

    power: float
    valid_until_s: float
    reason: str


@dataclass(frozen=True, slots=True)
class Alarm:
    """One row of ``thermoctl alarms``.

    Parameters
    ----------
    code : str
        Stable name, such as ``sensor.open``; listed in docs/events.md.
    fault : int or None
        Number of its kind of fault, as listed in docs/events.md; None: it has none.
    priority : int
        1 acts now (SAFE, LATCHED), 2 warns, 3 informs.
    since_s : float
        Loop time at which it became active.
    text : str
        What was expected and what came.
    """

    code: str
    fault: int | None
    priority: int
    since_s: float
    text: str
    active: bool = True
    latched: bool = False
    acknowledged: bool = False


@dataclass(frozen=True, slots=True)
class Event:
    """A change of state worth a line in the journal; `name` is API."""

    t_s: float
    name: str
    fields: Mapping[str, object] = field(default_factory=dict)


def _nothing() -> None:
    """Return None: nothing is known of the plant."""


def _no_models() -> Mapping[str, Mapping[str, Any]]:
    """Return no models: these laws remember nothing."""
    return {}


@quickly_filled
@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """Everything the regulator made of one measurement.

    `setpoint_c` is the set point in force, `reference_c` what is followed now: the same, or where
    the ramp to it is. `load` is what the plant is known to lose beside its usual loss.
    `shadow` is the name of the controller that is asked beside `controller`, `shadow_power` what it
    would have given, within the limit of power; None where there is none, or no answer. `origin`
    says what the model of the one in charge began with: ``new`` with nothing, ``trial`` or
    ``stored`` with what an earlier run had learnt, ``dropped`` with that in vain. `remember`
    returns what each of the two would like to be kept, by the name of its law. Like `tell`, which
    returns `plant`, it is a function, so that only who asks pays for the answer.
    """

    t_s: float
    measurement: Measurement
    mode: Mode
    state: State
    setpoint_c: float
    command: Command
    controller: str
    estimate: Estimate
    beliefs: Beliefs = Beliefs()
    alarms: tuple[Alarm, ...] = ()
    events: tuple[Event, ...] = ()
    shadow: str | None = None
    shadow_power: float | None = None
    shadow_score: ShadowScore | None = None
    feasible: Feasible = Feasible()
    reference_c: float = math.nan
    load: float = 0.0
    tell: Callable[[], PlantBelief | None] = field(default=_nothing, repr=False)
    origin: str | None = None
    remember: Callable[[], Mapping[str, Mapping[str, Any]]] = field(default=_no_models, repr=False)

    @property
    def plant(self) -> PlantBelief | None:
        """What the controller in charge, or else the one in shadow, believes of it.

        None where neither has words for it. Computed when asked for, from a belief that is frozen:
        whoever asks pays, in any thread, and the loop never does.
        """
        return self.tell()


TRUE_TEMPERATURE: Final = "true_temperature_c"
"""Key of a simulation's truth: the temperature that the sensor of a loop should show, in degC."""


@dataclass(frozen=True, slots=True, eq=False)
class Cycle:
    """A finished cycle of one loop, as it is published into the feed.

    Parameters
    ----------
    loop : str
        Name of the loop in the configuration.
    step : Step
        The regulator's step.
    accepted_power : float
        What the hardware took, as a fraction; NaN when it took nothing.
    tick_us : float
        CPU time of the regulator's part of the cycle.
    late_s : float
        How long after its deadline the cycle woke.
    missed : int
        Cycles lost since the start.
    truth : mapping
        What only a simulation knows, such as ``true_temperature_c``.
    """

    loop: str
    step: Step
    accepted_power: float
    tick_us: float = 0.0
    late_s: float = 0.0
    missed: int = 0
    truth: Mapping[str, float] = field(default_factory=dict)
