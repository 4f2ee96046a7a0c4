"""The two laws that believe nothing: thermostat and fixed power."""

import math

import numpy as np
import pytest

from thermoctl.control.manual import Manual
from thermoctl.control.on_off import OnOff
from thermoctl.estimation import start
from thermoctl.ports import Situation
from thermoctl.signals import Beliefs


def at(temperature_c, setpoint_c=40.0, applied=0.0):
    return Situation(
        0.0, 1.0, temperature_c, setpoint_c, applied, start(1), np.empty(0), np.empty(0)
    )


def test_a_thermostat_switches_at_the_edges_of_its_hysteresis_only():
    law = OnOff(hysteresis_k=1.0)
    on, powers = law.start(), []
    for temperature_c in (39.8, 39.4, 40.4, 40.6, 39.6, 39.4):
        on, power = law.decide(on, at(temperature_c))
        powers.append(power)
    assert powers == [0.0, 1.0, 1.0, 0.0, 0.0, 1.0]


def test_a_thermostat_without_hysteresis_follows_the_sign_of_the_error():
    law = OnOff(hysteresis_k=0.0)
    assert law.decide(False, at(39.999)) == (True, 1.0)
    assert law.decide(True, at(40.001)) == (False, 0.0)


@pytest.mark.parametrize("unknown", [at(math.nan), at(30.0, math.nan), at(math.inf)])
def test_a_thermostat_asks_for_nothing_while_something_is_not_known(unknown):
    on, power = OnOff().decide(True, unknown)
    assert on is True
    assert math.isnan(power)


def test_manual_gives_its_power_whatever_the_temperature():
    law = Manual(power=0.3)
    powers = [law.decide(law.start(), at(t))[1] for t in (math.nan, -40.0, 200.0)]
    assert powers == [0.3] * 3


@pytest.mark.parametrize("law", [OnOff(), Manual()])
def test_neither_believes_or_remarks_anything_nor_steers_without_a_sensor(law):
    belief = law.observe(law.start(), at(30.0))
    assert belief == law.start()
    assert law.beliefs(belief, at(30.0)) == Beliefs()
    assert law.remarks(belief) == {}
    assert law.ride_s(belief) == 0.0


@pytest.mark.parametrize(
    ("name", "build"),
    [
        *(("hysteresis_k", lambda v=v: OnOff(v)) for v in (-0.1, math.nan, math.inf, "1")),
        *(("power", lambda v=v: Manual(v)) for v in (-0.1, 1.1, math.nan, True)),
    ],
)
def test_a_constructor_names_the_argument_that_is_wrong(name, build):
    with pytest.raises(ValueError, match=name):
        build()
