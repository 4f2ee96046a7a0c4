"""A sensor wired the wrong way round falls as the water warms: full power must not go on."""

import math
from dataclasses import replace

import pytest

from thermoctl.app.commands.compare import contender
from thermoctl.app.settings import load
from thermoctl.app.sim import profile
from thermoctl.model.sensor import Sensor
from thermoctl.plant.acquisition import Acquisition
from thermoctl.regulator import Regulator
from thermoctl.regulator.heater.check import HeaterCheck
from thermoctl.signals import Mode, RawSample, State
from thermoctl.studies.compare.plants import plant
from thermoctl.studies.compare.stand import stand_for

_, TABLE = load(profile("aquarium")).loop()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 4])
def test_a_sensor_wired_inverted_is_named_before_the_water_is_hot(seed):
    where = plant("rig", seed)
    plant_rng, input_rng = where.sources()
    stand, input_ = stand_for(where, plant_rng), Acquisition(where.acquisition, input_rng)
    sensor = Sensor(stand.curve, where.acquisition.reference_v)
    plan = contender("adaptive", TABLE).plan_for(where)
    plan = replace(plan, setpoint_c=where.held_c, mode=Mode.AUTO, heater_check=HeaterCheck())
    regulator, power, first_c, top_c = Regulator(plan), 0.0, math.nan, -math.inf
    scale = float(where.acquisition.full_scale)
    for second in range(400):
        stand.plant.advance(1.0, stand.law.drive_for(power))
        input_.advance(1.0)
        raw = RawSample(float(second), float(input_.convert(stand.volts())), scale)
        told = sensor.measure(raw, raw.t_s)
        first_c = told.temperature_c if math.isnan(first_c) else first_c
        step = regulator.step(replace(told, temperature_c=2.0 * first_c - told.temperature_c))
        power = step.command.power
        regulator.applied(power)
        top_c = max(top_c, stand.plant.temperature_c)
    assert step.state is State.LATCHED
    assert "heater.reversed" in [alarm.code for alarm in step.alarms]
    assert top_c - first_c < 6.0
