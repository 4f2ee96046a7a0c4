"""A ``[loops.NAME]`` table made of what a tuning found: model and limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError

from thermoctl.app.configuration.tables import LoopTable, ModelTable
from thermoctl.app.configuration.toml_text import toml_text
from thermoctl.app.parts import check_parts
from thermoctl.app.plugins import BadOption
from thermoctl.studies.orders_words import order_text
from thermoctl.studies.plant_words import PlantWords
from thermoctl.studies.tuning import Tuning
from thermoctl.studies.tuning_limits import InForce, Proposal
from thermoctl.studies.tuning_words import reference_time_s

_DIGITS = 4


def suggested(table: LoopTable, tuning: Tuning) -> dict[str, Any] | None:
    """Return the keys a model table should have, None where nothing better is known.

    The structure stays as it is configured: which one a controller does best with is no question
    of prediction. On the simulated rig a known gain holds within 12 mK, the ARX model that foresees
    best within 50 (docs/tune.md).

    Parameters
    ----------
    table : LoopTable
        The loop as it is configured.
    tuning : Tuning
        What was found.
    """
    words = tuning.words
    if words is None:
        return None
    keys: dict[str, Any] = {
        "structure": table.model.structure,
        "gain_k_per_s": _rounded(words.gain_k_per_min.value / 60.0),
    }
    if table.model.structure == "arx":
        keys |= _arx_keys(tuning, words)
    try:
        ModelTable.model_validate(table.model.model_dump() | keys)
    except ValidationError:  # an order such as n = 0 that a loop cannot have
        return None
    return keys


def _arx_keys(tuning: Tuning, words: PlantWords) -> dict[str, Any]:
    keys: dict[str, Any] = {}
    if tuning.given or tuning.weighing.chosen is not None:
        order = tuning.order
        keys |= {"n": order.n, "m": order.m, "delay": order.delay}
    if words.rest_c is not None:
        keys["centre_c"] = round(words.rest_c.value, 1)
    return keys


def in_force(table: LoopTable, dead_man_s: float | None) -> InForce:
    """Return the limits of a loop as they are configured."""
    explicit = table.model_fields_set
    return InForce(
        setpoint_c=table.setpoint_c,
        highest_setpoint_c=table.setpoint_range_c[1],
        trip_above_c=table.trip_above_c,
        power_max=table.power_max,
        jump_k=table.jump_k if "jump_k" in explicit else None,
        rise_per_s=table.rise_per_s,
        dead_man_s=dead_man_s,
    )


def limit_keys(table: LoopTable, limits: Sequence[Proposal]) -> dict[str, Any]:
    """Return the limits that should be changed, as far as the loop can have them."""
    keys: dict[str, Any] = {}
    for limit in limits:
        if not limit.change or limit.value is None or limit.key not in LoopTable.model_fields:
            continue
        try:
            wanted = table.model_dump(exclude_unset=True) | keys | {limit.key: limit.value}
            check_parts(LoopTable.model_validate(wanted))
        except (ValidationError, BadOption):  # such as a trip that its sensor cannot show
            continue
        keys[limit.key] = limit.value
    return keys


def suggestion_text(
    loop: str,
    table: LoopTable,
    keys: dict[str, Any],
    tuning: Tuning,
    limits: Sequence[Proposal] = (),
) -> str:
    """Return the keys as TOML, with what else was found as comments."""
    text = toml_text({"loops": {loop: {**limit_keys(table, limits), "model": keys}}})
    for limit in limits:
        if limit.change and limit.key not in LoopTable.model_fields:
            text += f"# {limit.key} of its board: {limit.value:g}\n"
    words = tuning.words
    if words is not None:
        text += (
            f"# three lags, for a controller with a reference_time_s: {reference_time_s(words):g}\n"
        )
    if keys["structure"] != "arx" and (tuning.given or tuning.weighing.chosen):
        text += f'# n,m,delay that structure = "arx" would take: {order_text(tuning.order)}\n'
    return text


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
