"""Which order and delay a record speaks for, by a Lainiotis bank.

The record is scaled as a replay scales it. A `thermoctl.studies.wide` model gives the noise, which
depends on no candidate then, and the constant that means have which are not at rest. The bank
starts each stretch with samples it only remembers, and goes by Bayes' rule over all others.

Explained in ``docs/replay.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from thermoctl.estimation import LainiotisBank, Order
from thermoctl.quantities import Array, frozen
from thermoctl.studies.record import Record
from thermoctl.studies.scaled import Scaling, check_P0, check_R2
from thermoctl.studies.wide import WideModel, fit_wide

DELAYS = (1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25)
"""Delays of the usual candidates: a quarter apart where they are long."""

USUAL = tuple(Order(n, m, d) for n in (1, 2, 3) for m in (1, 2) for d in DELAYS)
"""Candidates when none are named. Two inputs hold one, and the delay after theirs."""

EVIDENCE = 20.0
"""Nats by which the input must improve the wide model, or no order is named.

A tank that a self-tuning law holds at its set point gave -4 to 14 in each of 96 hours, one under a
test signal 60 to 75 in twenty minutes (``test_an_hour_at_the_set_point_names_no_order``).
"""

DECIDED = 0.5
"""A winner is named when it is more probable than all others together."""

SETTLED = 0.95
"""Probability that counts as settled."""

MOST_WEIGHED = 50_000
"""Samples that are weighed at most: those in a row in which the input moves most."""

TRACE_LENGTH = 2_000
"""Most posteriors that are kept for drawing."""


@dataclass(frozen=True, slots=True, eq=False)
class Weighing:
    """What a record says of each candidate.

    Parameters
    ----------
    orders : tuple of Order
        The candidates, in the order they were given.
    posterior : ndarray, shape (k,)
        Their probabilities after the last sample.
    samples : int
        Samples that were weighed.
    settled : int or None
        Samples after which the winner had 95 %, and kept them to the end.
    index : ndarray, shape (K,)
        Samples of the record at which a posterior was kept.
    trace : ndarray, shape (K, k)
        Posteriors there.
    R2 : float
        Variance of the noise the bank was given, in the unit of the output squared.
    scaling : Scaling
        How the record was centred and scaled.
    wide : WideModel
        The model that noise and centre come from.
    """

    orders: tuple[Order, ...]
    posterior: Array
    samples: int
    settled: int | None
    index: npt.NDArray[np.intp]
    trace: Array
    R2: float
    scaling: Scaling
    wide: WideModel

    @property
    def ranked(self) -> tuple[tuple[Order, float], ...]:
        """Every candidate with its probability, the most probable first."""
        places = np.argsort(-self.posterior, kind="stable")
        return tuple((self.orders[i], float(self.posterior[i])) for i in places)

    @property
    def best(self) -> Order:
        """The most probable candidate, whether or not it may be named."""
        return self.ranked[0][0]

    @property
    def undecided(self) -> str | None:
        """Why no candidate is named; None where one is."""
        wide = self.wide
        if any(order.m for order in self.orders) and wide.evidence < EVIDENCE:
            return (
                "the input is not heard, it rests or follows the output: expected it to improve the"
                f" prediction by {EVIDENCE:g} nats, got {max(0.0, wide.evidence):.0f}"
            )
        probability = self.ranked[0][1]
        if probability < DECIDED:
            return (
                f"expected a candidate with {100.0 * DECIDED:g} % or more, the most probable has"
                f" {100.0 * probability:.0f} %"
            )
        return None

    @property
    def chosen(self) -> Order | None:
        """The order the record speaks for, or None."""
        return None if self.undecided else self.best

    @property
    def noise_given(self) -> bool:
        """Whether R2 is another than that of the wide model."""
        return self.wide.R2 * self.scaling.y_scale**2 != self.R2

    @property
    def edges(self) -> tuple[str, ...]:
        """What of the chosen order is the largest that was tried, in words."""
        chosen = self.chosen
        if chosen is None:
            return ()
        found = []
        for name in ("n", "m", "delay") if chosen.m else ("n", "m"):
            tried = {getattr(each, name) for each in self.orders if each.m or name != "delay"}
            if len(tried) > 1 and getattr(chosen, name) == max(tried):
                found.append(f"{name} {max(tried)}")
        return tuple(found)


def weigh(
    record: Record,
    candidates: Sequence[Order] = USUAL,
    *,
    R2: float | None = None,
    P0: float = 100.0,
    keep_mean: bool = False,
) -> Weighing:
    """Return what `record` says of `candidates`.

    Parameters
    ----------
    record : Record
        What was recorded.
    candidates : sequence of Order
        At least one, all different.
    R2 : float, optional
        Noise variance in the unit of the output squared; that of the wide model when not given.
    P0 : float
        Variance of every parameter at the start, in the scaled variables.
    keep_mean : bool
        Take the record as it is, neither centred nor scaled.

    Raises
    ------
    RecordError
        If the output never changes, or too few samples have a whole past; if `R2` or `P0` is
        out of what `check_R2` and `check_P0` let pass.
    ValueError
        If the candidates are none or repeat each other.
    """
    check_P0(P0)
    scaling = Scaling.of(record, keep_mean=keep_mean)
    y, u = scaling.outputs(record), scaling.inputs(record)
    unit = scaling.y_scale**2
    orders = tuple(LainiotisBank(candidates, floor=0.0).candidates)
    structures = [order.structure() for order in orders]
    reach = max(each.u_memory for each in structures)
    wide = fit_wide(record, y, u, max(order.n for order in orders), reach)
    if R2 is None:
        R2 = wide.R2 * unit
    check_R2(R2, unit)
    bank = LainiotisBank(orders, R=R2 / unit, P0=P0, floor=0.0)
    if not keep_mean:  # with these centres no candidate lacks a constant
        scaling = replace(scaling, u_centre=scaling.u_centre + wide.rest * scaling.u_scale)
        u = scaling.inputs(record)
    reach = max(reach, max(each.y_memory for each in structures))
    course = _course(bank, record, y, u, reach)
    return Weighing(orders, *course, R2, scaling, wide)


def _course(
    bank: LainiotisBank, record: Record, y: Array, u: Array, reach: int
) -> tuple[Array, int, int | None, npt.NDArray[np.intp], Array]:
    """Take the record through the bank; return what `Weighing` keeps of it."""
    past = np.arange(len(y)) - record.stretch_start
    first, last = _busiest(u, np.flatnonzero(past >= reach))
    stride = -(-(last - first) // TRACE_LENGTH)
    samples, leader, since = 0, -1, 0
    index, kept = [], []
    for t in range(first - reach, last):
        sample = float(y[t]), float(u[max(t - 1, 0)])
        if past[t] < reach or t < first:  # of a stretch that begins: its own past is not known
            bank = bank.remember(*sample)
            continue
        bank = bank.update(*sample)
        samples += 1
        winner = int(np.argmax(bank.posterior))
        if winner != leader or bank.posterior[winner] < SETTLED:
            leader, since = winner, samples
        if samples % stride == 0 or t == last - 1:
            index.append(t)
            kept.append(bank.posterior)
    settled = since if bank.posterior[leader] >= SETTLED else None
    return bank.posterior, samples, settled, np.array(index), frozen(np.array(kept))


def _busiest(u: Array, whole: npt.NDArray[np.intp]) -> tuple[int, int]:
    """Return where the samples begin and end that are weighed: all, or the busiest in a row."""
    if len(whole) <= MOST_WEIGHED:
        return int(whole[0]), int(whole[-1]) + 1
    travel = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(u)))))[whole]
    first = int(np.argmax(travel[MOST_WEIGHED - 1 :] - travel[: len(whole) - MOST_WEIGHED + 1]))
    return int(whole[first]), int(whole[first + MOST_WEIGHED - 1]) + 1
