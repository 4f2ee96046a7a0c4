"""Heat that goes into a wall, and what was told too soon: neither is told for sure."""

import math

import numpy as np
import pytest

from thermoctl.app.compose import regulator_for
from thermoctl.app.settings import load
from thermoctl.quantities import Uncertain
from thermoctl.regulator.alarms import AlarmRegister
from thermoctl.regulator.balance.feasible import Feasibility
from thermoctl.regulator.balance.foretold import Settling, Slip
from thermoctl.regulator.balance.wanted import Wanted
from thermoctl.regulator.guard import Failure
from thermoctl.signals import Feasible, Measurement, Mode

SETPOINT_C = 37.0
AIR_C = 22.0
GAIN = 0.035
HOLDS_PER_K = 0.004


class Bench:
    """Water with a wall as heavy as itself, and the balance that is kept of it."""

    def __init__(self, follows_s, seed=1):
        self.water_c = self.wall_c = AIR_C
        self.follows_s, self.t_s = follows_s, 0.0
        self.rng = np.random.default_rng(seed)
        self.alarms, self.events = AlarmRegister(), []
        self.feasibility = Feasibility(1.0, self.alarms, self._emit)

    def _emit(self, name, **fields):
        self.events.append((name, fields))

    def run(self, seconds, setpoint_c=SETPOINT_C, power=None, seen=True):
        """Return what is told after each stretch; `power` is that of a controller if None."""
        told = []
        for _ in range(seconds):
            given = min(max(2.0 * (setpoint_c - self.water_c), 0.0), 1.0)
            given = given if power is None else power
            soaked_k = (self.water_c - self.wall_c) / self.follows_s
            lost_k = GAIN * HOLDS_PER_K * (self.water_c - AIR_C)
            self.water_c += GAIN * given - lost_k - soaked_k
            self.wall_c += soaked_k
            self.t_s += 1.0
            reading_c = self.water_c + 0.02 * self.rng.standard_normal()
            if self.feasibility.observe(1.0, given, reading_c if seen else math.nan, 4.0):
                self.feasibility.reckon(Wanted(setpoint_c, 1.0, Mode.AUTO), self.t_s)
                told.append(self.feasibility.known)
        return told


@pytest.mark.parametrize("follows_s", [100.0, 200.0, 330.0])
def test_heat_that_a_wall_takes_up_is_not_told_for_loss(follows_s):
    told = Bench(follows_s).run(3600)
    truly = HOLDS_PER_K * (SETPOINT_C - AIR_C)
    known = [each for each in told if math.isfinite(each.holding_power)]
    wrong = [
        (each.holding_power, each.holding_sd)
        for each in known
        if abs(each.holding_power - truly) > 3.0 * each.holding_sd
    ]
    assert wrong == []
    assert len(known) > 200
    assert known[-1].holding_sd < 0.02


@pytest.mark.parametrize(("follows_s", "setpoint_c"), [(300.0, 60.0), (500.0, 80.0)])
def test_a_wall_that_is_still_cold_puts_no_set_point_out_of_reach(follows_s, setpoint_c):
    bench = Bench(follows_s)
    bench.run(3600, setpoint_c)
    assert bench.water_c == pytest.approx(setpoint_c, abs=2.0)
    assert bench.events == []


def test_without_readings_nothing_is_told_and_no_alarm_comes_or_goes():
    bench = Bench(150.0)
    bench.run(1800)
    assert math.isfinite(bench.feasibility.known.holding_power)
    told = bench.run(1800, seen=False)
    assert math.isfinite(told[3].holding_power)
    assert {repr(each) for each in told[8:]} == {repr(Feasible())}  # NaN equals nothing
    bench.run(1800, setpoint_c=400.0, seen=False)
    assert bench.events == []
    assert math.isfinite(bench.run(60)[-1].holding_power)


def test_what_cannot_be_reckoned_with_is_forgotten_and_said_once():
    bench = Bench(150.0)
    bench.run(600)
    for _ in range(2):
        bench.feasibility.fail(Failure("expected a result, got OverflowError", "where"))
    assert bench.feasibility.belief is None
    assert repr(bench.feasibility.known) == repr(Feasible())  # NaN equals nothing
    assert [name for name, _ in bench.events] == ["balance.failed"]


def test_an_arrival_that_does_not_come_nearer_is_doubted_by_as_much_as_it_is_late():
    slip = Slip()
    for t_s in range(0, 110, 10):
        told = slip.doubted(Uncertain(20.0, 5.0), 40.0, float(t_s))
    assert told.mean == 20.0
    assert 80.0 < told.sd < 101.0
    assert slip.doubted(Uncertain(20.0, 5.0), 41.0, 110.0).sd == 5.0


def test_an_arrival_that_comes_as_told_is_not_doubted():
    slip = Slip()
    for t_s in range(0, 100, 10):
        told = slip.doubted(Uncertain(100.0 - t_s, 5.0), 40.0, float(t_s))
        assert told.sd == 5.0
    assert slip.doubted(Uncertain(0.0, 0.0), 40.0, 100.0) == Uncertain(0.0, 0.0)


def test_a_holding_power_that_moves_is_known_no_better_than_it_moved():
    settling = Settling()
    settling.doubted(Uncertain(0.6, 0.01), 40.0, 0.0)
    assert settling.doubted(Uncertain(0.4, 0.01), 40.0, 10.0).sd == pytest.approx(0.2, rel=0.05)
    for t_s in range(20, 6000, 10):
        told = settling.doubted(Uncertain(0.4, 0.01), 40.0, float(t_s))
    assert told.sd == pytest.approx(0.01, rel=0.01)
    assert settling.doubted(Uncertain(0.7, 0.01), 60.0, 6000.0).sd == 0.01


def test_a_balance_that_raises_costs_the_loop_neither_its_step_nor_its_heat(monkeypatch):
    def failing(*_):
        raise OverflowError("math range error")

    loop = {"mode": "auto", "setpoint_c": 40.0, "trip_above_c": 95.0}
    regulator = regulator_for(load({"loops": {"tank": loop}}))
    monkeypatch.setattr("thermoctl.regulator.balance.heat_loss.after", failing)
    steps = [regulator.step(Measurement(float(t_s), 22.0 + 0.01 * t_s)) for t_s in range(60)]
    assert [event.name for step in steps for event in step.events if "fail" in event.name] == [
        "balance.failed"
    ]
    assert steps[-1].command.power > 0.0
