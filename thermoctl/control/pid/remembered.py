"""Gains of a PID that outlive a restart, and which of them are believed.

Explained in ``docs/service.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thermoctl.control.pid.autotune import Found
from thermoctl.control.pid.simc import Gains
from thermoctl.ranges import number

SLOPE_MIN, SLOPE_MAX = 2e-5, 0.5
"""Bounds in K/s of what a heater does to water: 17 W in 200 l, 1,500 W in 0.7 l."""
BRISKEST = 2.0
"""No rule gives more than this share of full power for what full power heats in a period: half of
one is dead time, and a derivative at most doubles the gain."""
INTEGRAL_MAX_S = 1e6


def as_remembered(found: Found, tuning: str, form: str, period_s: float) -> dict[str, Any]:
    """Return what is worth keeping of `found`, as plain numbers."""
    gains = found.gains
    return {
        "tuning": tuning,
        "tuned_form": form,
        "period_s": period_s,
        "gain_per_k": gains.gain_per_k,
        "integral_s": gains.integral_s,
        "derivative_s": gains.derivative_s,
        "slope_k_per_s": found.slope_k_per_s,
        "text": found.text,
    }


def found_before(remembered: Mapping[str, Any], tuning: str, form: str, period_s: float) -> Found:
    """Return what a test of an earlier run has come to.

    Its holding power is not remembered: it depends on the surroundings.

    Raises
    ------
    ValueError
        It was found in another way or at another period, or no test finds such gains.
    """
    same = {"tuning": tuning, "tuned_form": form, "period_s": period_s}
    for name, expected in same.items():
        if remembered.get(name) != expected:
            raise ValueError(f"expected {name} {expected!r}, got {remembered.get(name)!r}")
    slope = number(remembered, "slope_k_per_s", SLOPE_MIN, SLOPE_MAX)
    gain_per_k = number(remembered, "gain_per_k", 0.0, BRISKEST / (slope * period_s))
    if not gain_per_k > 0.0:
        raise ValueError(f"expected a positive gain_per_k, got {gain_per_k!r}")
    integral_s = number(remembered, "integral_s", 0.5 * period_s, INTEGRAL_MAX_S)
    derivative_s = number(remembered, "derivative_s", 0.0, integral_s)
    text = f"{str(remembered.get('text'))[:200]}, in an earlier run"
    return Found(Gains(gain_per_k, integral_s, derivative_s), text, slope)
