"""From results to figures: medians and quantiles, ratios to the bound, verdicts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from thermoctl.quantities import Array
from thermoctl.studies.compare.goals import GOALS, Goal, Statistic
from thermoctl.studies.compare.run import BOUND
from thermoctl.studies.compare.scenarios import SCENARIOS
from thermoctl.studies.compare.store import Result


@dataclass(frozen=True, slots=True)
class Score:
    """How a controller did in one measure over the plants of a fleet.

    Parameters
    ----------
    plain, ratio : mapping or None
        Statistics of the measure, and of its ratio to the bound of the same plant; infinite where
        it was never reached. None where there is no bound.
    runs, failed : int
        How many plants, and on how many the regulator gave up.
    passed : bool or None
        Whether every goal is met and nothing failed; None where there is no goal.
    """

    plain: Mapping[Statistic, float]
    ratio: Mapping[Statistic, float] | None
    runs: int
    failed: int
    passed: bool | None

    def shown(self, *, in_bounds: bool) -> Mapping[Statistic, float]:
        """Return the statistics of the ratio, or those of the measure itself."""
        return self.ratio if in_bounds and self.ratio is not None else self.plain


@dataclass(frozen=True, slots=True)
class Line:
    """One measure of one scenario on one fleet.

    Parameters
    ----------
    fleet, scenario, measure : str
        Names.
    bound : float or None
        Median of the bounds.
    goals : tuple of Goal
        What is to be met.
    scores : mapping
        By the name of the controller.
    """

    fleet: str
    scenario: str
    measure: str
    bound: float | None
    goals: tuple[Goal, ...]
    scores: Mapping[str, Score]

    @property
    def in_bounds(self) -> bool:
        """Whether it is shown as ratios: there is a bound, and no goal is plain."""
        return self.bound is not None and not any(goal.plain for goal in self.goals)


def summarise(results: Iterable[Result], controllers: Sequence[str]) -> list[Line]:
    """Return a line for every measure, in the order of the scenarios.

    Parameters
    ----------
    results : iterable of Result
        Runs and bounds.
    controllers : sequence of str
        Names, in the order in which they are shown.
    """
    found: dict[tuple[str, str], dict[str, dict[int, Result]]] = {}
    for each in results:
        runs = found.setdefault((each.fleet, each.scenario), {}).setdefault(each.controller, {})
        runs[each.seed] = each
    lines = []
    for (fleet, scenario), by_name in found.items():
        limits = by_name.get(BOUND, {})
        for measure in SCENARIOS[scenario].measures:
            goals = GOALS.get((fleet, scenario, measure), ())
            scores = {
                name: _score(by_name[name], limits, measure, goals)
                for name in controllers
                if name in by_name
            }
            known = [b for each in limits.values() if (b := each.measures.get(measure)) is not None]
            bound = float(np.median(known)) if known else None
            lines.append(Line(fleet, scenario, measure, bound, goals, scores))
    return lines


def _score(
    runs: Mapping[int, Result], limits: Mapping[int, Result], measure: str, goals: tuple[Goal, ...]
) -> Score:
    """Return the score of one controller; a plant without a bound counts in `plain` only."""
    values = {seed: _reached(run.measures.get(measure)) for seed, run in runs.items()}
    ratios = [
        value / bound
        for seed, value in values.items()
        if seed in limits and (bound := limits[seed].measures.get(measure))
    ]
    plain = _statistics(np.array(list(values.values())))
    ratio = _statistics(np.array(ratios)) if ratios else None
    failed = sum(run.failure is not None for run in runs.values())
    passed = None
    if goals:
        passed = not failed and all(_meets(goal, plain, ratio) for goal in goals)
    return Score(plain, ratio, len(runs), failed, passed)


def _meets(
    goal: Goal, plain: Mapping[Statistic, float], ratio: Mapping[Statistic, float] | None
) -> bool:
    """Return whether a goal is met."""
    judged = plain if goal.plain or ratio is None else ratio
    return judged[goal.statistic] <= goal.at_most


def _reached(value: float | None) -> float:
    """Return infinity for what was never reached: worse than any figure."""
    return math.inf if value is None else value


def _statistics(values: Array) -> dict[Statistic, float]:
    """Return the statistics of one figure; quantiles are figures that came, never between two.

    So the 95 % of few plants are the worst of them, and infinite figures stay apart.
    """
    ordered = np.sort(values)

    def quantile(part: float) -> float:
        return float(ordered[min(math.ceil(part * len(ordered)), len(ordered)) - 1])

    return {
        "median": float(np.median(ordered)),
        "mean": float(np.mean(ordered)),
        "p90": quantile(0.90),
        "p95": quantile(0.95),
        "max": float(ordered[-1]),
    }
