"""What is told of a loop: frozen values, ready for a screen, a journal or JSON.

Times are those of the loop; who shows them knows the wall clock. Texts are whole words in UTF-8,
without the time and without the name of the loop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any


class Gate(StrEnum):
    """Whether the last samples taught anything of the plant."""

    UNKNOWN = "nothing seen yet"
    LEARNING = "learning"
    PAUSED = "paused: nothing to learn"
    HELD = "held: the water jumped"


@dataclass(frozen=True, slots=True)
class Row:
    """A quantity of the plant in physical words.

    Parameters
    ----------
    name : str
        Stable key: ``gain``, ``loss``, ``holding_power``, ``lag``, ``noise``, ``volume``,
        ``loss_w`` or ``loss_w_per_k``.
    label : str
        What it is called before its value.
    value, error : float or None
        In `unit`, and two standard deviations; None where that is not known.
    unit : str
        ``K/min``, ``%``, ``s``, ``mK``, ``l``, ``W`` or ``W/K``.
    text : str
        Value, error and unit; a dash and the reason where there is no value.
    low, high : float or None
        5 % and 95 % quantile, where the error is not the same to both sides.
    """

    name: str
    label: str
    value: float | None
    error: float | None
    unit: str
    text: str
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True)
class Change:
    """A moment at which the plant was another one than before.

    Parameters
    ----------
    t_s : float
        Loop time at which it began.
    kind : str
        ``step.loss``, ``step.gain``: heat that went or came at once; ``loss.up``, ``loss.down``:
        heat that goes on going; ``gain.up``, ``gain.down``: another amount of water, or another
        heater; ``jump``: the water jumped while nobody could say by how much.
    size : float or None
        In `unit`; negative where it is colder.
    error : float or None
        Two standard deviations of it.
    unit : str
        ``K`` of a step, ``K/min`` of a loss, ``%`` of the gain before.
    text : str
        What it amounts to.
    heat_j : float or None
        Heat of a step, where the power of the heater is known.
    """

    t_s: float
    kind: str
    size: float | None
    error: float | None
    unit: str
    text: str
    heat_j: float | None = None


@dataclass(frozen=True, slots=True)
class Drift:
    """A fault that has a name, read from what the plant has become.

    Parameters
    ----------
    name : str
        ``element.weak``, ``loss.up``, ``water.low`` or ``wiring.noisy``.
    since_s : float
        Loop time at which it was first seen.
    text : str
        What it looks like, with the figures.
    before, now : float
        The quantity it was read from, when it was learnt and now, in the unit of the text.
    sigmas : float
        How many standard deviations lie between them.
    """

    name: str
    since_s: float
    text: str
    before: float
    now: float
    sigmas: float


class Limit(StrEnum):
    """What keeps a loop from being steadier than it is."""

    NONE = "none"
    STEP = "the sensor's step"
    NOISE = "noise"
    LAG = "the lag"
    POWER = "the power"
    CYCLE = "a cycle"
    ELSEWHERE = "something else"
    UNTOLD = "untold"


@dataclass(frozen=True, slots=True)
class Performance:
    """A loop against the steadiest that its delay allows.

    Parameters
    ----------
    index : float or None
        Harris's index in [0, 1]: variance of minimum variance control over the one measured; None
        where nobody can tell.
    index_error : float or None
        Two standard deviations of it.
    deviation_k, bound_k : float or None
        Standard deviation of the control error as measured, and under minimum variance control.
    ratio : float or None
        Their ratio, at least 1.
    limit : Limit
        What the rest is due to.
    verdict : str
        The same as a sentence; why not, where nobody can tell.
    """

    verdict: str
    limit: Limit = Limit.UNTOLD
    index: float | None = None
    index_error: float | None = None
    deviation_k: float | None = None
    bound_k: float | None = None
    ratio: float | None = None


@dataclass(frozen=True, slots=True)
class Insight:
    """What is told of one loop.

    Parameters
    ----------
    t_s : float
        Loop time of the last sample it rests on; NaN before the first.
    gate : Gate
        Whether there is anything to learn at present.
    rows : tuple of Row
        The plant in physical words, in the order in which they are shown.
    changes : tuple of Change
        The last ten, newest first.
    drifts : tuple of Drift
        Those that are active now.
    performance : Performance
        Against the bound.
    """

    t_s: float = math.nan
    gate: Gate = Gate.UNKNOWN
    rows: tuple[Row, ...] = ()
    changes: tuple[Change, ...] = ()
    drifts: tuple[Drift, ...] = ()
    performance: Performance = field(default_factory=lambda: Performance("collecting"))

    @property
    def verdict(self) -> str:
        """The one sentence to show where there is room for one."""
        return self.drifts[0].text if self.drifts else self.performance.verdict

    def as_json(self) -> Mapping[str, Any]:
        """Return the same as what JSON can hold; None for what is not known."""
        told: dict[str, Any] = _finite(asdict(self))
        return {**told, "verdict": self.verdict}


def _finite(value: Any) -> Any:
    """Return `value` without a number that is none."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(each) for each in value]
    return value
