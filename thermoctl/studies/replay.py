"""Replay of a record: how well would each estimator have foreseen it.

The record is centred and scaled, the noise is estimated from a first pass, and each law then
predicts every output one step ahead before it sees it. All figures are given in the units of the
record.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from thermoctl.estimation import RecursiveLeastSquares, start
from thermoctl.model.arx import Arx
from thermoctl.quantities import Array
from thermoctl.studies.laws import LawSpec, prepare
from thermoctl.studies.orders import Weighing
from thermoctl.studies.record import Record, RecordError
from thermoctl.studies.scaled import Scaled, Scaling, check_P0, check_R2, robust_variance
from thermoctl.studies.whiteness import FEWEST_SAMPLES, ljung_box

NOISE_FORGETTING = 0.95
"""Forgetting factor of the first pass that estimates the noise."""

WIDE_SOURCE = "estimated: robust spread of the errors of the model that holds every candidate"
"""Where the noise comes from when orders were weighed."""

FEWEST_SCORED = 10
"""Predictions a score needs."""

TRACE_LENGTH = 2_000
"""Most estimates that are kept for drawing; a longer record keeps every k-th."""

BEYOND = 10.0
"""An error larger than this many ranges of the record shows a law that ran away."""

_LEARNING = 20
_LEARNING_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class Conditions:
    """What was done to the record before any law saw it; part of every result.

    Parameters
    ----------
    order : Arx
        Structure of the model.
    mean_removed : bool
        Whether the record was centred and scaled; with orders weighed, the input is centred where
        the mean of the output would be at rest.
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
    """Result of a replay: scores and traces in the order the laws were named.

    `weighing` is what chose the order, where the record was asked to.
    """

    record: Record
    conditions: Conditions
    scores: tuple[Score, ...]
    traces: tuple[Trace, ...]
    weighing: Weighing | None = None


def replay(
    record: Record,
    order: Arx | Weighing,
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
    order : Arx or Weighing
        Structure (n, m, delay) of the model, whose own centre and scale are not used; or what the
        record says of several: its most probable one is taken, named as chosen or not, and its
        scaling and noise with it.
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
        If the output never changes, or too few samples have a whole past; if `R2` or `P0` is
        out of what `check_R2` and `check_P0` let pass.
    """
    check_P0(P0)
    weighing = order if isinstance(order, Weighing) else None
    structure = order.best.structure() if isinstance(order, Weighing) else order
    scaling = weighing.scaling if weighing else Scaling.of(record, keep_mean=keep_mean)
    scaled, conditions = _prepare(record, structure, scaling, P0)
    if weighing:
        R2, source = weighing.R2, "given" if R2 is not None else WIDE_SOURCE
    elif R2 is None:
        R2 = _noise(scaled, conditions)
        source = f"estimated: robust spread of the errors of a first pass, RLS({NOISE_FORGETTING})"
    else:
        source = "given"
    check_R2(R2, conditions.y_scale**2)
    conditions = replace(conditions, R2=R2, R2_source=source)
    runs = [_run(scaled, conditions, law, timer) for law in laws]
    scores, traces = zip(*runs, strict=True)
    return Replay(record, conditions, scores, traces, weighing)


def _prepare(record: Record, order: Arx, scaling: Scaling, P0: float) -> tuple[Scaled, Conditions]:
    """Scale, and decide from where on predictions count."""
    y = scaling.outputs(record)
    scaled = Scaled.of(record, y, scaling.inputs(record), order)
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
        mean_removed=scaling != Scaling(),
        y_centre=scaling.y_centre,
        y_scale=scaling.y_scale,
        u_centre=scaling.u_centre,
        u_scale=scaling.u_scale,
        R2=math.nan,
        R2_source="",
        P0=P0,
        scored_from=int(counted[0]),
        scored=len(counted),
        persistence_rms=float(np.sqrt(np.mean((record.y[counted] - record.y[counted - 1]) ** 2))),
    )


def _noise(scaled: Scaled, conditions: Conditions) -> float:
    """Return the noise variance in the unit of the output squared.

    Each error of the first pass is divided by what the uncertainty of the parameters adds to it.
    """
    law = RecursiveLeastSquares(forgetting=NOISE_FORGETTING)
    belief = start(conditions.order.n + conditions.order.m, P0=conditions.P0)
    errors = []
    for index, phi, y in scaled.samples():
        belief = law.update(belief, phi, y)
        if index >= conditions.scored_from and not belief.rejected:
            added = belief.innovation_var + 1.0 - NOISE_FORGETTING
            errors.append(abs(belief.innovation) / math.sqrt(added))
    return robust_variance(np.array(errors), scaled.y) * conditions.y_scale**2


def _run(
    scaled: Scaled, conditions: Conditions, spec: LawSpec, timer: Callable[[], float]
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


def _gave_up(trace: Trace, scaled: Scaled, conditions: Conditions) -> int | None:
    """Return the first sample from which on a law that ran away is not worth looking at."""
    reach = BEYOND * conditions.y_scale * float(np.ptp(scaled.y))
    late = trace.index >= conditions.scored_from
    lost = late & ~(np.isfinite(trace.theta) & np.isfinite(trace.theta_sd)).all(axis=1)
    far = np.flatnonzero(np.abs(trace.innovation) > reach)
    places = np.concatenate((trace.index[lost], far[far >= conditions.scored_from]))
    return int(places.min()) if len(places) else None


def _score(
    name: str, scaled: Scaled, conditions: Conditions, trace: Trace, update_s: float
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
