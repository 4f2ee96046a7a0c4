"""The simulation study of O21: which estimators follow a parameter that jumps.

The paper shows one run in its Figures 1 to 18; here the first replication stands for it, and all of
them for the table.

Implements section 2 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np

from thermoctl.estimation import run_batch
from thermoctl.estimation.batch import Run
from thermoctl.estimation.recursion import ARRAYS
from thermoctl.quantities import Array
from thermoctl.studies.papers.ozbek2021_figure import draw_ozbek2021
from thermoctl.studies.papers.ozbek2021_methods import METHODS, P0, POLE, SAMPLES, Method, outputs
from thermoctl.studies.papers.study import (
    Batched,
    Column,
    Outcome,
    Row,
    generator,
)


@dataclass(frozen=True, slots=True)
class Ozbek2021(Batched):
    """Seven estimators on the simulation of O21 (24).

    Parameters
    ----------
    replications : int
        Independent runs, at least 1.
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

    title: ClassVar[str] = "O21 (24): a parameter that jumps after samples 100 and 200"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("method", "\nmethod"),
        Column("mse", "mean square\nerror of a", ".4f"),
        Column("mse_1_100", "\n1 to 100", ".4f"),
        Column("mse_101_200", "\n101 to 200", ".4f"),
        Column("mse_201_400", "\n201 to 400", ".4f"),
        Column("final_P_median", "last P,\nmedian", ".5f"),
        Column("residual_variance", "variance of\nresiduals", ".3f"),
    )

    def run(self) -> Iterator[Outcome]:
        """Yield what is known after each batch of replications, at last the whole."""
        scores = np.empty((len(METHODS), self.replications, len(_SCORES)))
        figures: dict[str, dict[str, Any]] = {}
        for begin in range(0, self.replications, self.batch):
            end = min(begin + self.batch, self.replications)
            y = outputs([generator(self.seed, r).normal(size=SAMPLES) for r in range(begin, end)])
            for place, method in enumerate(METHODS):
                run = run_batch(method.law, y[1:], y[:-1, :, None], P0=P0)
                scores[place, begin:end] = scores_of(run)
                if begin == 0:
                    figures |= _figures(method, run, y[:-1, 0])
            yield Outcome(end, _table(scores[:, :end]), _in_order(figures))

    def draw(self, outcome: Outcome, files: Sequence[Path]) -> list[Path]:
        """Draw the page of the paper's figures into `files` and return what was written."""
        return draw_ozbek2021(outcome, self.columns, self.seed, files)


_WINDOWS: Final = {
    "mse": slice(0, SAMPLES),
    "mse_1_100": slice(0, 100),
    "mse_101_200": slice(100, 200),
    "mse_201_400": slice(200, 400),
}
_SCORES: Final = (*_WINDOWS, "final_P_median", "residual_variance")


def scores_of(run: Run) -> Array:
    """Return how well each replication went, shape (R, 6), in the order of the table.

    The mean square error of a over all samples and over its three stretches, the last P, and the
    mean square of the innovations ``y(t) - a(t-1) y(t-1)``, those before the update, over all
    samples. The first one, -9 on average because y(0) = 10 finds theta = 0, is among them.
    """
    # A row for each replication: its sum is then the same whatever stands beside it.
    square = np.ascontiguousarray((run.theta[:, :, 0] - POLE[:, None]).T ** 2)
    residuals = np.ascontiguousarray(run.innovation.T)
    errors = [square[:, window].mean(axis=1) for window in _WINDOWS.values()]
    return np.stack([*errors, run.P[-1, :, 0, 0], (residuals**2).mean(axis=1)], axis=1)


def _table(scores: Array) -> list[Row]:
    """Return the rows, from scores of shape (methods, R, 6)."""
    values = scores.mean(axis=1)
    place = _SCORES.index("final_P_median")
    values[:, place] = np.median(scores[:, :, place], axis=1)
    return [
        {"method": method.name, **dict(zip(_SCORES, row.tolist(), strict=True))}
        for method, row in zip(METHODS, values, strict=True)
    ]


def _figures(method: Method, run: Run, phi: Array) -> dict[str, dict[str, Any]]:
    """Return the three figures of `method`: the first replication of `run`, with regressors phi."""
    if method.figures is None:
        return {}
    theta, P, e = run.theta[:, 0, 0], run.P[:, 0, 0, 0], run.innovation[:, 0]
    before = np.concatenate(((P0,), P[:-1]))
    S, _ = method.law.weigh(phi * before * phi, e, 1, ARRAYS)
    estimate, variance, residuals = map(str, method.figures)
    return {
        estimate: _figure(f"Estimate of a, {method.name}", theta, true=POLE, sd=np.sqrt(P)),
        variance: _figure(f"P, {method.name}", P),
        residuals: _figure(f"Residuals, {method.name}", e, sd=np.sqrt(S)),
    }


def _figure(title: str, values: Array, **more: Array) -> dict[str, Any]:
    """Return a figure's numbers as JSON has them."""
    t = list(range(1, SAMPLES + 1))
    lists = {key: each.tolist() for key, each in more.items()}
    return {"title": title, "t": t, "values": values.tolist(), **lists}


def _in_order(figures: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the figures by their number."""
    return {number: figures[number] for number in sorted(figures, key=int)}
