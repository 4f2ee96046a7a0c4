"""Rules for gains, against numbers in print and the laws they come from."""

import math

import pytest

from thermoctl.control.pid.simc import Gains, Limit, Process, simc, tyreus_luyben

# Skogestad's second example has lags 2, 1, .4, .2 and thrice .05, a zero at .08 and an inverse
# response of .3, which count as dead time.
PRINTED = Process(0.5, 0.3 - 0.08, (2.0, 1.0, 0.4, 0.2, 0.05, 0.05, 0.05))


def test_the_half_rule_gives_the_numbers_in_print():
    one, two = PRINTED.reduced(1), PRINTED.reduced(2)
    assert one.dead_s == pytest.approx(1.47)
    assert one.lags_s == pytest.approx((2.5,))
    assert two.dead_s == pytest.approx(0.77)
    assert two.lags_s == pytest.approx((2.0, 1.2))


def test_halving_a_lag_leaves_the_steady_gain_as_it_was():
    one = PRINTED.reduced(1)
    assert one.slope_k_per_s * one.lags_s[0] == pytest.approx(0.5 * 2.0)


def test_simc_gives_the_gains_in_print():
    gains = simc(PRINTED)
    assert gains.gain_per_k == pytest.approx(0.85, abs=0.005)
    assert gains.integral_s == pytest.approx(2.5)
    series = Gains.series(1.30, 2.0, 1.2)
    with_derivative = simc(PRINTED, derivative=True)
    assert with_derivative.gain_per_k == pytest.approx(series.gain_per_k, rel=0.005)
    assert with_derivative.integral_s == pytest.approx(series.integral_s)
    assert with_derivative.derivative_s == pytest.approx(series.derivative_s)


def test_an_integrating_plant_gets_half_of_slope_times_dead_time_and_eight_dead_times():
    gains = simc(Process(0.04, 15.0))
    assert gains == Gains(0.5 / (0.04 * 15.0), 8.0 * 15.0)


def test_a_slower_closed_loop_has_the_gains_of_more_dead_time():
    slower = simc(Process(0.04, 10.0), closed_s=20.0)
    assert slower == simc(Process(0.04, 15.0))


@pytest.mark.parametrize("s", [0.3j, 0.02 + 0.1j, 5.0])
def test_the_series_form_is_the_same_law_as_the_standard_one(s):
    gains = Gains.series(3.0, 20.0, 4.0)
    standard = gains.gain_per_k * (1.0 + 1.0 / (gains.integral_s * s) + gains.derivative_s * s)
    parallel = gains.Kp + gains.Ki / s + gains.Kd * s
    assert standard == pytest.approx(3.0 * (1.0 + 1.0 / (20.0 * s)) * (1.0 + 4.0 * s))
    assert parallel == pytest.approx(standard)


def test_on_a_plant_that_integrates_both_rules_say_nearly_the_same():
    limit = Limit(0.5 * math.pi / (0.04 * 15.0), 4.0 * 15.0)
    ours, theirs = simc(Process(0.04, 15.0)), tyreus_luyben(limit)
    assert theirs.gain_per_k == pytest.approx(ours.gain_per_k, rel=0.02)
    assert theirs.integral_s == pytest.approx(ours.integral_s, rel=0.11)


def test_tyreus_and_luyben_give_a_derivative_more_gain():
    limit = Limit(2.2, 63.0)
    assert tyreus_luyben(limit, derivative=True) == Gains(2.2 / 2.2, 2.2 * 63.0, 10.0)
    assert tyreus_luyben(limit).gain_per_k < 1.0


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("slope_k_per_s", (0.0, 1.0)),
        ("slope_k_per_s", (math.nan, 1.0)),
        ("dead_s", (1.0, 0.0)),
        ("dead_s", (1.0, math.inf)),
        ("lags_s", (1.0, 1.0, ())),
        ("lags_s", (1.0, 1.0, (1.0, 2.0))),
        ("lags_s", (1.0, 1.0, (1.0, -2.0))),
    ],
)
def test_a_plant_that_is_none_is_refused_by_name(name, arguments):
    with pytest.raises(ValueError, match=name):
        Process(*arguments)
