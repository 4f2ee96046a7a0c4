"""Power above the resting one, where a block keeps what it has got."""

import pytest

from thermoctl.control.adaptive.coasting import Outlook, power_for
from thermoctl.control.adaptive.constants import Pace

BOUNDS = (-9.0, 9.0)  # far from any answer below


def answer(error_k, kept_s, above=0.0):
    """Return by how much power is above the resting one, 0.2; the one before was `above` it."""
    outlook = Outlook(37.5 - error_k, holding_power=0.2, lag_s=20.0, gain=0.036)
    return power_for(outlook, 37.5, 0.4, 1.0, BOUNDS, 0.2 + above, kept_s=kept_s) - 0.2


def test_power_that_takes_as_long_to_come_down_as_the_error_has_is_half_as_much():
    assert answer(0.05, kept_s=8.0) == pytest.approx(0.5 * answer(0.05, kept_s=0.0))
    assert answer(0.05, kept_s=72.0) == pytest.approx(0.1 * answer(0.05, kept_s=0.0))


def test_a_block_that_comes_down_late_is_told_at_once():
    above, Tc_s = 0.5, 0.4 * 20.0
    error_k = 1.0 - 0.036 * Pace().smoothness * Tc_s * above  # part of it is under way
    assert answer(1.0, kept_s=72.0, above=above) == pytest.approx(error_k / (0.036 * (Tc_s + 72.0)))
    assert answer(1.0, kept_s=0.0, above=above) > above  # else it is raised


def test_what_a_block_keeps_is_no_reason_to_leave_more_on_above_the_set_point():
    assert answer(-0.05, kept_s=60.0) == answer(-0.05, kept_s=0.0) < 0.0
