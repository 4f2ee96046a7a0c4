"""A sound heater under a load, and at a slow period: it gets warm, and is hardly questioned."""

from dataclasses import replace

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.model.sensor import TMP36, Sensor
from thermoctl.plant.acquisition import Acquisition
from thermoctl.plant.lab import followed, start, step
from thermoctl.signals import RawSample, State
from thermoctl.studies.compare.plants import plant

HALF_S = 0.5
WINDY = 2.5
"""Convection with a fan, as a multiple of that without."""


class Lab:
    """A board that nothing is told of, held at 45 degC from room temperature."""

    def __init__(self, seed, period_s):
        where = plant("tclab", seed)
        loop = {"setpoint_c": 45.0, "trip_above_c": 85.0, "period_s": period_s, "mode": "auto"}
        self.regulator = regulator_for(load({"loops": {"lab": loop}}))
        self.parameters, self.period_s = where.parameters, period_s
        self.acquisition = Acquisition(where.acquisition, np.random.default_rng(seed))
        self.sensor = Sensor(TMP36, where.acquisition.reference_v)
        self.scale = float(where.acquisition.full_scale)
        self.heat = start(self.parameters)
        self.sensor_c, self.t_s, self.power, self.dip_k = self.heat.first_c, 0.0, 0.0, 0.0
        self.questions, self.state = 0, State.RUN

    def live(self, seconds):
        """Go on for some time, and keep how far the heater fell below the set point."""
        self.dip_k, end_s = 0.0, self.t_s + seconds
        while self.t_s < end_s:
            for _ in range(round(self.period_s / HALF_S)):
                self._warm()
            self.t_s += self.period_s
            counts = float(self.acquisition.convert(TMP36.volts(self.sensor_c)))
            raw = RawSample(self.t_s, counts, self.scale)
            told = self.regulator.step(self.sensor.measure(raw, self.t_s))
            self.power = round(255.0 * told.command.power) / 255.0
            self.regulator.applied(self.power)
            self.questions += sum(event.name == "heater.questioned" for event in told.events)
            self.dip_k, self.state = max(self.dip_k, 45.0 - self.heat.first_c), told.state

    def _warm(self):
        p, before_c = self.parameters, self.heat.first_c
        self.acquisition.advance(HALF_S)
        self.heat = step(p, self.heat, (self.power * p.first_w, 0.0), p.room_c, HALF_S)
        after_c, share = self.heat.first_c, HALF_S / p.sensor_lag_s
        self.sensor_c = followed(self.sensor_c, before_c, after_c, share)

    def blow(self):
        """Switch a fan on."""
        film = WINDY * self.parameters.film_w_per_m2_k
        self.parameters = replace(self.parameters, film_w_per_m2_k=film)


def settled(seed, period_s):
    """Return a board that has had twenty minutes to warm up."""
    lab = Lab(seed, period_s)
    lab.live(1200)
    return lab


@pytest.mark.parametrize(("seed", "period_s"), [(0, 10.0), (3, 10.0), (0, 20.0), (4, 20.0)])
def test_a_lab_at_a_slow_period_gets_warm_without_a_question(seed, period_s):
    lab = settled(seed, period_s)
    assert lab.questions == 0
    assert abs(lab.heat.first_c - 45.0) < 0.3


@pytest.mark.parametrize(
    ("seed", "period_s", "dip_k"), [(1, 1.0, 2.0), (4, 1.0, 1.6), (1, 5.0, 3.4), (0, 20.0, 6.2)]
)
@pytest.mark.slow
def test_a_fan_that_is_made_up_for_is_no_reason_to_ask(seed, period_s, dip_k):
    lab = settled(seed, period_s)
    lab.blow()
    lab.live(1200)
    assert lab.state is State.RUN
    assert lab.questions == 0
    assert lab.dip_k < dip_k
