"""How fast a Lainiotis bank finds order and delay, and what keeps it from it.

ALF prints no example, so these are ours: plants of second order, with an input and without, and a
bank told the truth about everything but the structure, or a wrong noise, or a narrow prior. Every
case meets the same noise and the same input. Implements the study of section 8 of
``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np

from thermoctl.estimation import LainiotisBank, Order
from thermoctl.estimation.identifier import pushed
from thermoctl.quantities import Array
from thermoctl.studies.papers.lainiotis_figure import draw_page
from thermoctl.studies.papers.study import (
    Column,
    Outcome,
    Repeated,
    Row,
    generator,
)

SAMPLES: Final = 300
"""Samples in a run."""

DECIDED: Final = 0.95
"""Probability at which a hypothesis counts as found."""

SPREAD: Final = "samples to 95 %"
"""Key of the figure that shows how the samples to a decision are distributed."""

BATCH: Final = 5
"""Replications between two outcomes, a little less than a second of them.

Later a fiftieth of all that are finished: an outcome orders all of them anew, and would otherwise
take longer and longer parts of the time.
"""


@dataclass(frozen=True, slots=True)
class Plant:
    """An ARX plant at rest, driven by noise and, where it has an input, by that.

    Parameters
    ----------
    order : Order
        Its structure.
    theta : tuple of float
        Its coefficients a, then b, in the sign of O21 (1).
    noise_sd : float
        Standard deviation of its noise.
    """

    order: Order
    theta: tuple[float, ...]
    noise_sd: float

    def outputs(self, u: Array, v: Array) -> Array:
        """Return y(1) to y(T) from the inputs ``u[t]`` before them and white noise `v`."""
        structure, theta = self.order.structure(), np.array(self.theta)
        y_past, u_past = np.zeros(structure.y_memory), np.zeros(structure.u_memory)
        y = np.empty(len(v))
        for t in range(len(v)):
            u_past = pushed(u_past, float(u[t]))
            phi = structure.regressor(y_past, u_past)
            y[t] = float(phi @ theta) + self.noise_sd * v[t]  # O21 (1)
            y_past = pushed(y_past, float(y[t]))
        return y


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A plant, and the bank that is to find out its structure.

    Parameters
    ----------
    name : str
        As it stands in the table.
    plant : Plant
        What is to be found out.
    bank : LainiotisBank
        Before its first sample; the order of the plant is one of its candidates.
    hypothesis : str
        How a candidate is called, with n, m and delay in braces.
    """

    name: str
    plant: Plant
    bank: LainiotisBank
    hypothesis: str

    @property
    def truth(self) -> int:
        """Place of the true candidate."""
        return list(self.bank.candidates).index(self.plant.order)

    def posteriors(self, rng: np.random.Generator) -> Array:
        """Return the probabilities after each sample of one run, shape (SAMPLES, k)."""
        u, v = rng.standard_normal((2, SAMPLES))
        bank = self.bank
        posteriors = np.empty((SAMPLES, len(bank.candidates)))
        for t, y in enumerate(self.plant.outputs(u, v)):
            bank = bank.update(float(y), float(u[t]))
            posteriors[t] = bank.posterior
        return posteriors


AR: Final = Plant(Order(2, 0), (-1.5, 0.7), 1.0)
CALM: Final = Plant(Order(2, 1, 3), (-1.2, 0.5, 0.8), 0.3)
NOISY: Final = Plant(Order(2, 1, 3), (-1.2, 0.5, 0.8), 1.0)


def cases() -> tuple[Case, ...]:
    """Return the cases in the order of the table."""
    n, d = "order {n}", "delay {delay}"
    orders = [Order(n, 0) for n in range(1, 5)]
    delays = [Order(2, 1, delay) for delay in range(1, 7)]
    jointly = [Order(*numbers) for numbers in product((1, 2, 3), (1, 2), (1, 2, 3, 4))]
    return (
        Case("AR(2), order 1 to 4", AR, LainiotisBank(orders), n),
        Case("AR(2), R ten times too large", AR, LainiotisBank(orders, R=10.0), n),
        Case("AR(2), R ten times too small", AR, LainiotisBank(orders, R=0.1), n),
        Case("AR(2), P0 = 1", AR, LainiotisBank(orders, P0=1.0), n),
        Case("ARX, delay 1 to 6, noise 0.3", CALM, LainiotisBank(delays, R=0.09), d),
        Case("ARX, delay 1 to 6, noise 1", NOISY, LainiotisBank(delays), d),
        Case(
            "ARX, n, m and delay, noise 0.3",
            CALM,
            LainiotisBank(jointly, R=0.09),
            "{n},{m},{delay}",
        ),
    )


class Finding(NamedTuple):
    """How one run of a case ended."""

    samples: float
    """Samples until the true hypothesis first had `DECIDED`; infinity for never."""
    misled: bool
    """Another hypothesis had it first."""
    right: bool
    """The true hypothesis was the most probable after the last sample."""


def finding(posteriors: Array, truth: int) -> Finding:
    """Return what came of a run, `posteriors` of shape (T, k), with `truth` true."""
    reached = posteriors >= DECIDED
    first = np.where(reached.any(axis=0), reached.argmax(axis=0) + 1.0, math.inf)
    misled = bool(first.min() < first[truth])
    return Finding(float(first[truth]), misled, int(posteriors[-1].argmax()) == truth)


@dataclass(slots=True, eq=False)
class Tally:
    """What is kept of the replications of one case, in the order they came."""

    total: Array | float = 0.0
    """Sum of the posteriors, shape (SAMPLES, k)."""
    true: list[Array] = field(default_factory=list)
    """Probability of the true hypothesis after each sample of every run."""
    findings: list[Finding] = field(default_factory=list)

    def add(self, posteriors: Array, truth: int) -> None:
        """Take one more replication into account."""
        self.total = self.total + posteriors
        self.true.append(posteriors[:, truth].copy())
        self.findings.append(finding(posteriors, truth))


@dataclass(frozen=True, slots=True)
class Lainiotis(Repeated):
    """Selection of order and delay by a bank of filters.

    Parameters
    ----------
    replications : int
        Runs of every case, at least 1. A hundred give the medians to a tenth of themselves or
        better, and the fractions in per cent.
    seed : int
        Seed of noise and input, at least 0.

    Raises
    ------
    ValueError
        A setting is out of its range.
    """

    title: ClassVar[str] = "ALF: order and delay by a bank of filters"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("case", "\nhypotheses"),
        Column("samples_to_95_median", "samples to 95 %,\nmedian", ".4g"),
        Column("right", "right at\nthe end", ".2f"),
    )
    replications: int = 100

    def run(self) -> Iterator[Outcome]:
        """Yield what is known after each batch of replications; the last is the whole."""
        tallies = [(case, Tally()) for case in cases()]
        due = BATCH
        for replication in range(self.replications):
            for case, tally in tallies:
                rng = generator(self.seed, replication)  # anew: cases must not differ in noise
                tally.add(case.posteriors(rng), case.truth)
            finished = replication + 1
            if finished in (due, self.replications):
                yield Outcome(finished, [_row(*each) for each in tallies], _figures(tallies))
                due = finished + max(BATCH, finished // 50)

    def draw(self, outcome: Outcome, files: Sequence[Path]) -> list[Path]:
        """Draw a panel for each case into `files` and return what was written."""
        return draw_page(outcome, self.title, SPREAD, files)


def _row(case: Case, tally: Tally) -> Row:
    """Return the row of a case; no median where half of the runs or more never decided."""
    found = tally.findings
    median = float(np.median([each.samples for each in found]))
    return {
        "case": case.name,
        "samples_to_95_median": median if math.isfinite(median) else None,
        "right": float(np.mean([each.right for each in found])),
    }


def _figures(tallies: Sequence[tuple[Case, Tally]]) -> dict[str, dict[str, Any]]:
    """Return the probabilities of every case, and how long all of them took to decide."""
    figures = {case.name: _probabilities(case, tally) for case, tally in tallies}
    spread = [_distribution(case, tally) for case, tally in tallies]
    return {**figures, SPREAD: {"title": "samples until the truth has 95 %", "rows": spread}}


def _probabilities(case: Case, tally: Tally) -> dict[str, Any]:
    """Return the mean probability of each hypothesis, and the quartiles of the true one's."""
    names = [
        case.hypothesis.format(n=each.n, m=each.m, delay=each.delay)
        for each in case.bank.candidates
    ]
    mean = np.asarray(tally.total) / len(tally.true)
    low, high = np.quantile(tally.true, (0.25, 0.75), axis=0)
    return {
        "title": f"probability of {case.name}",
        "t": list(range(1, SAMPLES + 1)),
        "true": names[case.truth],
        "values": dict(zip(names, mean.T.tolist(), strict=True)),
        "true_lower_quartile": low.tolist(),
        "true_upper_quartile": high.tolist(),
    }


def _distribution(case: Case, tally: Tally) -> dict[str, Any]:
    """Return the samples of every run to its decision, None for never."""
    samples = [each.samples for each in tally.findings]
    return {
        "case": case.name,
        "samples": [int(each) if math.isfinite(each) else None for each in samples],
        "never": float(np.mean(np.isinf(samples))),
        "misled": float(np.mean([each.misled for each in tally.findings])),
    }
