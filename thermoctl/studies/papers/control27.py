"""The study of O21 (27): which estimators hold a plant that changes.

The paper closes this loop around an aquarium and shows one run. Here the plant is the model itself,
so that nothing but the estimator decides, and a law that knows a has no more than the noise.

Implements section 5 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np

from thermoctl.quantities import Array
from thermoctl.studies.papers.control27_figure import draw_control27
from thermoctl.studies.papers.control27_loop import (
    METHODS,
    NOISE_K,
    SAMPLES,
    SCENARIOS,
    Loop,
    Scenario,
    close_loop,
)
from thermoctl.studies.papers.study import (
    Batched,
    Column,
    Outcome,
    Row,
    generator,
)

SCORED_FROM: Final = 20
"""First sample that counts: before, a is still being found from nothing."""

DRAWN: Final = ("CKF", "NKF, R1 = 0")
"""Methods that are drawn."""

_SCORES: Final = ("mse", "bias", "input_travel", "largest", "mse_a")


@dataclass(frozen=True, slots=True)
class Control27(Batched):
    """Eight ways to know a in the loop of O21 (27), over five plants.

    Parameters
    ----------
    replications : int
        Independent runs, at least 1; one run has the same noise in every scenario and method.
    seed : int
        Of all noise, at least 0.
    batch : int
        Replications computed together, at least 1; it changes nothing but the time taken.

    Raises
    ------
    ValueError
        `replications` or `batch` is no integer of at least 1, or `seed` none of at least 0.
    """

    replications: int = 1000

    title: ClassVar[str] = "O21 (27): a temperature held by minimum variance while a(t) changes"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("scenario", "\nscenario"),
        Column("method", "\nmethod"),
        Column("mse", "mean square\ndeviation, K²", ".4f"),
        Column("bias", "mean\ndeviation, K", "z.3f"),
        Column("input_travel", "travel of the input,\nK a sample", ".3f"),
        Column("largest", "largest\ndeviation, K", ".2f"),
        Column("mse_a", "mean square\nerror of a", ".1e"),
    )

    def run(self) -> Iterator[Outcome]:
        """Yield what is known after each batch of replications, at last the whole."""
        scores = np.empty((len(SCENARIOS), len(METHODS), self.replications, len(_SCORES)))
        figures: dict[str, dict[str, Any]] = {}
        for begin in range(0, self.replications, self.batch):
            end = min(begin + self.batch, self.replications)
            drawn = [generator(self.seed, r).normal(size=SAMPLES) for r in range(begin, end)]
            noise = NOISE_K * np.stack(drawn, axis=1)
            for i, scenario in enumerate(SCENARIOS):
                loops = {method.name: close_loop(method.law, scenario, noise) for method in METHODS}
                for j, loop in enumerate(loops.values()):
                    scores[i, j, begin:end] = scores_of(loop, scenario)
                if begin == 0:
                    figures |= _figures(scenario, {name: loops[name] for name in DRAWN})
            yield Outcome(end, _table(scores[:, :, :end]), figures)

    def draw(self, outcome: Outcome, files: Sequence[Path]) -> list[Path]:
        """Draw parameter, output and input of every scenario into `files`, on one page."""
        return draw_control27(outcome, self.seed, files)


def scores_of(loop: Loop, scenario: Scenario) -> Array:
    """Return how well each replication went, shape (R, 5), in the order of the table.

    Of the deviations y(t) - y*(t) from `SCORED_FROM` on: mean square, mean, and largest size;
    between them the mean size of a step of the input; at last the mean square error of a.
    """
    # A row for each replication: its sum is then the same whatever stands beside it.
    first = SCORED_FROM - 1
    deviation = np.ascontiguousarray((loop.output - loop.reference[:, None])[first:].T)
    steps = np.ascontiguousarray(np.diff(loop.input[first:], axis=0).T)
    error = np.ascontiguousarray((loop.a - scenario.pole[:, None])[first:].T)
    means = [(deviation**2).mean(axis=1), deviation.mean(axis=1), np.abs(steps).mean(axis=1)]
    means += [np.abs(deviation).max(axis=1), (error**2).mean(axis=1)]
    return np.stack(means, axis=1)


def _table(scores: Array) -> list[Row]:
    """Return the rows, from scores of shape (scenarios, methods, R, 5)."""
    means = scores.mean(axis=2)
    rows: list[Row] = []
    for i, scenario in enumerate(SCENARIOS):
        for j, method in enumerate(METHODS):
            row = dict(zip(_SCORES, means[i, j].tolist(), strict=True))
            known = {"mse_a": None} if method.law is None else {}
            rows.append({"scenario": scenario.name, "method": method.name, **row, **known})
    return rows


def _figures(scenario: Scenario, loops: dict[str, Loop]) -> dict[str, dict[str, Any]]:
    """Return the three figures of `scenario`, from the first replication of `loops`."""
    t = {"t": list(range(SCORED_FROM, SAMPLES + 1))}
    first = SCORED_FROM - 1

    def lines(name: str) -> dict[str, list[float]]:
        return {each: getattr(loop, name)[first:, 0].tolist() for each, loop in loops.items()}

    sd = {each: np.sqrt(loop.P[first:, 0]).tolist() for each, loop in loops.items()}
    head = f"Scenario {scenario.name}: "
    true = {"true": scenario.pole[first:].tolist()}
    reference = {"reference": scenario.setpoint[first:].tolist()}
    return {
        f"{scenario.name}, parameter": {
            "title": head + "a(t) and its estimate",
            **t,
            **true,
            "values": lines("a"),
            "sd": sd,
        },
        f"{scenario.name}, output": {
            "title": head + "output y(t) in °C",
            **t,
            **reference,
            "values": lines("output"),
        },
        f"{scenario.name}, input": {
            "title": head + "input u(t-1) in K a sample",
            **t,
            "values": lines("input"),
        },
    }
