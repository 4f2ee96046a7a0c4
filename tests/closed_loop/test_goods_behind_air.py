"""Goods behind the air of a refrigerator, and coolers that are too weak.

The air and the walls that go with it are quick and are what is measured; the goods give off their
heat for hours.
"""

import math

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.signals import Measurement

pytestmark = pytest.mark.slow

UNREACHABLE = "setpoint.unreachable"
PERIOD_S, PARTS = 5.0, 5
ROOM_C = 22.0
LAG_S, SENSOR_S = 60.0, 20.0
NOISE_K = 0.03


class Refrigerator:
    """Air of `air_j_per_k` that loses to the room, and goods that follow it."""

    def __init__(self, setpoint_c, air_j_per_k, loss_w_per_k, cooler_w, goods=(0.0, 0.0)):
        self.air_j_per_k, self.loss_w_per_k, self.cooler_w = air_j_per_k, loss_w_per_k, cooler_w
        self.goods_j_per_k, self.goods_w_per_k = goods
        self.air_c = self.goods_c = self.sensor_c = ROOM_C
        self.given = self.power = self.t_s = 0.0
        self.rng = np.random.default_rng(1)
        loop = {"setpoint_c": setpoint_c, "mode": "auto", "period_s": PERIOD_S,
                "trip_above_c": 60.0, "trip_below_c": -60.0, "setpoint_min_c": -40.0,
                "controller": {"kind": "adaptive", "action": "cool"}}  # fmt: skip
        self.regulator = regulator_for(load({"loops": {"air": loop}}))

    def run(self, seconds):
        """Return for every sample whether the set point is said to be out of reach."""
        told = []
        for _ in range(round(seconds / PERIOD_S)):
            for _ in range(PARTS):
                self.advance(PERIOD_S / PARTS)
            self.t_s += PERIOD_S
            reading_c = self.sensor_c + NOISE_K * self.rng.standard_normal()
            step = self.regulator.step(Measurement(self.t_s, reading_c))
            self.power = step.command.power
            told.append(UNREACHABLE in {alarm.code for alarm in step.alarms if alarm.active})
        return np.array(told)

    def advance(self, span_s):
        """Move cooler, air, goods and sensor by `span_s`."""
        self.given -= math.expm1(-span_s / LAG_S) * (self.power - self.given)
        from_goods_w = self.goods_w_per_k * (self.goods_c - self.air_c)
        lost_w = self.loss_w_per_k * (self.air_c - ROOM_C) + self.cooler_w * self.given
        self.air_c += span_s * (from_goods_w - lost_w) / self.air_j_per_k
        if self.goods_j_per_k > 0.0:
            self.goods_c -= span_s * from_goods_w / self.goods_j_per_k
        self.sensor_c -= math.expm1(-span_s / SENSOR_S) * (self.air_c - self.sensor_c)


@pytest.mark.parametrize(
    ("cooler_w", "goods", "most_min"),
    [(90.0, (40e3, 8.0), 40.0), (70.0, (120e3, 15.0), 55.0), (250.0, (100e3, 20.0), 25.0)],
)
def test_goods_that_are_still_warm_are_soon_no_set_point_out_of_reach(cooler_w, goods, most_min):
    told = Refrigerator(5.0, 15e3, 1.5, cooler_w, goods).run(4 * 3600)
    assert told.sum() * PERIOD_S / 60.0 < most_min
    assert not told[-1]


@pytest.mark.parametrize(
    ("setpoint_c", "air_j_per_k", "loss_w_per_k", "cooler_w", "told_min"),
    [
        (-5.0, 2.1e3, 3.0, 60.0, 20.0),
        (-5.0, 8.4e3, 4.0, 80.0, 32.0),
        (2.0, 33e3, 6.0, 100.0, 111.0),
    ],
)
def test_too_weak_a_cooler_of_one_mass_is_told_as_soon_as_ever_and_once(
    setpoint_c, air_j_per_k, loss_w_per_k, cooler_w, told_min
):
    told = Refrigerator(setpoint_c, air_j_per_k, loss_w_per_k, cooler_w).run(5 * 3600)
    first = int(np.argmax(told))
    assert (first + 1) * PERIOD_S / 60.0 < told_min
    assert told[first:].all()
