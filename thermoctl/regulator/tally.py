"""The score between the controller in charge and the one in shadow.

Sums are kept a minute at a time, and a score is that of the last ten that are complete. So no sum
is ever counted down, and none can drift, however long a loop runs.
"""

from __future__ import annotations

import math
from operator import add
from typing import NamedTuple

from thermoctl.signals import ShadowScore

ROW_S = 60.0
ROWS = 10


class Round(NamedTuple):
    """One sample: how long it stands, both powers, both surprises in K or NaN."""

    seen_s: float
    given: float
    shadow: float
    surprise_k: float
    shadow_surprise_k: float


class Sums(NamedTuple):
    """What is added up over a row of samples; surprises as squares, and their number."""

    span_s: float = 0.0
    apart_s: float = 0.0
    travel: float = 0.0
    shadow_travel: float = 0.0
    squares: float = 0.0
    samples: float = 0.0
    shadow_squares: float = 0.0
    shadow_samples: float = 0.0


NONE = Sums()


class Tally(NamedTuple):
    """Rows of sums, the last of them still open.

    Parameters
    ----------
    rows : tuple of Sums
        Complete ones, oldest first, at most `ROWS`.
    current : Sums
        The row that is being filled.
    before : Round or None
        The sample before, None after a break: travel is counted between neighbours alone.
    score : ShadowScore or None
        Over `rows`; None while there is none.
    """

    rows: tuple[Sums, ...] = ()
    current: Sums = NONE
    before: Round | None = None
    score: ShadowScore | None = None

    def after(self, played: Round | None) -> Tally:
        """Return the tally after one more sample; None for one that does not count."""
        if played is None:
            return self if self.before is None else Tally(self.rows, self.current, None, self.score)
        sums = _added(self.current, _of(played, self.before))
        if sums.span_s < ROW_S:
            return Tally(self.rows, sums, played, self.score)
        rows = (*self.rows, sums)[-ROWS:]
        return Tally(rows, NONE, played, _score(rows))


def _of(played: Round, before: Round | None) -> Sums:
    """Return what one sample adds."""
    last = played if before is None else before
    e, shadow_e = played.surprise_k, played.shadow_surprise_k
    known, shadow_known = math.isfinite(e), math.isfinite(shadow_e)
    return Sums(
        played.seen_s,
        abs(played.given - played.shadow) * played.seen_s,
        abs(played.given - last.given),
        abs(played.shadow - last.shadow),
        e * e if known else 0.0,
        float(known),
        shadow_e * shadow_e if shadow_known else 0.0,
        float(shadow_known),
    )


def _added(one: Sums, other: Sums) -> Sums:
    return Sums(*map(add, one, other))


def _score(rows: tuple[Sums, ...]) -> ShadowScore:
    """Return the score of complete rows."""
    whole = Sums(*map(math.fsum, zip(*rows, strict=True)))
    per_min = 60.0 / whole.span_s
    return ShadowScore(
        span_s=whole.span_s,
        apart=whole.apart_s / whole.span_s,
        travel_per_min=whole.travel * per_min,
        shadow_travel_per_min=whole.shadow_travel * per_min,
        surprise_k=_rms(whole.squares, whole.samples),
        shadow_surprise_k=_rms(whole.shadow_squares, whole.shadow_samples),
    )


def _rms(squares: float, samples: float) -> float | None:
    return math.sqrt(squares / samples) if samples else None
