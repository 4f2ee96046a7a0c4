"""The score between the controller in charge and its shadow, in words."""

from __future__ import annotations

from thermoctl.app.live import numbers
from thermoctl.signals import ShadowScore

_STILL_PER_MIN = 0.005
"""A power that moves less than this, in full ranges a minute, is said to stand still."""


def shadow_words(score: ShadowScore | None) -> list[str]:
    """Return what `score` says of the shadow, the most telling words first.

    How far the two powers are apart, how much more it moves its own, and by how much its model
    misses the next reading, against that of the one in charge.
    None of it is how well it would hold the set point: that nobody can know.
    """
    if score is None:
        return ["compared after a minute in auto"]
    words = [f"{numbers.power(score.apart)} apart"]
    words += [_moves(score.travel_per_min, score.shadow_travel_per_min)]
    own, other = numbers.millikelvin(score.shadow_surprise_k), numbers.millikelvin(score.surprise_k)
    if numbers.UNKNOWN not in (own, other):
        words += [f"misses by {own}, not {other}"]
    return words


def _moves(charge: float, shadow: float) -> str:
    """Return how much the shadow would move the power, against what the one in charge does."""
    if shadow < _STILL_PER_MIN:
        return "stands still"
    if charge < _STILL_PER_MIN:
        return "moves, the one in charge does not"
    ratio = numbers.number(shadow / charge, 1 if shadow < 9.95 * charge else 0)
    return f"moves {ratio} × as much"
