"""From a fault of one of two sensors to what the loop makes of it, on simulated time."""

import math

import numpy as np
import pytest

from thermoctl.app.compose import loop_for, regulator_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, default_profile
from thermoctl.errors import FaultError, LinkError
from thermoctl.model.actuator import Linear
from thermoctl.model.sensor import LM335, Sensor
from thermoctl.runtime.connection import Connection
from thermoctl.runtime.loop import Loop
from thermoctl.runtime.wiring import Input, Wiring
from thermoctl.signals import ManualPower, Mode, RawSample, State
from thermoctl.testing import ManualClock, ScriptedBoard

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

LM335_AT_5_V = Sensor(LM335, 5.0)
FULL_SCALE = 32768.0
WARM = FULL_SCALE * LM335_AT_5_V.fraction(30.0)
TRIP_C = 60.0


class Tank:
    """The aquarium of the profile with a second sensor; a second is a cycle."""

    def __init__(self, seconds, seed=1, warm=True, **loop_keys):
        document = load(default_profile()).model_dump(exclude_none=True)
        (table,), (board,) = document["loops"].values(), document["boards"].values()
        board |= {"second_sensor": True, "initial_c": table["setpoint_c"] if warm else 25.0}
        table |= {"second_sensor": {**table["sensor"], "input": "temperature2"}, **loop_keys}
        self.setpoint_c, self.trip_c = table["setpoint_c"], table["trip_above_c"]
        self.clock, self.cycles = ManualClock(), []
        settings = bench_settings(load(document), seed)
        self.loop = loop_for(settings, self.clock, self.cycles.append, beside=False)
        self.run(seconds)

    @property
    def board(self):
        return self.loop.boards[0].board

    @property
    def step(self):
        return self.cycles[-1].step

    def run(self, seconds):
        for _ in range(seconds):
            self.clock.advance(1.0)
            self.loop.cycle(self.clock.now_s())

    def show(self, **shown_c):
        """Let inputs show these temperatures from now on; NaN: nothing at all."""
        read = self.board.read

        def shown(deadline_s):
            samples = dict(read(deadline_s))
            for name, value_c in shown_c.items():
                sound = samples.pop(name)
                counts = sound.full_scale * LM335_AT_5_V.fraction(value_c)
                if not math.isnan(value_c):
                    samples[name] = RawSample(sound.t_s, counts, sound.full_scale)
            return samples

        self.board.read = shown

    def events(self, since_s=0.0):
        told = [event for cycle in self.cycles for event in cycle.step.events]
        return [e for e in told if e.name.startswith("sensor.") and e.t_s > since_s]

    def water_c(self, seconds):
        return np.array([c.truth["true_temperature_c"] for c in self.cycles[-seconds:]])


# -- trips -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["temperature", "temperature2"])
def test_the_hotter_sensor_trips_in_the_first_sample_and_latches_in_the_second(name):
    tank = Tank(20)
    for request in (Mode.MANUAL, ManualPower(0.3)):
        tank.loop.ask(request)
    tank.run(20)
    assert tank.cycles[-1].accepted_power > 0.0
    tank.show(**{name: TRIP_C + 5.0})
    tank.run(1)
    assert tank.cycles[-1].accepted_power == 0.0
    assert tank.step.command.reason == "trip.over_temperature"
    assert f"got {TRIP_C + 5.0:.2f} degC" in tank.step.alarms[0].text
    tank.run(1)
    assert tank.step.state is State.LATCHED


def test_a_colder_sensor_beyond_the_lower_trip_ends_no_heating():
    tank = Tank(60, trip_below_c=5.0)
    tank.show(temperature2=0.0)
    tank.run(60)
    assert tank.step.state is State.RUN
    assert [row.code for row in tank.step.alarms] == ["sensor.disagree"]


# -- one of them gone ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["temperature", "temperature2"])
@pytest.mark.parametrize(
    ("shown_c", "what"),
    [
        pytest.param(math.nan, "missing", marks=pytest.mark.slow),
        (1000.0, "open"),
        pytest.param(-270.0, "short", marks=pytest.mark.slow),
    ],
)
def test_with_one_of_two_sensors_gone_control_goes_on(name, shown_c, what):
    tank = Tank(600)
    tank.show(**{name: shown_c})
    tank.run(900)
    assert {cycle.step.state for cycle in tank.cycles[-900:]} == {State.RUN}
    (row,) = tank.step.alarms
    which, other = ("first", "second") if name == "temperature" else ("second", "first")
    assert (row.code, row.priority, row.latched) == (f"sensor.{which}_lost", 2, False)
    assert row.text == (
        f"expected a reading of the {which} sensor, it is {what}; the {other} goes on alone"
    )
    assert np.abs(tank.water_c(900) - tank.setpoint_c).max() < 0.3


def test_with_both_gone_it_is_as_with_one():
    tank = Tank(60)
    tank.show(temperature=1000.0, temperature2=math.nan)
    tank.run(1)
    assert tank.step.state is State.SAFE
    assert tank.cycles[-1].accepted_power == 0.0
    assert tank.step.command.reason == "sensor.open"


# -- one of them drifts ----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("rate_k_per_min", [0.1, -0.1])
def test_a_drift_is_told_and_the_water_stays_within_the_limit_and_never_gets_too_hot(
    rate_k_per_min,
):
    tank = Tank(900)
    tank.board.disturb("drift", rate_k_per_min)
    tank.run(1800)
    (told, *_) = tank.events(since_s=900.0)
    told_s = told.t_s - 900.0
    off_k = tank.water_c(1800) - tank.setpoint_c
    before_k = off_k[: int(told_s)]
    print(
        f"fault 7, {rate_k_per_min:+g} K/min: told after {told_s:.0f} s; water off by "
        f"{before_k.min():+.2f} to {before_k.max():+.2f} K until then, {off_k.min():+.2f} to "
        f"{off_k.max():+.2f} K in half an hour"
    )
    assert told.name == "sensor.disagree"
    assert 600.0 <= told_s <= 780.0
    assert np.abs(before_k).max() < 1.0
    assert off_k.max() < 1.0  # a sensor that drifts up makes the water colder, never hotter
    assert {cycle.step.state for cycle in tank.cycles} == {State.RUN}
    if rate_k_per_min < 0.0:  # the hotter one is the sound one
        assert np.abs(off_k).max() < 1.0
        assert np.abs(off_k[-300:]).max() < 0.1


@pytest.mark.slow
def test_a_drift_without_end_never_brings_the_water_to_the_trip():
    tank = Tank(600)
    tank.board.disturb("drift", -10.0)
    tank.run(600)
    tank.board.disturb("drift", 10.0)
    tank.run(1200)
    hottest_c = tank.water_c(1800).max()
    print(f"10 K/min down and up again: the water reached {hottest_c:.2f} degC")
    assert hottest_c < tank.setpoint_c + 1.0
    assert tank.step.state is State.LATCHED  # the sensor shows what no water may


@pytest.mark.slow
def test_a_cold_start_with_a_sensor_of_20_s_beside_one_of_6_s_is_no_disagreement():
    document = load(default_profile()).model_dump(exclude_none=True)
    (table,), (board,) = document["loops"].values(), document["boards"].values()
    board |= {"second_sensor": True, "second_lag_s": 20.0}
    table["second_sensor"] = {**table["sensor"], "input": "temperature2"}
    cycles, clock = [], ManualClock()
    loop = loop_for(bench_settings(load(document), 1), clock, cycles.append, beside=False)
    for t in range(1800):
        clock.advance(1.0)
        if t == 1200:
            loop.boards[0].board.disturb("cold-water", 2.0)
        loop.cycle(clock.now_s())
    told = [event.name for cycle in cycles for event in cycle.step.events]
    assert not [name for name in told if name.startswith("sensor.")]
    water_c = np.array([cycle.truth["true_temperature_c"] for cycle in cycles])
    assert abs(water_c[1100:1200] - table["setpoint_c"]).max() < 0.2


# -- boards ----------------------------------------------------------------------------------------


class TwoBoards:
    """Heater and first sensor on one board, the second sensor on another."""

    def __init__(self, second_reads, same=False):
        self.clock, self.cycles, reports = ManualClock(), [], []
        heats = ScriptedBoard(self.clock, [WARM], full_scale=FULL_SCALE)
        reads = ScriptedBoard(self.clock, second_reads, full_scale=FULL_SCALE)
        heats, reads = (
            Connection(
                name, lambda b=b: b, self.clock, lambda *a, **k: reports[0](*a, **k), beside=False
            )
            for name, b in (("heats", heats), ("reads", reads))
        )
        table = {"setpoint_c": 37.5, "trip_above_c": 60.0, "mode": "manual"}
        wiring = Wiring(
            "tank",
            regulator_for(load({"loops": {"tank": table}})),
            *((reads if same else heats), "temperature", LM335_AT_5_V),
            *(heats, "heater", Linear()),
            second=Input(reads, "temperature2" if same else "temperature", LM335_AT_5_V),
        )
        self.loop = Loop([wiring], self.clock, 1.0, self.cycles.append)
        reports.append(self.loop.report)

    def run(self, seconds):
        for _ in range(seconds):
            self.loop.cycle(self.clock.now_s())
            self.clock.advance(1.0)

    @property
    def step(self):
        return self.cycles[-1].step

    def names(self):
        return [event.name for cycle in self.cycles for event in cycle.step.events]


@pytest.mark.parametrize(
    ("error", "name", "times"),
    [
        (LinkError("unplugged"), "board.lost", 20),  # this one can be opened again every time
        (FaultError("broken"), "board.silent", 1),
        (RuntimeError("a driver's bug"), "cycle.failed", 1),
    ],
)
def test_a_board_with_nothing_but_a_second_sensor_may_fail(error, name, times):
    house = TwoBoards([WARM] * 10 + [error])
    house.run(30)
    assert {cycle.step.state for cycle in house.cycles} == {State.RUN}
    assert [row.code for row in house.step.alarms] == ["sensor.second_lost"]
    assert house.names().count(name) == times


def test_a_board_that_reads_both_sensors_may_not():
    house = TwoBoards([WARM] * 10 + [LinkError("unplugged")], same=True)
    house.run(30)
    assert house.step.state is State.SAFE
    assert "board.lost" in [row.code for row in house.step.alarms]
