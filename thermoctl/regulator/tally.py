"""The score between the controller in charge and the one in shadow.

Sums are kept a minute at a time, and a score is that of the last ten that are complete. So no sum
is ever counted down, and none can drift, however long a loop runs.
"""

from __future__ import annotations

import math
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
        sums = _with(self.current, played, self.before)
        if sums.span_s < ROW_S:
            return Tally(self.rows, sums, played, self.score)
        rows = (*self.rows, sums)[-ROWS:]
        return Tally(rows, NONE, played, _score(rows))


def _with(sums: Sums, played: Round, before: Round | None) -> Sums:
    """Return `sums` with one sample more; by unpacking, since looking up names takes longer."""
    span_s, apart_s, travel, shadow_travel, squares, samples, shadow_squares, shadow_samples = sums
    seen_s, given, shadow, e, shadow_e = played
    _, given_before, shadow_before, _, _ = played if before is None else before
    known, shadow_known = math.isfinite(e), math.isfinite(shadow_e)
    return Sums(
        span_s + seen_s,
        apart_s + abs(given - shadow) * seen_s,
        travel + abs(given - given_before),
        shadow_travel + abs(shadow - shadow_before),
        squares + (e * e if known else 0.0),
        samples + known,
        shadow_squares + (shadow_e * shadow_e if shadow_known else 0.0),
        shadow_samples + shadow_known,
    )


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
