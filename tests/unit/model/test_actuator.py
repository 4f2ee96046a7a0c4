"""Actuator laws: round trips, ends, order, and what is not a number."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.model.actuator import Linear, PhaseAngle, SquareLaw, WholeCycleBurst

quickly = settings(max_examples=100, deadline=None, derandomize=True)
FRACTION = st.floats(0.0, 1.0)
SMOOTH = [Linear(), SquareLaw(), PhaseAngle()]
LAWS = [*SMOOTH, WholeCycleBurst(50), WholeCycleBurst(3)]


@pytest.mark.parametrize("law", SMOOTH, ids=repr)
@quickly
@given(power=FRACTION)
def test_the_power_that_was_asked_for_comes_out(law, power):
    assert law.power_from(law.drive_for(power)) == pytest.approx(power, abs=1e-12)


@pytest.mark.parametrize("law", LAWS, ids=repr)
@quickly
@given(one=FRACTION, other=FRACTION)
def test_more_drive_never_gives_less_power_nor_more_power_less_drive(law, one, other):
    low, high = sorted((one, other))
    assert law.drive_for(low) <= law.drive_for(high) + 1e-15
    assert law.power_from(low) <= law.power_from(high) + 1e-15


@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_off_is_off_and_full_is_full(law):
    ends = [law.drive_for(0.0), law.drive_for(1.0), law.power_from(0.0), law.power_from(1.0)]
    assert ends == [0.0, 1.0, 0.0, 1.0]


@pytest.mark.parametrize("law", LAWS, ids=repr)
@quickly
@given(wild=st.floats(allow_nan=True, allow_infinity=True))
def test_whatever_comes_in_a_fraction_goes_out(law, wild):
    assert 0.0 <= law.drive_for(wild) <= 1.0
    assert 0.0 <= law.power_from(wild) <= 1.0


@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_what_is_not_a_number_switches_off(law):
    assert law.drive_for(math.nan) == 0.0
    assert law.power_from(math.nan) == 0.0


def test_half_the_voltage_is_a_quarter_of_the_power():
    assert SquareLaw().power_from(0.5) == 0.25


@quickly
@given(angle=st.floats(0.0, math.pi))
def test_phase_angle_power_is_the_mean_square_of_what_conducts(angle):
    conducted = 1.0 - angle / math.pi + math.sin(2.0 * angle) / (2.0 * math.pi)
    assert PhaseAngle().power_from(1.0 - angle / math.pi) == pytest.approx(conducted, abs=1e-12)


@quickly
@given(power=FRACTION, cycles=st.integers(1, 1000))
def test_a_burst_passes_whole_cycles_and_errs_by_half_of_one_at_most(power, cycles):
    law = WholeCycleBurst(cycles)
    drive = law.drive_for(power)
    assert drive * cycles == pytest.approx(round(drive * cycles), abs=1e-9)
    assert abs(law.power_from(drive) - power) <= 0.5 / cycles + 1e-12


@pytest.mark.parametrize("cycles", [0, -3, 2.5, math.nan, math.inf])
def test_a_burst_of_no_whole_cycles_is_refused(cycles):
    with pytest.raises(ValueError, match="cycles"):
        WholeCycleBurst(cycles)
