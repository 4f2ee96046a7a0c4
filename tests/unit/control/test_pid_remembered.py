"""The gains of a PID over a restart."""

import json
import math

import numpy as np
import pytest

from thermoctl.control.pid import Pid, PidBelief
from thermoctl.control.pid.autotune import Found, Tuning
from thermoctl.control.pid.simc import Gains
from thermoctl.estimation import start
from thermoctl.ports import Situation

FOUND = Found(Gains(0.4, 120.0), ".04 K/s at full power", 0.04, 0.2)
LEARNT = PidBelief(tuning=Tuning(outcome=FOUND))
NOTHING, PAST = start(n=1), np.zeros(1)


def situation(temperature_c, setpoint_c=40.0):
    return Situation(0.0, 1.0, temperature_c, setpoint_c, 0.0, NOTHING, PAST, PAST, temperature_c)


def test_nothing_is_remembered_before_a_test_has_found_something():
    assert Pid().remember(Pid().start()) is None
    assert Pid(tuning="fixed").remember(Pid(tuning="fixed").start()) is None


@pytest.mark.parametrize("tuning", ["simc", "relay"])
def test_gains_that_were_found_are_in_force_again(tuning):
    law = Pid(tuning=tuning)
    kept = json.loads(json.dumps(law.remember(LEARNT)))
    again = law.start_from(kept, 3600.0)
    assert law.gains(again) == FOUND.gains
    assert law.origin(again) == "stored"
    assert law.origin(law.start()) == "new"


def test_at_the_set_point_they_steer_at_once():
    law = Pid()
    fresh, again = law.start(), law.start_from(law.remember(LEARNT), 0.0)
    powers = [law.decide(law.observe(each, situation(39.0)), situation(39.0))[1]
              for each in (fresh, again)]  # fmt: skip
    assert powers[1] > 3.0 * powers[0] > 0.0


def test_a_warm_up_tells_anew():
    law = Pid()
    again = law.start_from(law.remember(LEARNT), 0.0)
    cold = situation(20.0)
    belief, power = law.decide(law.observe(again, cold), cold)
    assert power == 1.0
    assert belief.tuning.run is not None
    assert law.gains(belief) == FOUND.gains


def test_a_relay_that_was_done_is_not_done_again():
    law = Pid(tuning="relay")
    again = law.start_from(law.remember(LEARNT), 0.0)
    near = situation(39.9)
    assert law.decide(law.observe(again, near), near)[0].tuning.run is None


BAD = {
    "another way": {"tuning": "relay"},
    "another form": {"tuned_form": "pid"},
    "another period": {"period_s": 5.0},
    "no gain": {"gain_per_k": 0.0},
    "a gain that cools": {"gain_per_k": -0.4},
    "a gain no rule gives": {"gain_per_k": 60.0},
    "a gain of NaN": {"gain_per_k": math.nan},
    "no integral": {"integral_s": 0.0},
    "an endless integral": {"integral_s": math.inf},
    "a derivative longer than the integral": {"derivative_s": 200.0},
    "a slope no heater has": {"slope_k_per_s": 3.0},
    "a text as slope": {"slope_k_per_s": "steep"},
}


@pytest.mark.parametrize("changed", BAD.values(), ids=BAD)
def test_gains_that_are_implausible_or_of_another_test_are_refused_by_name(changed):
    law, (name,) = Pid(), changed
    with pytest.raises(ValueError, match=f"expected .*{name}"):
        law.start_from({**law.remember(LEARNT), **changed}, 0.0)
