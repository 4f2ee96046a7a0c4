"""Replay of a record: how well would each estimator have foreseen it.

The record is centred and scaled, the noise is estimated from a first pass, and each law then
predicts every output one step ahead before it sees it. All figures are given in the units of the
record.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from thermoctl.estimation import RecursiveLeastSquares, start
from thermoctl.model.arx import Arx
from thermoctl.quantities import Array
from thermoctl.studies.laws import LawSpec, prepare
from thermoctl.studies.record import LARGEST, Record, RecordError
from thermoctl.studies.whiteness import FEWEST_SAMPLES, ljung_box

NOISE_FORGETTING = 0.95
"""Forgetting factor of the first pass that estimates the noise."""

FEWEST_SCORED = 10
"""Predictions a score needs."""

TRACE_LENGTH = 2_000
"""Most estimates that are kept for drawing; a longer record keeps every k-th."""

BEYOND = 10.0
"""An error larger than this many ranges of the record shows a law that ran away."""

_LEARNING = 20
_LEARNING_SHARE = 0.1
_MAD = 1.4826
_BLOCK = 4_096


@dataclass(frozen=True, slots=True)
class Conditions:
    """What was done to the record before any law saw it; part of every result.

    Parameters
    ----------
    order : Arx
        Structure of the model.
    mean_removed : bool
        Whether the record was centred and scaled.
    y_centre, y_scale, u_centre, u_scale : float
        Scaled output = (y - y_centre)/y_scale, and the input likewise.
    R2 : float
        Noise variance all laws were given, in the unit of the output squared.
    R2_source : str
        Where R2 came from, in words.
    P0 : float
        Variance of every parameter at the start, in the scaled variables.
    scored_from : int
        Index of the first sample that counts; before it the laws learn.
    scored : int
        Predictions that count.
    persistence_rms : float
        Error of the simplest prediction, the last output, over the samples that count and in the
        unit of the output: what a model has to beat.
    """

    order: Arx
    mean_removed: bool
    y_centre: float
    y_scale: float
    u_centre: float
    u_scale: float
    R2: float
    R2_source: str
    P0: float
    scored_from: int
    scored: int
    persistence_rms: float


@dataclass(frozen=True, slots=True)
class Score:
    """How one law did; the names are the keys of ``replay --json``.

    `rms_error` is in the unit of the output; `r2` is the share of the output's variance that was
    foreseen, negative when a constant would have done better; `whiteness_p` is the p value of
    `thermoctl.studies.whiteness.ljung_box`, NaN unless `r2` is positive, and `whiteness_unknown`
    says why it is NaN, else None; `theta` and `theta_sd` are the last estimate and its
    standard deviation in the units of the record; `us_per_sample` is the median time of an update.
    """

    name: str
    rms_error: float
    r2: float
    whiteness_p: float
    whiteness_unknown: str | None
    theta: tuple[float, ...]
    theta_sd: tuple[float, ...]
    us_per_sample: float


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """How one law went through the record, in the units of the record.

    Parameters
    ----------
    index : ndarray, shape (K,)
        Samples at which an estimate was kept.
    theta, theta_sd : ndarray, shape (K, n)
        Estimates there, and their standard deviations; NaN where a law lost its way and P holds a
        negative variance.
    innovation, innovation_sd : ndarray, shape (T,)
        One-step prediction errors and what the law expected of them; NaN where none was made.
    gave_up : int or None
        First sample that counts whose error is beyond `BEYOND` ranges of the record, or where P
        holds a negative variance, of a law that foresaw nothing; what comes after is no estimate.
    """

    index: npt.NDArray[np.intp]
    theta: Array
    theta_sd: Array
    innovation: Array
    innovation_sd: Array
    gave_up: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """Result of a replay: scores and traces in the order the laws were named."""

    record: Record
    conditions: Conditions
    scores: tuple[Score, ...]
    traces: tuple[Trace, ...]


def replay(
    record: Record,
    order: Arx,
    laws: Sequence[LawSpec],
    *,
    R2: float | None = None,
    P0: float = 100.0,
    keep_mean: bool = False,
    timer: Callable[[], float] = time.perf_counter,
) -> Replay:
    """Run `record` through `laws` and score their one-step predictions.

    Parameters
    ----------
    record : Record
        What was recorded.
    order : Arx
        Structure (n, m, delay) of the model; its own centre and scale are not used.
    laws : sequence of LawSpec
        At least one.
    R2 : float, optional
        Noise variance in the unit of the output squared; estimated when not given.
    P0 : float
        Variance of every parameter at the start, in the scaled variables.
    keep_mean : bool
        Take the record as it is, neither centred nor scaled.
    timer : callable
        Clock in s for the time an update takes.

    Raises
    ------
    RecordError
        If the output never changes, or too few samples have a whole past.
    ValueError
        If `R2` or `P0` is not positive and finite.
    """
    for name, value in (("R2", R2), ("P0", P0)):
        if value is not None and not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be positive and finite, got {value!r}")
    scaled, conditions = _prepare(record, order, P0, keep_mean)
    if R2 is None:
        R2 = _noise(scaled, conditions)
        source = f"estimated: robust spread of the errors of a first pass, RLS({NOISE_FORGETTING})"
    else:
        source = "given"
    conditions = replace(conditions, R2=R2, R2_source=source)
    runs = [_run(scaled, conditions, law, timer) for law in laws]
    return Replay(record, conditions, *zip(*runs, strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class _Scaled:
    """The record as the laws see it: regressors are made in blocks, never all at once."""

    y: Array
    u: Array
    order: Arx
    whole: npt.NDArray[np.intp]

    @classmethod
    def of(cls, record: Record, y: Array, u: Array, order: Arx) -> _Scaled:
        """Keep the samples whose past reaches back far enough without a gap."""
        past = np.arange(len(y)) - record.stretch_start
        reach = max(1, order.y_memory, order.u_memory)
        return cls(y, u, order, np.flatnonzero(past >= reach))

    def samples(self) -> Iterator[tuple[int, Array, float]]:
        """Yield index, regressor and output of every sample with a whole past."""
        back_y = np.arange(1, self.order.n + 1)
        back_u = self.order.delay + np.arange(self.order.m)
        for begin in range(0, len(self.whole), _BLOCK):
            block = self.whole[begin : begin + _BLOCK]
            phi = np.hstack(  # O21 (1)
                (-self.y[block[:, None] - back_y], self.u[block[:, None] - back_u])
            )
            yield from zip(block.tolist(), phi, self.y[block].tolist(), strict=True)


def _prepare(record: Record, order: Arx, P0: float, keep_mean: bool) -> tuple[_Scaled, Conditions]:
    """Centre and scale, and decide from where on predictions count."""
    y_centre, y_scale = (0.0, 1.0) if keep_mean else _centre_and_scale(record.y)
    u_centre, u_scale = (0.0, 1.0) if keep_mean else _centre_and_scale(record.u)
    if not _moves(record.y):
        raise RecordError(
            f"{record.source}: expected an output that changes,"
            f" {record.names.output} is {record.y[0]:g} throughout"
        )
    y, u = (record.y - y_centre) / y_scale, (record.u - u_centre) / u_scale
    scaled = _Scaled.of(record, y, u, order)
    whole = len(scaled.whole)
    learning = min(_LEARNING * (order.n + order.m), int(_LEARNING_SHARE * whole))
    if whole - learning < FEWEST_SCORED:
        raise RecordError(
            f"{record.source}: expected at least {FEWEST_SCORED} samples to score,"
            f" {whole} of {len(y)} have a past without gaps for order"
            f" {order.n},{order.m},{order.delay}"
        )
    counted = scaled.whole[learning:]
    return scaled, Conditions(
        order=order,
        mean_removed=not keep_mean,
        y_centre=y_centre,
        y_scale=y_scale,
        u_centre=u_centre,
        u_scale=u_scale,
        R2=math.nan,
        R2_source="",
        P0=P0,
        scored_from=int(counted[0]),
        scored=len(counted),
        persistence_rms=float(np.sqrt(np.mean((record.y[counted] - record.y[counted - 1]) ** 2))),
    )


def _centre_and_scale(values: Array) -> tuple[float, float]:
    """Return mean and standard deviation; scale 1 for what never changes."""
    return float(np.mean(values)), float(np.std(values)) if _moves(values) else 1.0


def _moves(values: Array) -> bool:
    """Return whether `values` change, and by enough for their squares to be numbers."""
    return bool(np.ptp(values) > 0.0 and np.std(values) > 1.0 / LARGEST)


def _noise(scaled: _Scaled, conditions: Conditions) -> float:
    """Return the noise variance in the unit of the output squared.

    The spread is 1.4826 times the median of the errors, which a few outliers hardly move; each
    error is divided by what the uncertainty of the parameters adds to it. A quantised record that
    hardly moves has a median of zero: then the variance of one quantum stands in.
    """
    law = RecursiveLeastSquares(forgetting=NOISE_FORGETTING)
    belief = start(conditions.order.n + conditions.order.m, P0=conditions.P0)
    errors = []
    for index, phi, y in scaled.samples():
        belief = law.update(belief, phi, y)
        if index >= conditions.scored_from and not belief.rejected:
            added = belief.innovation_var + 1.0 - NOISE_FORGETTING
            errors.append(abs(belief.innovation) / math.sqrt(added))
    spread = _MAD * float(np.median(errors)) if errors else 0.0
    moves = np.abs(np.diff(scaled.y))
    quantum = float(np.min(moves[moves > 0.0]))
    return max(spread**2, quantum**2 / 12.0) * conditions.y_scale**2


def _run(
    scaled: _Scaled, conditions: Conditions, spec: LawSpec, timer: Callable[[], float]
) -> tuple[Score, Trace]:
    """Take the record through one law."""
    prepared = prepare(
        spec,
        conditions.order.n + conditions.order.m,
        conditions.R2 / conditions.y_scale**2,
        conditions.P0,
    )
    law, belief = prepared.law, prepared.prior
    innovation, variance = np.full((2, len(scaled.y)), math.nan)
    seconds = np.empty(len(scaled.whole))
    stride = -(-len(scaled.whole) // TRACE_LENGTH)
    kept = []
    for count, (index, phi, y) in enumerate(scaled.samples()):
        begun = timer()
        belief = law.update(belief, phi, y)
        seconds[count] = timer() - begun
        if not belief.rejected:
            innovation[index], variance[index] = belief.innovation, belief.innovation_var
        if count % stride == 0:
            kept.append((index, belief.theta, np.diag(belief.P)))
    kept.append((index, belief.theta, np.diag(belief.P)))
    places, theta, P_diagonal = (np.array(column) for column in zip(*kept, strict=True))
    unit = np.repeat(
        (1.0, conditions.y_scale / conditions.u_scale), (conditions.order.n, conditions.order.m)
    )
    trace = Trace(
        places,
        theta * unit,
        np.sqrt(prepared.unit_variance * np.where(P_diagonal >= 0.0, P_diagonal, math.nan)) * unit,
        innovation * conditions.y_scale,
        np.sqrt(prepared.unit_variance * variance) * conditions.y_scale,
    )
    score = _score(spec.text, scaled, conditions, trace, float(np.median(seconds)))
    if not score.r2 > 0.0:
        trace = replace(trace, gave_up=_gave_up(trace, scaled, conditions))
    return score, trace


def _gave_up(trace: Trace, scaled: _Scaled, conditions: Conditions) -> int | None:
    """Return the first sample from which on a law that ran away is not worth looking at."""
    reach = BEYOND * conditions.y_scale * float(np.ptp(scaled.y))
    late = trace.index >= conditions.scored_from
    lost = late & ~(np.isfinite(trace.theta) & np.isfinite(trace.theta_sd)).all(axis=1)
    far = np.flatnonzero(np.abs(trace.innovation) > reach)
    places = np.concatenate((trace.index[lost], far[far >= conditions.scored_from]))
    return int(places.min()) if len(places) else None


def _score(
    name: str, scaled: _Scaled, conditions: Conditions, trace: Trace, update_s: float
) -> Score:
    """Judge the predictions from `scored_from` on."""
    counted = scaled.whole[scaled.whole >= conditions.scored_from]
    counted = counted[np.isfinite(trace.innovation[counted])]
    e = trace.innovation[counted]
    y = scaled.y[counted] * conditions.y_scale
    spread = float(np.var(y)) if len(y) else math.nan
    with np.errstate(over="ignore"):  # a law that ran away may have errors near 1e150
        mean_square = float(np.mean(e**2)) if len(e) else math.nan
    r2 = 1.0 - mean_square / spread if spread > 0.0 else math.nan
    # One error that dwarfs all others looks white; whoever foresaw nothing gets no such praise.
    p = ljung_box(e / trace.innovation_sd[counted]).p if r2 > 0.0 else math.nan
    unknown = None
    if math.isnan(p):
        unknown = "it foresaw nothing" if not r2 > 0.0 else _too_few(len(e))
    return Score(
        name=name,
        rms_error=math.sqrt(mean_square),
        r2=r2,
        whiteness_p=p,
        whiteness_unknown=unknown,
        theta=tuple(trace.theta[-1].tolist()),
        theta_sd=tuple(trace.theta_sd[-1].tolist()),
        us_per_sample=1e6 * update_s,
    )


def _too_few(count: int) -> str:
    """Return why `count` innovations of a law that foresaw something were not tested."""
    if count < FEWEST_SAMPLES:
        return f"expected at least {FEWEST_SAMPLES} innovations, got {count}"
    return "the innovations do not vary, or the law did not say how sure it was"
