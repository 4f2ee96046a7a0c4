"""A converter that repeats itself, told from one with coarse steps."""

from __future__ import annotations

import math

_SURE = 30.0  # exponent of the odds against a run of equal readings


class StuckSensor:
    """Tells a converter that stands still from one with coarse steps.

    Noise beyond a step makes readings turn back all the time, up and down; a drift through the
    steps of a quiet converter does not. Where it lies between two steps, its readings turn back as
    well, but they know these two values alone. Where many turn back, and go beyond two values, a
    run of equal readings is judged by the share of those that equal the one before: next to
    impossible is a converter that stands.
    """

    LEAST = 10
    KNOWN_AFTER = 200
    MEMORY = 1 / 500
    TURNS_MIN = 0.4
    """Least share of readings that turn back, for equal ones in a row to prove anything. In pure
    noise two thirds do; with fewer the noise is below a step."""
    BEYOND_MIN = 0.1
    """Least share of readings that turn back, or come after one that does, and reach a third value:
    neither the one before nor the last one that differed from it. Where noise is a step half do."""
    MORE, AND = 1.3, 0.02
    """The expected share of equal readings is MORE times the usual one plus AND: it depends on
    where the reading lies between two steps."""

    def __init__(self) -> None:
        self._last_c = self._before_c = math.nan
        self._moved_k = 0.0
        self._run = self._seen = 0
        self._equal = self._turns = self._beyond = 0.0
        self._turned = False

    def observe(self, reading_c: float) -> bool:
        """Return whether the converter stands still; NaN is no reading, and says nothing."""
        if reading_c == self._last_c:
            self._run += 1
            return self._stands()
        if reading_c == reading_c:
            moved_k = reading_c - self._last_c
            if self._run < self.LEAST or not self._stands():  # a run that was a fault says nothing
                self._learn(moved_k * self._moved_k < 0.0, third=reading_c != self._before_c)
            self._before_c, self._last_c = self._last_c, reading_c
            self._moved_k, self._run = moved_k, 0
        return False

    @property
    def run(self) -> int:
        """How many readings in a row have equalled the one before."""
        return self._run

    def told(self) -> str:
        """Return what was expected, and what came."""
        return f"expected readings that differ, got {self.run + 1} equal ones in a row"

    def _learn(self, turned: bool, *, third: bool) -> None:
        """Learn from a reading that moved, and from the equal ones before it."""
        count = self._run + 1
        self._seen += count
        newest = 1.0 / self._seen
        share = (newest if newest > self.MEMORY else self.MEMORY) * count
        share = share if share < 1.0 else 1.0
        self._equal += share * (self._run / count - self._equal)
        beyond = third and (turned or self._turned)  # on its way through the steps it never turns
        self._turns += share * (turned / count - self._turns)
        self._beyond += share * (beyond / count - self._beyond)
        self._turned = turned

    def _stands(self) -> bool:
        """Return whether the run is too long for a converter that is alive."""
        if self._run < self.LEAST:  # nearly always
            return False
        known = self._seen >= self.KNOWN_AFTER and self._turns >= self.TURNS_MIN
        known = known and self._beyond >= self.BEYOND_MIN
        odds = -math.log(min(self.MORE * self._equal + self.AND, 0.99))
        return known and self._run >= math.ceil(_SURE / odds)
