"""What a load teaches of the loss, and when it is an answer of the heater."""

import pytest

from thermoctl.regulator.heater.balance import balance, brought_back
from thermoctl.regulator.heater.check import HeaterCheck
from thermoctl.regulator.heater.doubt import HeatDoubt
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen
from thermoctl.regulator.heater.watch import HeaterWatch
from thermoctl.regulator.limits import Limits
from thermoctl.regulator.supervisor import Supervisor

GAIN = Gain(0.05, 0.001, 2)
LIMITS = Limits(200.0, -50.0, -50.0, 200.0)


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


def test_a_loss_does_not_shrink_by_an_answer():
    doubt = HeatDoubt()
    doubt.acquit(GAIN, rows(0.5, 0.02), 0.0)
    doubt.acquit(GAIN, rows(0.5, 0.01), 0.0)
    assert doubt.loss(GAIN) == pytest.approx(0.02)


def unheard(name, **fields):
    """Take an event, and tell nobody."""


def watch_of_a_dip():
    """Return a watch that has seen a load, and more power that brings the reading back."""
    watch = HeaterWatch(HeaterCheck(), 1.0, Supervisor(LIMITS, unheard), unheard)
    reading_c, heat_s = 40.0, 0.0
    for n in range(60):
        power = 0.4 if n < 25 else 1.0
        load = 0.02 if n < 20 else 0.04
        heat_s += 4.0 * power
        reading_c += 4.0 * (GAIN.mean * power - load)
        watch._rows.append(Seen(4.0 * n, reading_c + 0.005 * (-1) ** n, (heat_s,) * len(LAGS_S)))
    return watch


@pytest.mark.parametrize(
    ("spoil", "acquits"),
    [
        (lambda watch: None, True),
        (lambda watch: watch._verdicts.note(watch._t_s), False),
        (lambda watch: setattr(watch, "_distrusted_k", 1.0), False),
    ],
)
def test_what_gave_a_bad_answer_of_late_is_not_acquitted(spoil, acquits):
    watch, doubt = watch_of_a_dip(), HeatDoubt()
    doubt.since = watch._rows[25]
    spoil(watch)
    assert watch._acquits(GAIN, doubt, 0.01) is acquits
