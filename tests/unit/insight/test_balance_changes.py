"""The balance of a vessel that is known to the last joule."""

from __future__ import annotations

import numpy as np
import pytest

from thermoctl.insight.changes import ChangeWatch
from thermoctl.insight.lagged_power import LaggedPower

GAIN, LOSS, LAG_S, NOISE_K = 0.045, 0.009, 18.0, 0.02
AT = 3000


def watched(samples, seed=1, befall=None, gain=GAIN, power=None):
    """Return what a watch finds on a vessel that is held at 37.5 degC.

    `befall` changes (water, loss) at a sample; `power` is given in place of what holds.
    """
    rng = np.random.default_rng(seed)
    watch = ChangeWatch(1.0, LAG_S, GAIN, LOSS / GAIN)
    lagged = LaggedPower(LAG_S, 1.0, LOSS / gain)
    water, loss, u, found = 37.5, LOSS, LOSS / gain, []
    for k in range(samples):
        water += gain * lagged.after(u) - loss
        if befall is not None:
            water, loss = befall(k, water, loss)
        reading = water + NOISE_K * rng.normal()
        each = watch.after(float(k), reading, u, NOISE_K)
        if each is not None:
            found.append(each)
        held = LOSS / gain + 0.3 * (37.5 - reading) / (gain * LAG_S)
        u = float(np.clip(held if power is None else power(k, held), 0.0, 1.0))
    return found


@pytest.mark.parametrize("step_k", [-3.0, -0.6, 0.8])
def test_heat_that_comes_or_goes_at_once_is_measured_and_dated(step_k):
    (found,) = watched(AT + 1200, befall=lambda k, T, d: (T + step_k * (k == AT), d))
    assert found.step_k == pytest.approx(step_k, abs=3.0 * found.step_sd_k)
    assert found.step_k == pytest.approx(step_k, rel=0.1)
    assert found.t_s == pytest.approx(AT, abs=20.0)
    assert found.before_c == pytest.approx(37.5, abs=0.05)


@pytest.mark.parametrize("step_k", [-3.0, 1.5])
def test_a_large_one_is_found_before_it_is_known_what_is_usual(step_k):
    early = 800
    (found,) = watched(early + 900, befall=lambda k, T, d: (T + step_k * (k == early), d))
    assert found.step_k == pytest.approx(step_k, rel=0.15)
    assert found.t_s == pytest.approx(early, abs=20.0)


def test_ice_that_takes_two_minutes_to_melt_is_one_step():
    (found,) = watched(AT + 1500, befall=lambda k, T, d: (T - 0.03 * (AT <= k < AT + 120), d))
    assert found.step_k == pytest.approx(-3.6, rel=0.06)


@pytest.mark.parametrize("more", [0.0025, -0.0025])
def test_a_loss_that_changes_for_good_is_a_slope(more):
    found = watched(AT + 1500, befall=lambda k, T, d: (T, LOSS + more * (k >= AT)))
    assert found[0].step_k is None
    assert found[0].slope_k_per_s == pytest.approx(-more, rel=0.2)
    assert found[0].t_s == pytest.approx(AT, abs=90.0)
    assert len(found) == 1


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_nothing_is_found_where_nothing_happens(seed):
    assert watched(6000, seed) == []


def test_one_bad_reading_is_no_change():
    assert (
        watched(AT + 600, befall=lambda k, T, d: (T + 8.0 * ((k == AT) - (k == AT + 1)), d)) == []
    )


def test_a_power_that_moves_is_no_change_when_the_gain_is_known():
    assert watched(AT + 600, power=lambda k, held: 0.7 if AT <= k < AT + 60 else held) == []


@pytest.mark.parametrize("share", [1.5, 2.0])
def test_a_wrong_gain_is_no_heat_that_nobody_gave(share):
    jolted = watched(
        AT + 600, gain=share * GAIN, power=lambda k, held: 1.0 if AT <= k < AT + 60 else held
    )
    assert jolted == []


def test_a_past_that_was_forgotten_is_no_reference():
    watch = ChangeWatch(1.0, LAG_S, GAIN, 0.2)
    for k in range(4000):
        if k == 2000:
            watch.forget()
        reading = 37.5 if k < 2000 else 30.0
        assert watch.after(float(k), reading, 0.0, NOISE_K) is None
    assert not watch.busy
