"""What a weighing of orders found, in words and as JSON."""

from __future__ import annotations

from typing import Any

from thermoctl.estimation import Order
from thermoctl.studies.orders import SETTLED, Weighing
from thermoctl.studies.words import counted

SHOWN = 5
"""Candidates of a table."""


def orders_json(weighing: Weighing) -> dict[str, Any]:
    """Return every candidate with its probability, and which one is chosen, if any."""
    chosen = weighing.chosen
    return {
        "orders": [
            {**_words(order), "posterior": probability} for order, probability in weighing.ranked
        ],
        "chosen": None if chosen is None else _words(chosen),
        "undecided": weighing.undecided,
        "weighed": {
            "samples": weighing.samples,
            "samples_to_95": weighing.settled,
            "R2": weighing.R2,
            "evidence_nats": weighing.wide.evidence,
            "heard": weighing.wide.heard,
        },
    }


def _words(order: Order) -> dict[str, int]:
    return {"n": order.n, "m": order.m, "delay": order.delay}


def order_text(order: Order) -> str:
    """Return an order as it is given on a command line."""
    return f"{order.n},{order.m},{order.delay}"


def orders_lines(weighing: Weighing) -> list[str]:
    """Return which order is chosen and how firmly, or why none is."""
    best, probability = weighing.ranked[0]
    if weighing.undecided is None:
        verdict = f"{order_text(best)} with {percent(probability)}"
        if weighing.settled is not None:
            verdict += f", at least {percent(SETTLED)} from sample {weighing.settled:,} on"
    else:
        verdict = f"undecided; {order_text(best)}, the most probable, is used. Why: "
        verdict += weighing.undecided
    wide = weighing.wide
    source = "given" if weighing.noise_given else "from its errors"
    lines = [
        f"Orders   {len(weighing.orders)} weighed on {weighing.samples:,} samples: {verdict}",
        f"         in a model of {counted(wide.order.n, 'past output')} and"
        f" {counted(wide.order.m, 'input')} the input foresees {percent(wide.heard)} of what past"
        f" outputs leave open ({max(0.0, wide.evidence):.0f} nats); noise sd"
        f" {weighing.R2**0.5:.4g}, {source}",
    ]
    if weighing.edges:
        lines.append(
            f"         {', '.join(weighing.edges)}: the largest that was tried; --candidates may"
            " name larger ones"
        )
    return lines


def orders_rows(weighing: Weighing) -> list[tuple[str, str]]:
    """Return the most probable candidates, each with its probability."""
    shown = weighing.ranked[:SHOWN]
    return [(order_text(order), percent(probability)) for order, probability in shown]


def percent(probability: float) -> str:
    """Return a probability in per cent; never 100 for what is not certain."""
    shown = f"{100.0 * probability:.1f}"
    if shown == "100.0" and probability < 1.0:
        return "> 99.9 %"
    return "< 0.1 %" if shown == "0.0" and probability > 0.0 else f"{shown.removesuffix('.0')} %"
