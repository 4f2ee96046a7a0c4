"""The score between the controller in charge and the one in shadow.

Sums are kept a minute at a time, and a score is that of the last ten that are complete. So no sum
is ever counted down, and none can drift, however long a loop runs.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from thermoctl.signals import ShadowScore

ROW_S = 60.0
ROWS = 10


class Sums(NamedTuple):
    """What is added up over a row of samples; surprises as squares, and their number."""

    span_s: float
    apart_s: float
    travel: float
    shadow_travel: float
    squares: float
    samples: float
    shadow_squares: float
    shadow_samples: float


class Tally:
    """Rows of sums, the last of them still open.

    Attributes
    ----------
    score : ShadowScore or None
        Over the last complete rows, at most `ROWS`; None while there is none.
    """

    def __init__(self) -> None:
        self.score: ShadowScore | None = None
        self._rows: deque[Sums] = deque(maxlen=ROWS)
        self._given = self._shadow = math.nan  # of the sample before
        self._open_row()

    def _open_row(self) -> None:
        self._span_s = self._apart_s = self._travel = self._shadow_travel = 0.0
        self._squares = self._samples = self._shadow_squares = self._shadow_samples = 0.0

    def pause(self) -> None:
        """Leave a sample out: travel is that between neighbours alone."""
        self._given = self._shadow = math.nan

    def add(
        self,
        seen_s: float,
        given: float,
        shadow: float,
        surprise_k: float,
        shadow_surprise_k: float,
    ) -> None:
        """Add a sample: how long it stands, both powers, both surprises in K or NaN."""
        self._span_s += seen_s
        self._apart_s += abs(given - shadow) * seen_s
        if self._given == self._given:  # nearly always, and faster than to ask for NaN
            self._travel += abs(given - self._given)
            self._shadow_travel += abs(shadow - self._shadow)
        self._given, self._shadow = given, shadow
        if math.isfinite(surprise_k):
            self._squares += surprise_k * surprise_k
            self._samples += 1.0
        if math.isfinite(shadow_surprise_k):
            self._shadow_squares += shadow_surprise_k * shadow_surprise_k
            self._shadow_samples += 1.0
        if self._span_s >= ROW_S:
            self._close_row()

    def _close_row(self) -> None:
        self._rows.append(
            Sums(
                self._span_s,
                self._apart_s,
                self._travel,
                self._shadow_travel,
                self._squares,
                self._samples,
                self._shadow_squares,
                self._shadow_samples,
            )
        )
        self._open_row()
        self.score = _score(self._rows)


def _score(rows: Iterable[Sums]) -> ShadowScore:
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
