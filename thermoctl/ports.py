"""Protocols by which rooms meet without importing each other.

Runtime and drivers know these, not each other; `thermoctl.app.compose` puts them together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, runtime_checkable

from thermoctl.filling import quickly_filled
from thermoctl.quantities import Array
from thermoctl.signals import Beliefs, Estimate, PlantBelief, RawSample


class Clock(Protocol):
    """Monotonic time; with a simulated clock an hour runs in seconds."""

    def now_s(self) -> float:
        """Return the time in s; its zero is arbitrary and it never goes back."""
        ...

    def sleep_until(self, t_s: float) -> None:
        """Return at `t_s` or a little later; at once when it is past."""
        ...


class Link(Protocol):
    """A byte stream with time-outs, as pyserial offers it; a pty fits as well."""

    timeout: float | None
    write_timeout: float | None

    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes, fewer when `timeout` passes first."""
        ...

    def write(self, data: bytes, /) -> int | None:
        """Write all of `data`; raise when `write_timeout` passes first."""
        ...

    def reset_input_buffer(self) -> None:
        """Forget what has come and was not read."""
        ...

    def close(self) -> None:
        """Let the device go."""
        ...


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a board can do beyond reading and writing."""

    dead_man: bool = False
    readback: bool = False
    push: bool = False


@dataclass(frozen=True, slots=True)
class Identity:
    """Who answered: kind, serial number or port, firmware version."""

    kind: str
    name: str
    version: str


@dataclass(frozen=True, slots=True)
class Health:
    """How a board is doing: ``status`` is ``ok``, ``degraded`` or ``down``."""

    status: str
    counters: Mapping[str, int] = field(default_factory=dict)
    last_good_s: float | None = None
    last_error: str | None = None


class Board(Protocol):
    """Hardware with inputs and outputs; every call blocks until a deadline.

    A class is built as ``Driver(settings, link, clock)`` and does no I/O before `open`.
    `read` and `write` raise a `thermoctl.errors.DriverError`, never anything else. Settings that
    have `inputs` and `outputs`, the names of the channels they make, let a configuration that
    names another one be refused before anything runs.
    """

    Settings: ClassVar[type[Any]]
    capabilities: Capabilities

    def open(self, deadline_s: float) -> Identity:
        """Write power 0, then identify the board; `LinkError` or `WrongDevice`."""
        ...

    def read(self, deadline_s: float) -> Mapping[str, RawSample]:
        """Return every input, in one exchange; an input that did not answer is not in it."""
        ...

    def write(
        self, outputs: Mapping[str, float], valid_for_s: float, deadline_s: float
    ) -> Mapping[str, float]:
        """Set `outputs`, re-arm the dead-man, and return what the hardware TOOK."""
        ...

    def health(self) -> Health:
        """Return counters and the last error."""
        ...

    def close(self) -> None:
        """Write safe values, let the device go; idempotent, never raises."""
        ...


@runtime_checkable
class Simulated(Protocol):
    """What only a simulated board can do: tell the truth, and be disturbed."""

    def truth(self) -> Mapping[str, float]:
        """Return what no sensor sees, such as ``true_temperature_c``.

        That is of every input but one with a key of its own: of ``element`` it is ``element_c``.
        """
        ...

    def disturb(self, name: str, amount: float | None = None) -> str:
        """Start the disturbance `name` and return a sentence that says what happened."""
        ...


class Estimator(Protocol):
    """A law of estimation: frozen; a belief goes in and comes out."""

    def update(self, belief: Estimate, phi: Array, y: float) -> Estimate:
        """Return the belief after regressor `phi`, shape (n,), met output `y`."""
        ...


@quickly_filled
@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """What a controller may know when it is asked for a power.

    Parameters
    ----------
    t_s, interval_s : float
        Time of this sample, and since the previous one, in s.
    temperature_c : float
        This sample, or the model's prediction of it while the supervisor rides; NaN: not known.
    setpoint_c : float
        What to follow now: the set point, or where its ramp is.
    applied : float
        Power the actuator took during the interval that has just ended.
    estimate : Estimate
        The belief after this sample.
    y_past_c, u_past : ndarray
        Past temperatures and applied powers, newest first: ``y_past_c[0]`` is this sample and
        ``u_past[0]`` is `applied`. As many as the structure of the model needs.
    measured_c : float
        This reading; NaN when there is none, or none to be believed.
    setpoint_rate_k_per_s : float
        How fast `setpoint_c` moves, with its sign; 0 at the end of a ramp.
    target_c : float
        Where the ramp ends; NaN where nobody said.
    commanded : float
        Power that was commanded for that interval, whoever asked for it: what limits have left of
        it. An output that is not exact makes `applied` of it. NaN where nobody said.
    kept_s : float
        Time constant in s with which what acts comes down when power is taken back: a block keeps
        its heat. 0 for a heater without one, whose heat is under way in what is controlled.
    """

    t_s: float
    interval_s: float
    temperature_c: float
    setpoint_c: float
    applied: float
    estimate: Estimate
    y_past_c: Array
    u_past: Array
    measured_c: float = math.nan
    setpoint_rate_k_per_s: float = 0.0
    target_c: float = math.nan
    commanded: float = math.nan
    kept_s: float = 0.0


@runtime_checkable
class Controller(Protocol):
    """A law of control: frozen; what it remembers goes in and comes out.

    Once per sample it is shown the situation by `observe`, in every mode and state, in charge or
    not. Only when its power is wanted, `decide` follows. A law may fail in any of its methods:
    that costs the heat, and its belief stays as it was.
    """

    name: ClassVar[str]

    def start(self) -> Any:
        """Return the belief before the first sample."""
        ...

    def observe(self, belief: Any, situation: Situation) -> Any:
        """Return the belief after this sample, whoever steers."""
        ...

    def decide(self, belief: Any, situation: Situation) -> tuple[Any, float]:
        """Return the new belief and the power to ask for; not yet bounded, may be NaN."""
        ...

    def beliefs(self, belief: Any, situation: Situation) -> Beliefs:
        """Return the estimate in the operator's words, holding power included if known."""
        ...

    def ride_s(self, belief: Any) -> float:
        """Return how long the model may steer without a sensor: three lags, or 0."""
        ...

    def remarks(self, belief: Any) -> Mapping[str, str]:
        """Return what is out of the ordinary: names of events, a sentence for each.

        An event is emitted when a name appears, with ``active=True`` and the sentence, and one when
        it is gone, with ``active=False``.
        """
        ...


@runtime_checkable
class Foretelling(Protocol):
    """A controller that can also tell how well it foresees; no law has to."""

    def surprise_k(self, belief: Any, situation: Situation) -> float:
        """Return this reading minus what was expected of it, in K; NaN: not known.

        `belief` is the one that `observe` made of this sample: a law predicts it there anyway.
        What was expected may use the power that was applied meanwhile, for that is no merit of
        the law, but nothing of the reading itself.
        """
        ...


@dataclass(frozen=True, slots=True)
class Remembered:
    """What a controller of an earlier run has learnt.

    Parameters
    ----------
    model : mapping
        As its `remember` returned it, and as it came back from a file: anything may stand there.
    age_s : float
        How long ago.
    """

    model: Mapping[str, Any]
    age_s: float


@runtime_checkable
class Remembering(Protocol):
    """A controller that goes on with what it learnt before a restart; no law has to."""

    def remember(self, belief: Any) -> Mapping[str, Any] | None:
        """Return what is worth keeping, as JSON knows it; None while nothing is."""
        ...

    def origin(self, belief: Any) -> str | None:
        """Return ``new``, ``trial``, ``stored`` or ``dropped``: how the model began."""
        ...

    def start_from(self, remembered: Mapping[str, Any], age_s: float) -> Any:
        """Return the belief before the first sample, with what was `remembered`.

        What comes back may be of another plant by now: it has to be doubted, and given up where the
        readings speak against it.

        Raises
        ------
        ValueError
            It is implausible, or of another law; the text says what was expected and what came.
        """
        ...


@runtime_checkable
class Knowing(Protocol):
    """A controller that can also say what its plant is like; no law has to."""

    def plant(self, belief: Any) -> PlantBelief | None:
        """Return everything believed of the plant; None while that is nothing."""
        ...
