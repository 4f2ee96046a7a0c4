"""Which orders to weigh: what ``replay`` and ``tune`` have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any, Final, TypeVar

import click

from thermoctl.app.commands.options import Parsed
from thermoctl.estimation import LainiotisBank, Order
from thermoctl.model.arx import Arx
from thermoctl.studies.laws import parse_candidates

F = TypeVar("F", bound=Callable[..., Any])

MOST_CANDIDATES: Final = 200
"""Most orders that are weighed: 0.2 ms a sample."""


def candidates_option(function: F) -> F:
    """Add ``--candidates``, which may be given several times."""
    return click.option(
        "--candidates",
        type=Parsed("n,m,d", parse_candidates),
        multiple=True,
        callback=_together,
        help="With --order auto: orders to weigh, or ranges of them such as 1-3,1-2,1-8; may be "
        "given several times.",
    )(function)


def _together(
    context: click.Context, option: click.Parameter, given: Sequence[Sequence[Order]]
) -> tuple[Order, ...]:
    """Return all candidates, each of which may be named only once."""
    orders = tuple(chain.from_iterable(given))
    if len(orders) > MOST_CANDIDATES:
        raise click.BadParameter(
            f"expected at most {MOST_CANDIDATES} candidates, got {len(orders)}", context, option
        )
    if orders:
        try:
            LainiotisBank(orders, floor=0.0)
        except ValueError as problem:
            raise click.BadParameter(str(problem), context, option) from problem
    return orders


def require_auto(order: Arx | None, candidates: Sequence[Order]) -> None:
    """Refuse candidates beside an order that is given."""
    if order is not None and candidates:
        given = f"{order.n},{order.m},{order.delay}"
        raise click.UsageError(
            f"expected --candidates only with --order auto, got --order {given}",
            click.get_current_context(),
        )
