"""A test signal that stays within a band of temperatures.

Two powers take turns, each held for a time drawn at random between a few periods and a fifteenth of
the run: short ones show the lag, long ones the gain and the loss. What the temperature does comes
first: at an edge of the band the signal waits until the middle is reached again.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

SHORTEST_PERIODS = 2.0
"""Periods a power is held at least."""

LONGEST_SHARE = 1.0 / 15.0
"""Share of the whole run for which a power is held at most."""

SPAN = 16.0
"""The longest time over the shortest, unless that were less than `SHORTEST_PERIODS`."""


@dataclass(frozen=True, slots=True)
class Course:
    """How far a test signal has come.

    Parameters
    ----------
    begun_s : float
        When the signal began; NaN while the band is approached.
    forced : float or None
        Power an edge of the band demands, until the middle is reached.
    """

    begun_s: float = math.nan
    forced: float | None = None

    @property
    def approaching(self) -> bool:
        """Whether the band has not been reached yet."""
        return math.isnan(self.begun_s)


@dataclass(frozen=True)
class Excitation:
    """The plan of a test signal; it never changes.

    Parameters
    ----------
    low, high : float
        The two powers, 0 <= low < high <= 1.
    bottom_c, top_c : float
        Edges of the band, in degC.
    duration_s : float
        Length of the whole run, approach included.
    period_s : float
        Time between two samples.
    early_k : float
        How far below the top the power falls already: what a period more at high power adds, since
        what a reading asks for takes effect with the next one.
    seed : int
        Seed of the times.

    Raises
    ------
    ValueError
        An argument is outside its range, or the band too narrow for `early_k`.
    """

    low: float
    high: float
    bottom_c: float
    top_c: float
    duration_s: float
    period_s: float = 1.0
    early_k: float = 0.0
    seed: int = 1

    def __post_init__(self) -> None:
        if not 0.0 <= self.low < self.high <= 1.0:
            raise ValueError(
                f"expected powers with 0 <= low < high <= 1, got {self.low:g} and {self.high:g}"
            )
        if not -math.inf < self.bottom_c < self.top_c < math.inf:
            raise ValueError(
                f"expected a band of temperatures, got {self.bottom_c:g} to {self.top_c:g} degC"
            )
        if not 0.0 < self.period_s < self.duration_s < math.inf:
            raise ValueError(
                f"expected a duration longer than a period of {self.period_s:g} s,"
                f" got {self.duration_s:g} s"
            )
        if not 0.0 <= self.early_k < 0.5 * (self.top_c - self.bottom_c):
            raise ValueError(
                f"expected a band wider than {2.0 * self.early_k:.2g} K, twice the rise in a"
                f" period, got {self.top_c - self.bottom_c:g} K"
            )

    @property
    def middle_c(self) -> float:
        """Middle of the band, in degC."""
        return 0.5 * (self.bottom_c + self.top_c)

    @property
    def holds_s(self) -> tuple[float, float]:
        """Shortest and longest time for which a power is held, in s."""
        shortest = SHORTEST_PERIODS * self.period_s
        longest = max(LONGEST_SHARE * self.duration_s, 2.0 * shortest)
        return max(shortest, longest / SPAN), longest

    @cached_property
    def switches_s(self) -> tuple[float, ...]:
        """When the power changes, in s from the beginning of the signal; it begins low."""
        random = np.random.default_rng(self.seed)
        low, high = (math.log(each) for each in self.holds_s)
        times = [0.0]
        while times[-1] < self.duration_s:
            times.append(times[-1] + math.exp(random.uniform(low, high)))
        return tuple(times[1:])

    def after(
        self, course: Course, t_s: float, temperature_c: float, under_way_k: float = 0.0
    ) -> tuple[Course, float]:
        """Return how far the signal has come, and the power for the next period.

        Parameters
        ----------
        course : Course
            As the last call returned it; ``Course()`` for the first one.
        t_s : float
            Time of the reading, in s.
        temperature_c : float
            The reading, in degC; NaN where there is none: the power is low then.
        under_way_k : float
            By how much heat that was given will still raise it, in K, as far as anybody knows.
        """
        if not math.isfinite(temperature_c):
            return course, self.low
        coming_c = temperature_c + max(under_way_k, 0.0)
        at_top = coming_c >= self.top_c - self.early_k
        if course.approaching:
            if temperature_c < self.middle_c and not at_top:
                return course, self.high
            course = Course(t_s)
        forced = course.forced
        if at_top:
            forced = self.low
        elif coming_c <= self.bottom_c:
            forced = self.high
        elif (forced == self.low and coming_c <= self.middle_c) or (
            forced == self.high and coming_c >= self.middle_c
        ):
            forced = None
        switches = bisect_right(self.switches_s, t_s - course.begun_s)
        level = self.high if switches % 2 else self.low
        return replace(course, forced=forced), level if forced is None else forced
