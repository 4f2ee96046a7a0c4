"""The fastest approach, against closed forms and against whoever tries to beat it."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from thermoctl.plant import handling, thermal
from thermoctl.plant.parameters import TankParameters
from thermoctl.studies.compare.linear import rest
from thermoctl.studies.compare.swift import NoiselessTank, swiftest

RIG = TankParameters()
KNOWN = NoiselessTank.of(RIG)


@dataclass(frozen=True)
class FirstOrder:
    """T' = gain u - T / tau: no heat that is still under way."""

    gain: float
    tau_s: float
    period_s: float = 1.0

    def advance(self, heat, power):
        settled = self.gain * self.tau_s * power
        return settled + (heat - settled) * math.exp(-self.period_s / self.tau_s)

    def bulk_c(self, heat):
        return heat


@dataclass(frozen=True)
class Lagging:
    """T' = q, q' = (u - q) / tau: all heat that was given arrives, later."""

    tau_s: float
    period_s: float = 0.01

    def advance(self, heat, power):
        T, q = heat
        fade = math.exp(-self.period_s / self.tau_s)
        arrived = power * self.period_s + (q - power) * self.tau_s * (1.0 - fade)
        return T + arrived, power + (q - power) * fade

    def bulk_c(self, heat):
        return heat[0]


def test_a_first_order_plant_is_heated_until_it_is_there():
    plant = FirstOrder(gain=0.04, tau_s=1500.0)
    way = swiftest(plant, 0.0, 12.5, band_k=0.1, peak_k=0.1)
    until = -1500.0 * math.log(1.0 - 12.4 / 60.0)
    assert way.settled_s == pytest.approx(until, abs=1e-3)
    assert plant.bulk_c(0.0) + 12.6 == pytest.approx(
        60.0 * (1.0 - math.exp(-way.switched_s / 1500.0)), abs=0.04 * plant.period_s
    )


def test_heat_under_way_is_counted_before_it_arrives():
    plant, peak = Lagging(tau_s=5.0), 20.0
    way = swiftest(plant, (0.0, 0.0), peak, band_k=0.1, peak_k=0.0)
    # In the end the temperature is the time for which there was power.
    assert way.switched_s == pytest.approx(peak, abs=1e-2)
    q = 1.0 - math.exp(-way.switched_s / 5.0)
    arrives = way.switched_s + 5.0 * math.log(5.0 * q / 0.1)
    assert way.settled_s == pytest.approx(arrives, abs=0.05)


def test_a_set_point_beyond_full_power_is_out_of_reach():
    assert swiftest(FirstOrder(gain=0.01, tau_s=1000.0, period_s=60.0), 0.0, 10.5) is None


def test_the_water_coasts_to_the_edge_of_the_band_and_no_farther():
    way = swiftest(KNOWN, thermal.start(RIG), 37.5)
    heat, highest_c = thermal.start(RIG), 0.0
    for second in range(800):
        heat = KNOWN.advance(heat, min(max(way.switched_s - second, 0.0), 1.0))
        highest_c = max(highest_c, KNOWN.bulk_c(heat))
    assert highest_c == pytest.approx(37.6, abs=1e-4)


def test_whoever_gives_less_or_later_arrives_no_sooner():
    rng, held = np.random.default_rng(5), rest(RIG, 37.5)
    poured = handling.pour(held.heat, RIG.vessel, 1.0, 10.0)
    best = swiftest(KNOWN, poured, 37.5)
    for _ in range(40):
        heat, outside = poured, 0
        switch_s, level = rng.uniform(80.0, 125.0), rng.uniform(0.9, 1.0)
        for second in range(1, 240):
            power = level if second <= switch_s else held.power * rng.uniform(0.0, 2.0)
            heat = KNOWN.advance(heat, power)
            if abs(KNOWN.bulk_c(heat) - 37.5) > 0.1:
                outside = second
        assert outside >= best.settled_s - 1.0


def test_passing_the_set_point_is_forbidden_at_a_price():
    within = swiftest(KNOWN, thermal.start(RIG), 37.5)
    below = swiftest(KNOWN, thermal.start(RIG), 37.5, peak_k=0.0)
    assert within.settled_s < below.settled_s < within.settled_s + 5.0
