"""The estimators a replay can name, from the words of the command line.

    NAME, NAME:VALUE or NAME:KEY=VALUE,KEY=VALUE

Constants are in the scaled variables of the replay, except where they are pure numbers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from thermoctl.estimation import (
    CorrectedKalman,
    Order,
    RandomWalkKalman,
    RecursiveLeastSquares,
    VariableForgetting,
    start,
)
from thermoctl.model.arx import Arx
from thermoctl.ports import Estimator
from thermoctl.signals import Estimate
from thermoctl.studies.scaled import MOST_R2

EXAMPLES = "ckf, nkf, nkf:R1=1e-6, rls, rls:0.98, vff, vff:10"


AUTO = "auto"
"""The word for an order that the record is to choose."""

FARTHEST = 200
"""Samples a candidate may look back."""


@dataclass(frozen=True, slots=True)
class LawSpec:
    """An estimator by name with its constants, the noise not yet known."""

    text: str
    name: str
    constants: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class PreparedLaw:
    """A law with its first belief.

    Parameters
    ----------
    law : Estimator
        The law, with the noise of the record put in.
    prior : Estimate
        What it starts from.
    unit_variance : float
        What `P` and `innovation_var` of its estimates are counted in: 1 for the Kalman filters, R2
        for least squares, whose P is a covariance only after it is multiplied by the noise.
    """

    law: Estimator
    prior: Estimate
    unit_variance: float


@dataclass(frozen=True, slots=True)
class _Kind:
    """One name: its constants with defaults, the first of which may stand alone."""

    defaults: Mapping[str, float]
    build: Callable[[Mapping[str, float], float], Estimator]
    normalised: bool = False


_KINDS: Mapping[str, _Kind] = {
    "ckf": _Kind(
        {"R1": 0.0, "inflation_max": math.inf},
        lambda c, R2: CorrectedKalman(R1=c["R1"], R2=R2, inflation_max=c["inflation_max"]),
    ),
    "nkf": _Kind({"R1": 0.0}, lambda c, R2: RandomWalkKalman(R1=c["R1"], R2=R2)),
    "rls": _Kind(
        {"forgetting": 1.0},
        lambda c, _: RecursiveLeastSquares(forgetting=c["forgetting"]),
        normalised=True,
    ),
    # Sigma0 = sigma_v^2 N0, N0 being about how many samples the filter remembers. Ten suit a model
    # of one parameter that jumps; with four on a slow plant so few let P run away.
    "vff": _Kind(
        {"N0": 100.0, "forgetting_min": 0.2},
        lambda c, R2: VariableForgetting(R2 * c["N0"], forgetting_min=c["forgetting_min"]),
        normalised=True,
    ),
}


def parse_order(text: str) -> Arx:
    """Return the structure `text` names: ``n,m,delay`` as in ``2,2,1``.

    Raises
    ------
    ValueError
        If it is not three integers, or out of range.
    """
    words = text.split(",")
    try:
        n, m, delay = (int(word) for word in words)
    except ValueError:
        raise ValueError(f"expected n,m,d such as 2,2,1; got {text!r}") from None
    return Arx(n, m, delay)


def parse_order_or_auto(text: str) -> Arx | None:
    """Return what `parse_order` returns, or None for ``auto``.

    Raises
    ------
    ValueError
        If it is neither.
    """
    if text.strip().lower() == AUTO:
        return None
    try:
        return parse_order(text)
    except ValueError as problem:
        raise ValueError(
            str(problem).replace("expected n,m,d", f"expected {AUTO} or n,m,d")
        ) from None


def parse_candidates(text: str) -> tuple[Order, ...]:
    """Return the orders `text` names: ``n,m,delay``, each a number or a range.

    Raises
    ------
    ValueError
        If it is not three of them, out of range, or too many.
    """
    words = text.split(",")
    try:
        n, m, delay = (_numbers(word) for word in words)
    except ValueError:
        raise ValueError(
            f"expected n,m,d or ranges of them, such as 2,1,3 or 1-3,1-2,1-8; got {text!r}"
        ) from None
    if n[-1] > FARTHEST or delay[-1] + m[-1] - 1 > FARTHEST:
        raise ValueError(
            f"expected orders that reach back {FARTHEST} samples at most, got {text!r}"
        )
    return tuple(Order(*each) for each in itertools.product(n, m, delay))


def _numbers(text: str) -> range:
    """Return the numbers of ``3`` or ``1-3``; raise ``ValueError`` if it is neither."""
    low, dash, high = text.strip().partition("-")
    if not (low.isdecimal() and (high.isdecimal() or not dash)):
        raise ValueError(text)
    numbers = range(int(low), int(high or low) + 1)
    if not numbers:
        raise ValueError(text)
    return numbers


def parameter_names(order: Arx) -> tuple[str, ...]:
    """Return a1 ... an, b1 ... bm, in the order of theta."""
    return (
        *(f"a{k}" for k in range(1, order.n + 1)),
        *(f"b{k}" for k in range(1, order.m + 1)),
    )


def parse_law(text: str) -> LawSpec:
    """Return the estimator `text` names; its constants are tried at once.

    Raises
    ------
    ValueError
        If the name or a key is not known, or a value is no number or out of range.
    """
    name, _, rest = text.strip().partition(":")
    kind = _KINDS.get(name.lower())
    if kind is None:
        raise ValueError(f"expected an estimator such as {EXAMPLES}; got {text!r}")
    constants = dict(kind.defaults)
    for place, word in enumerate(rest.split(",") if rest else []):
        key, equals, value = word.strip().partition("=")
        if not equals and place == 0:
            key, value = next(iter(constants)), key
        if key not in constants:
            known = ", ".join(constants)
            raise ValueError(f"{text!r}: expected constants out of {known}; got {word.strip()!r}")
        try:
            constants[key] = float(value)
        except ValueError:
            raise ValueError(f"{text!r}: expected a number for {key}, got {value!r}") from None
    spec = LawSpec(text.strip(), name.lower(), constants)
    try:
        for R2 in (1.0, 1.0 / MOST_R2, MOST_R2):
            kind.build(constants, R2)
    except ValueError as problem:
        raise ValueError(f"{text!r}: {problem}") from problem
    return spec


def prepare(spec: LawSpec, parameters: int, R2: float, P0: float) -> PreparedLaw:
    """Return the law of `spec`, ready for a record.

    Parameters
    ----------
    spec : LawSpec
        From `parse_law`.
    parameters : int
        Length of theta.
    R2 : float
        Variance of the measurement noise, greater than zero.
    P0 : float
        Variance of every parameter before the first sample; the same for all laws, so that least
        squares without forgetting and the Kalman filter without drift give the same estimates.
    """
    kind = _KINDS[spec.name]
    unit = R2 if kind.normalised else 1.0
    return PreparedLaw(kind.build(spec.constants, R2), start(parameters, P0=P0 / unit), unit)
