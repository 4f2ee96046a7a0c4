r"""The compartment study of BO17: filters that were told the wrong rates.

A drug passes from the gut into the blood. Filters that see only the blood, and believe in other
rates and another dose, are to know both amounts. The study is repeated with a model that is right,
which the paper does not do. Implements the study of section 7 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np

from thermoctl.estimation import LinearModel, MatrixFading, MultipleFading, StateKalman
from thermoctl.estimation.state_space import StateLaw
from thermoctl.quantities import Array
from thermoctl.studies.papers.bicer2017_figure import draw_page
from thermoctl.studies.papers.study import (
    Column,
    Outcome,
    Repeated,
    Row,
    generator,
)

PERIOD: Final = 0.1
"""Delta of (34), in the unit of time of the rates."""

CHANGE: Final = 37
"""The last k whose step has the old rates: x(39) is the first state to come from the new ones."""

KALMAN: Final = "Kalman filter"
FILTER_1: Final = "Filter 1"
FILTER_2: Final = "Filter 2, as printed"

BATCH: Final = 5
"""Replications between two outcomes, a little less than a second of them."""


def transition(c1: float, c2: float) -> Array:
    """Return the matrix of (34), shape (2, 2), for the rates of gut and blood."""
    gut, blood = c1 * PERIOD, c2 * PERIOD
    return np.array([[1.0 - gut, 0.0], [gut, 1.0 - blood]])  # BO17 (34)


class Track(NamedTuple):
    """How one filter followed one plant through K samples."""

    error: Array
    """x(k) less its estimate x(k|k), shape (K, 2)."""
    fading: Array
    """Factors s1 and s2, shape (K, 2)."""


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """A plant with noise, and the laws that are to follow it from its blood alone.

    Parameters
    ----------
    transitions : ndarray, shape (K, 2, 2)
        From x(k-1) to x(k), for k = 1 to K.
    Q, R : float
        Variances of the noise of either state and of the observation.
    x0, x0_sd : float
        Mean and standard deviation of either state at k = 0.
    laws : mapping
        The filters under their names; all start from `believed_x0` with P0 = I.
    believed_x0 : float
        Where they believe either state to be at k = 0.
    """

    transitions: Array
    Q: float
    R: float
    x0: float
    x0_sd: float
    laws: Mapping[str, StateLaw]
    believed_x0: float = 7.0

    def replicate(self, rng: np.random.Generator) -> dict[str, Track]:
        """Return what each law makes of one run of the plant."""
        states, observations = self.simulate(rng)
        return {name: self._follow(law, states, observations) for name, law in self.laws.items()}

    def simulate(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return x(1) to x(K), shape (K, 2), and what is seen of them, shape (K,)."""
        x = self.x0 + self.x0_sd * rng.standard_normal(2)
        states = np.empty((len(self.transitions), 2))
        for k, F in enumerate(self.transitions):
            x = F @ x + math.sqrt(self.Q) * rng.standard_normal(2)  # BO17 (34)
            states[k] = x
        noise = math.sqrt(self.R) * rng.standard_normal(len(states))
        return states, states[:, 1] + noise  # BO17 (35)

    def _follow(self, law: StateLaw, states: Array, observations: Array) -> Track:
        """Return the track of one law."""
        belief = law.start(np.full(2, self.believed_x0), 1.0)
        estimates, fading = np.empty_like(states), np.empty_like(states)
        for k, z in enumerate(observations):
            belief = law.update(belief, z)
            estimates[k], fading[k] = belief.x, belief.fading
        return Track(states - estimates, fading)


def _assumed(Q: float, R: float) -> LinearModel:
    """Return the model the filters take for true: only the blood is observed, (35)."""
    H = np.array([[0.0, 1.0]])  # BO17 (35)
    return LinearModel(transition(0.7, 0.3), H, Q * np.eye(2), R * np.eye(1))


def as_printed(model: LinearModel) -> MatrixFading:
    """Return Filter 2 with the search of the paper: plain steps, without bounds."""
    return MatrixFading(
        model, normalised=False, max_iterations=1000, s_min=-math.inf, s_max=math.inf
    )


def table_1() -> Scenario:
    """Return the study of the paper, its Table 1."""
    rates = [(0.9, 0.1) if k <= CHANGE else (0.6, 0.4) for k in range(100)]
    model = _assumed(Q=1e-5, R=1e-2)
    laws: dict[str, StateLaw] = {
        KALMAN: StateKalman(model),
        FILTER_1: MultipleFading(model),
        FILTER_2: as_printed(model),
        "Filter 2, default settings": MatrixFading(model),
        "Filter 2, factors from 0.2": MatrixFading(model, s_min=0.2),
        "Filter 2, factors from 0.5": MatrixFading(model, s_min=0.5),
    }
    return Scenario(np.array([transition(*pair) for pair in rates]), 1e-9, 1e-6, 10.0, 0.0, laws)


def exact_model() -> Scenario:
    """Return the same plant with laws that know it, and a start that P0 describes."""
    model = _assumed(Q=1e-3, R=1e-2)
    laws: dict[str, StateLaw] = {
        KALMAN: StateKalman(model),
        FILTER_1: MultipleFading(model),
        "Filter 2, gated, from 0.5": MatrixFading(model, gate=3.841, s_min=0.5),
        FILTER_2: as_printed(model),
        "Filter 2, default settings": MatrixFading(model),
    }
    return Scenario(np.array([model.F] * 200), 1e-3, 1e-2, 7.0, 1.0, laws)


@dataclass(slots=True, eq=False)
class Totals:
    """Sums over the replications of one law, in the order they came."""

    error: Array | float = 0.0
    fading: Array | float = 0.0
    squares: Array | float = 0.0
    runs: list[float] = field(default_factory=list)
    """Squared error of both states in every run, mean over the samples."""

    def add(self, track: Track) -> None:
        """Take one more replication into account."""
        self.error = self.error + track.error
        self.fading = self.fading + track.fading
        squares = (track.error**2).sum(axis=1)
        self.squares = self.squares + squares
        self.runs.append(float(squares.mean()))

    def mean(self, name: str) -> Array:
        """Return the mean of a field over the replications."""
        return np.asarray(getattr(self, name)) / len(self.runs)


@dataclass(frozen=True, slots=True)
class Bicer2017(Repeated):
    """The compartment study of BO17, and what becomes of it with an exact model.

    Parameters
    ----------
    replications : int
        Runs of the plant, at least 1. The paper has 1,000; what decides here is the wrong model,
        and the noise moves the sums by less than one part in a thousand from run to run.
    seed : int
        Seed of the noise, at least 0.

    Raises
    ------
    ValueError
        A setting is out of its range.
    """

    title: ClassVar[str] = "BO17: compartments with a wrong model, k = 1 to 100"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("method", "filter"),
        Column("hkt", "sum of squared errors", ".2f"),
    )
    replications: int = 100

    def run(self) -> Iterator[Outcome]:
        """Yield what is known after each batch of replications; the last is the whole."""
        scenarios = table_1(), exact_model()
        wrong, exact = ({name: Totals() for name in each.laws} for each in scenarios)
        for replication in range(self.replications):
            rng = generator(self.seed, replication)
            for scenario, totals in zip(scenarios, (wrong, exact), strict=True):
                for name, track in scenario.replicate(rng).items():
                    totals[name].add(track)
            finished = replication + 1
            if finished % BATCH == 0 or finished == self.replications:
                yield Outcome(finished, _table(wrong), _figures(wrong, exact))

    def draw(self, outcome: Outcome, files: Sequence[Path]) -> list[Path]:
        """Draw the page of the paper's figures into `files` and return what was written."""
        return draw_page(outcome, self.title, files)


def _table(wrong: Mapping[str, Totals]) -> list[Row]:
    """Return the sum of squared errors of every law; HKT in the paper."""
    return [
        {"method": name, "hkt": float(totals.mean("squares").sum())}
        for name, totals in wrong.items()
    ]


def _figures(wrong: Mapping[str, Totals], exact: Mapping[str, Totals]) -> dict[str, dict[str, Any]]:
    """Return the figures of the paper, means over the replications, and the exact model's."""
    shown = (KALMAN, FILTER_1, FILTER_2)
    error = {name: wrong[name].mean("error") for name in shown}
    sums = {name: np.cumsum(totals.mean("squares")) for name, totals in wrong.items()}
    return {
        "1": _curves("error in compartment 1", {name: error[name][:, 0] for name in shown}),
        "2": _curves("error in compartment 2", {name: error[name][:, 1] for name in shown}),
        "3": _factors("factors of Filter 1", wrong[FILTER_1]),
        "4": _factors("factors of Filter 2, as printed", wrong[FILTER_2]),
        "5": _curves("sum of squared errors up to k", sums),
        "exact model": {
            "title": "squared error of both states, mean over samples, where the model is right",
            "samples": 200,
            "rows": [_exact_row(name, totals.runs) for name, totals in exact.items()],
        },
    }


def _curves(title: str, values: Mapping[str, Array]) -> dict[str, Any]:
    """Return a figure of lines over k."""
    lines = {name: line.tolist() for name, line in values.items()}
    k = list(range(1, 1 + max(map(len, lines.values()))))
    return {"title": title, "k": k, "jump_after": CHANGE + 1, "values": lines}


def _factors(title: str, totals: Totals) -> dict[str, Any]:
    """Return the figure of the factors of one law."""
    s = totals.mean("fading")
    return _curves(title, {"s1": s[:, 0], "s2": s[:, 1]})


def _exact_row(method: str, runs: Sequence[float]) -> dict[str, Any]:
    """Return the mean over `runs` and its standard error, None from a single one."""
    spread = float(np.std(runs, ddof=1)) / math.sqrt(len(runs)) if len(runs) > 1 else None
    return {"method": method, "mse": float(np.mean(runs)), "standard_error": spread}
