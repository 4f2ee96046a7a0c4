"""What a fall of the temperature amounts to, against mixing laws."""

from __future__ import annotations

import pytest

from thermoctl.insight import physics

C, FUSION = 4181.0, 333_550.0


@pytest.mark.parametrize("poured_kg", [0.05, 0.6, 4.0])
def test_cold_water_is_as_much_as_the_mixing_law_takes(poured_kg):
    there_kg, before_c = 8.0, 37.5
    after_c = (there_kg * before_c + poured_kg * physics.COLD_C) / (there_kg + poured_kg)
    found = physics.cold_water_kg(there_kg * C, before_c - after_c, before_c)
    assert found == pytest.approx(poured_kg, rel=1e-12)


def test_ice_is_as_much_as_melts_and_warms_up():
    there_kg, before_c, ice_kg = 8.0, 37.5, 0.3
    after_c = (there_kg * C * before_c - ice_kg * FUSION) / ((there_kg + ice_kg) * C)
    found = physics.ice_kg(there_kg * C, before_c - after_c, before_c)
    assert found == pytest.approx(ice_kg, rel=1e-12)


def test_what_no_cold_water_or_ice_can_do_is_not_said():
    assert physics.cold_water_kg(8.0 * C, 2.0, 11.0) is None
    assert physics.ice_kg(8.0 * C, 12.0, 11.0) is None


def test_1500_w_at_a_known_rate_warm_a_known_volume():
    gain = 1500.0 / (8.0 * 0.995 * C)
    capacity = physics.capacity_j_per_k(1500.0, gain)
    assert physics.litres(capacity) == pytest.approx(8.0, rel=1e-12)
