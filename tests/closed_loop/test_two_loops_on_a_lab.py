"""Both heaters of one board, each with a loop of its own.

The second hardly needs power while it is held a few kelvin above the room, for it has the warmth of
the first. What a converter of ten bits that is asked once tells of it there is worth little.
"""

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.model.sensor import TMP36, Sensor
from thermoctl.plant.acquisition import Acquisition, AcquisitionParameters
from thermoctl.plant.lab import LabParameters, followed, lab_specimen, start, step
from thermoctl.signals import RawSample, SetPoint, State

HALF_S = 0.5
COARSE = AcquisitionParameters(bits=10, reference_v=3.3, conversions=1, pickup_v=0.0)
SLOW = LabParameters(sensor_lag_s=18.0)


class TwoLoops:
    """A board under two regulators."""

    def __init__(self, seed, setpoints_c):
        self.board = lab_specimen(SLOW, np.random.default_rng(seed), 0.15)
        self.loops = [self._loop(setpoint_c) for setpoint_c in setpoints_c]
        places = [np.random.default_rng([seed, place]) for place in (0, 1)]
        self.converters = [Acquisition(COARSE, rng) for rng in places]
        self.sensor = Sensor(TMP36, COARSE.reference_v)
        self.heat, self.powers, self.t_s = start(self.board), [0.0, 0.0], 0.0
        self.sensors_c = [self.board.room_c, self.board.room_c]
        self.events = []

    def _loop(self, setpoint_c):
        loop = {"setpoint_c": setpoint_c, "trip_above_c": 85.0, "mode": "auto"}
        return regulator_for(load({"loops": {"heater": loop}}))

    def live(self, seconds):
        for _ in range(seconds):
            self._warm()
            self._warm()
            self.t_s += 1.0
            for place, regulator in enumerate(self.loops):
                volts = TMP36.volts(self.sensors_c[place])
                counts = float(self.converters[place].convert(volts))
                raw = RawSample(self.t_s, counts, float(COARSE.full_scale))
                told = regulator.step(self.sensor.measure(raw, self.t_s))
                regulator.applied(told.command.power)
                self.powers[place] = told.command.power
                self.events += [(place, event.name) for event in told.events]
        self.last = told

    def _warm(self):
        p, before = self.board, self.heat
        for converter in self.converters:
            converter.advance(HALF_S)
        watts = self.powers[0] * p.first_w, self.powers[1] * p.second_w
        self.heat = step(p, before, watts, p.room_c, HALF_S)
        moved = zip(self.sensors_c, before, self.heat, strict=False)
        self.sensors_c = [followed(*each, HALF_S / p.sensor_lag_s) for each in moved]


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "held_c"), [(20, 30.0), (28, 27.0), (33, 27.0), (38, 30.0)])
def test_a_heater_that_was_hardly_seen_is_not_stuck_on_when_it_shows_its_strength(seed, held_c):
    lab = TwoLoops(seed, (35.0, held_c))
    lab.live(900)
    lab.loops[0].request(SetPoint(50.0))
    lab.loops[1].request(SetPoint(45.0))
    lab.live(400)
    assert lab.last.state is State.RUN
    assert (1, "heater.stuck_on") not in lab.events
    assert abs(lab.heat.second_c - 45.0) < 0.3
