"""Whether a set point can be held, where a loop leads another one, or follows one."""

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.regulator.alarms import AlarmRegister
from thermoctl.regulator.balance.feasible import Feasibility
from thermoctl.regulator.balance.reach_alarms import DRIVEN
from thermoctl.regulator.balance.wanted import Wanted
from thermoctl.signals import Measurement, Mode


@pytest.mark.parametrize("led", [True, False])
def test_a_block_that_its_bath_keeps_warm_is_driven_by_nothing_that_counts(led):
    alarms = AlarmRegister()
    balance = Feasibility(1.0, alarms, lambda name, **fields: None)
    rng = np.random.default_rng(1)
    for second in range(6000):
        if balance.observe(1.0, 0.0, 37.5 + 0.05 * rng.standard_normal(), 4.0):
            balance.reckon(Wanted(20.0, 1.0, Mode.AUTO, led=led), float(second))
    assert (DRIVEN in {row.code for row in alarms.rows()}) is not led


@pytest.mark.parametrize(("leads", "beyond"), [(True, 0.0), (False, 0.3)])
def test_a_block_that_gives_more_than_was_asked_is_no_output_that_will_not_obey(leads, beyond):
    bath = {"setpoint_c": 35.0, "trip_above_c": 60.0, "mode": "auto"}
    if leads:
        bath["actuator"] = {"loop": "block", "low_c": 20.0, "high_c": 80.0}
    block = {"setpoint_c": 20.0, "trip_above_c": 95.0}
    regulator = regulator_for(load({"loops": {"bath": bath, "block": block}}), "bath")
    asked = regulator.step(Measurement(0.0, 38.0)).command.power
    seen = []
    regulator._feasibility.observe = lambda *told: seen.append(told[-1])
    regulator.applied(0.3)
    regulator.step(Measurement(1.0, 38.0))
    assert asked == 0.0
    assert seen == [pytest.approx(beyond)]
