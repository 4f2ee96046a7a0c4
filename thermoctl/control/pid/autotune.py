"""A test that is bounded in time, and what becomes of it.

Implements section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

from thermoctl.control.pid.simc import Gains
from thermoctl.ports import Situation

FORGOTTEN_S, FORGOTTEN_PERIODS = 30.0, 5.0
"""Time in s and in periods, the longer of the two, of somebody else steering after which a test is
forgotten."""


@dataclass(frozen=True, slots=True)
class Found:
    """What a test has come to.

    Parameters
    ----------
    gains : Gains
        The gains to steer with from now on.
    text : str
        What they were taken from.
    slope_k_per_s : float
        Rise at full power.
    holding_power : float
        Power to go on with where there is no error; 0 where that was not seen.
    """

    gains: Gains
    text: str
    slope_k_per_s: float
    holding_power: float = 0.0


@dataclass(frozen=True, slots=True)
class GivenUp:
    """A test that came to nothing, and why."""

    text: str


class Experiment(Protocol):
    """A test of the plant: frozen; how far it has come goes in and comes out."""

    def begin(self, situation: Situation) -> Any:
        """Return the test, begun at this sample; None where it cannot begin."""
        ...

    def observe(self, run: Any, situation: Situation) -> Any:
        """Return the test after one more sample, whoever steered."""
        ...

    def decide(self, run: Any, situation: Situation) -> tuple[Any, float] | Found | GivenUp:
        """Return the test and the power it asks for, or what it has come to."""
        ...


@dataclass(frozen=True, slots=True)
class Tuning:
    """How far tuning has come.

    Parameters
    ----------
    run : object
        A test under way, None without one.
    elapsed_s : float
        Since it began.
    idle_s : float
        Since it last had its power.
    outcome : Found or GivenUp or None
        What it came to; there is no other test after that.
    """

    run: Any = None
    elapsed_s: float = 0.0
    idle_s: float = 0.0
    outcome: Found | GivenUp | None = None


@dataclass(frozen=True, slots=True)
class AutoTune:
    """Runs a test once, the first time it can begin.

    Parameters
    ----------
    test : Experiment
        The test.
    most_s : float
        How long it may last.
    period_s : float
        Time between two samples.
    """

    test: Experiment
    most_s: float
    period_s: float

    def observe(self, tuning: Tuning, situation: Situation) -> Tuning:
        """Return the tuning after this sample, whoever steers."""
        if tuning.run is None:
            return tuning
        idle_s = tuning.idle_s + situation.interval_s
        if idle_s > max(FORGOTTEN_S, FORGOTTEN_PERIODS * self.period_s):
            return Tuning()
        elapsed_s = tuning.elapsed_s + situation.interval_s
        run = self.test.observe(tuning.run, situation)
        return Tuning(run, elapsed_s, idle_s)

    def decide(self, tuning: Tuning, situation: Situation) -> tuple[Tuning, float | None]:
        """Return the tuning and the power its test asks for; None: the law may steer."""
        if tuning.outcome is not None:
            return tuning, None
        run = tuning.run
        if run is None:
            run = self.test.begin(situation)
            if run is None:
                return tuning, None
            tuning = Tuning(run)
        if tuning.elapsed_s > self.most_s:
            return Tuning(outcome=GivenUp(f"not finished within {self.most_s:g} s")), None
        told = self.test.decide(run, situation)
        if isinstance(told, Found | GivenUp):
            return Tuning(outcome=told), None
        after, power = told
        return replace(tuning, run=after, idle_s=0.0), power
