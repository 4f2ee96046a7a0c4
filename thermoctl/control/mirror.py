"""A plant that power cools, as one that it heats: upside down."""

from __future__ import annotations

from dataclasses import replace

from thermoctl.ports import Situation


def mirrored(situation: Situation) -> Situation:
    """Return `situation` with temperatures negated, as a law that heats meets it.

    Power is not: what takes heat out of the plant brings it into the mirrored one. Only the
    temperatures a law without a model looks at are turned.
    """
    return replace(
        situation,
        temperature_c=-situation.temperature_c,
        setpoint_c=-situation.setpoint_c,
        measured_c=-situation.measured_c,
        setpoint_rate_k_per_s=-situation.setpoint_rate_k_per_s,
        target_c=-situation.target_c,
    )
