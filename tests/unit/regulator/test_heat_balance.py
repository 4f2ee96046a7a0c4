"""What a load teaches of the loss, and when it is an answer of the heater."""

import pytest

from thermoctl.regulator.heater.balance import balance, brought_back
from thermoctl.regulator.heater.doubt import HeatDoubt
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen

GAIN = Gain(0.05, 0.001, 2)


def rows(power, loss, seconds=120):
    """Return readings of a heater without a lag under a constant power and loss."""
    heats_s = [power * t_s for t_s in range(0, seconds, 4)]
    return [
        Seen(4.0 * n, 40.0 + GAIN.mean * heat_s - loss * 4.0 * n, (heat_s,) * len(LAGS_S))
        for n, heat_s in enumerate(heats_s)
    ]


def readings(readings_c):
    """Return these readings in blocks of 4 s."""
    return [Seen(4.0 * n, each, (0.0,) * len(LAGS_S)) for n, each in enumerate(readings_c)]


def test_the_loss_is_what_the_heat_does_not_show():
    seen = balance(rows(0.5, 0.02), 0.0, GAIN)
    assert seen.loss == pytest.approx(0.02)
    assert seen.rates[GAIN.place] == pytest.approx(0.5)


def test_three_readings_are_too_few():
    assert balance(rows(0.5, 0.02, seconds=12), 0.0, GAIN) is None


def test_a_dip_is_brought_back_once_half_of_it_is_made_up_for():
    dip = [40.0, 39.5, 39.0]
    assert not brought_back(readings([*dip, 39.4]), 0.0, 0.01)
    assert brought_back(readings([*dip, 39.4, 39.6]), 0.0, 0.01)


def test_a_reading_in_the_air_that_flattens_is_not_brought_back():
    assert not brought_back(readings([40.0 * 0.8**n for n in range(30)]), 0.0, 0.01)


def test_noise_is_not_brought_back():
    assert not brought_back(readings([40.0, 39.98, 40.01, 39.99]), 0.0, 0.01)


def test_a_second_answer_of_late_teaches_the_loss_and_the_first_does_not():
    doubt, load = HeatDoubt(), rows(0.5, 0.02)
    doubt.trust(GAIN, load, 0.0)
    assert doubt.loss(GAIN) == 0.0
    doubt.trust(GAIN, load, 0.0)
    assert doubt.loss(GAIN) == pytest.approx(0.02)


def test_a_loss_does_not_shrink_by_an_answer():
    doubt = HeatDoubt()
    doubt.acquit(GAIN, rows(0.5, 0.02), 0.0)
    doubt.acquit(GAIN, rows(0.5, 0.01), 0.0)
    assert doubt.loss(GAIN) == pytest.approx(0.02)
