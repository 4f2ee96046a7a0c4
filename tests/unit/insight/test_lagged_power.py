"""The power as it is felt: late, and all of it."""

from __future__ import annotations

import numpy as np
import pytest

from thermoctl.insight.lagged_power import LaggedPower, felt


def test_a_power_that_has_always_been_there_is_felt_as_it_is():
    assert felt(np.full(100, 0.3), 18.0, 1.0) == pytest.approx(0.3)


@pytest.mark.parametrize("lag_s", [5.0, 18.0, 60.0])
def test_a_pulse_is_felt_whole_and_one_lag_late(lag_s):
    power = np.zeros(4000)
    power[100] = 1.0
    q = felt(power, lag_s, 1.0)
    assert q.sum() == pytest.approx(1.0, rel=1e-6)
    mean_s = (np.arange(4000) @ q) / q.sum() - 100.0
    assert mean_s == pytest.approx(lag_s, abs=1.5)  # dead time comes in whole samples


def test_the_same_is_felt_sample_by_sample():
    power = np.random.default_rng(1).random(300)
    lagged = LaggedPower(18.0, 2.0, float(power[0]))
    assert [lagged.after(each) for each in power] == pytest.approx(felt(power, 18.0, 2.0))
