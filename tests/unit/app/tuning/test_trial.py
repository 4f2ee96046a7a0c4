"""A run through a test signal: bounded by the supervisor, and off at every end."""

import math
from itertools import pairwise

import pytest

from thermoctl.app.compose import loop_for, regulator_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, default_profile
from thermoctl.app.tuning.trial import Ending, Trial, alone, plan
from thermoctl.errors import ConfigError, LinkError, TransientError
from thermoctl.model.actuator import Linear
from thermoctl.model.sensor import LM335, Sensor
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.runtime.connection import Connection
from thermoctl.runtime.loop import Loop, Wiring
from thermoctl.signals import Alarm, Mode, RawSample, State
from thermoctl.testing import ManualClock, ScriptedBoard

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

COLD, WARM, HOT, OPEN = 600.0, 634.0, 690.0, 1023.0
"""Counts of 1024 at 5 V: 19.8, 36.4 and 63.8 degC, and no sensor."""

COUNTS_PER_K = 0.010 / 5.0 * 1024.0

TABLE = {"setpoint_c": 37.5, "trip_above_c": 60.0, "setpoint_min_c": 5.0}


class HeatedBoard(ScriptedBoard):
    """A board that shows water which full power warms by 50 mK/s and the room cools by 20."""

    def read(self, deadline_s):
        self._reads[0] += COUNTS_PER_K * (0.05 * self.power - 0.02)
        return super().read(deadline_s)


def on_script(
    reads, writes=(None,), duration_s=400.0, watch=None, kind_of_board=ScriptedBoard, **keys
):
    """A trial of a loop on a scripted board, and that board."""
    clock = ManualClock()
    board = kind_of_board(clock, reads=reads, writes=writes)
    settings = alone(load({"loops": {"tank": TABLE | keys}}), "tank")

    def build(publish):
        reports = []
        wire = Connection(
            "daq", lambda: board, clock, lambda *a, **k: reports[0](*a, **k), beside=False
        )
        regulator = regulator_for(settings)
        loop = Loop(
            [
                Wiring(
                    "tank",
                    regulator,
                    wire,
                    "temperature",
                    Sensor(LM335, 5.0),
                    wire,
                    "heater",
                    Linear(),
                )
            ],
            clock,
            1.0,
            publish,
        )
        reports.append(loop.report)
        return loop

    excitation = plan(settings, "tank", (0.1, 0.8), 4.0, duration_s)
    options = {} if watch is None else {"watch": watch}
    return Trial("tank", excitation, build, clock, **options), board


def simulated(duration_s=900.0, band_k=2.0, powers=None, seed=1, source=None, watch=None):
    """A trial on a simulated tank, and every cycle of it."""
    settings = alone(bench_settings(source, seed), "tank")
    clock, cycles = SimulatedClock(), []
    excitation = plan(settings, "tank", powers, band_k, duration_s)

    def take(cycle, share):
        cycles.append(cycle)
        if watch is not None:
            watch(cycle, share)

    trial = Trial(
        "tank",
        excitation,
        lambda publish: loop_for(settings, clock, publish, beside=False),
        clock,
        take,
    )
    return trial, cycles


def given_powers(board):
    return [write.outputs["heater"] for write in board.written]


def test_a_run_to_its_end_gives_both_powers_and_ends_off():
    trial, board = on_script([WARM], kind_of_board=HeatedBoard)
    outcome = trial.run()
    assert outcome.ending is Ending.FINISHED
    assert outcome.off_confirmed
    assert {0.1, 0.8} <= set(given_powers(board))
    assert given_powers(board)[-1] == 0.0
    assert board.closed == 1
    record = trial.record.finish()
    assert len(record.t_s) == 401
    assert set(record.u[2:]) == {0.1, 0.8}


def test_a_run_that_is_interrupted_ends_off_and_keeps_its_samples():
    def interrupt(cycle, share):
        if cycle.step.t_s > 100.0:
            trial.interrupt()

    trial, board = on_script([COLD], watch=interrupt)
    outcome = trial.run()
    assert outcome.ending is Ending.INTERRUPTED
    assert given_powers(board)[-2:] == [0.8, 0.0]
    assert 100 < len(trial.record.finish().t_s) < 105


@pytest.mark.parametrize(
    ("reads", "why"),
    [
        ([COLD] * 50 + [HOT], "trip.over_temperature"),
        ([COLD] * 50 + [OPEN], "sensor.open"),
        ([COLD] * 50 + [None], "sensor.missing"),
        ([COLD] * 50 + [TransientError("torn")], "sensor.missing"),
    ],
)
def test_a_fault_ends_the_run_off_and_says_which(reads, why):
    trial, board = on_script(reads)
    outcome = trial.run()
    assert outcome.ending is Ending.FAULT
    assert outcome.why.startswith(why)
    assert given_powers(board)[-1] == 0.0
    assert len(board.written) < 70


def test_a_board_that_never_answers_gets_no_power():
    trial, board = on_script([LinkError("nobody there")])
    outcome = trial.run()
    assert outcome.ending is Ending.FAULT
    assert not any(given_powers(board))


def test_a_board_that_is_lost_confirms_nothing():
    trial, board = on_script([COLD] * 50 + [LinkError("gone")])
    outcome = trial.run()
    assert (outcome.ending, outcome.why) == (Ending.FAULT, "board.lost: gone")
    assert not outcome.off_confirmed
    assert board.closed == 1  # which is where a driver writes its safe values


def test_a_board_that_does_not_take_the_last_zero_is_told_of():
    taken = [None] * 60 + [TransientError("torn")]
    trial, board = on_script([COLD], writes=taken, watch=lambda cycle, share: end_late(cycle))

    def end_late(cycle):
        if cycle.step.t_s >= 60.0:
            trial.interrupt()

    assert not trial.run().off_confirmed
    assert board.closed == 1


def test_whoever_watches_and_fails_ends_the_run_off():
    def fail(cycle, share):
        if cycle.step.t_s > 20.0:
            raise OSError("no space")

    trial, board = on_script([COLD], watch=fail)
    with pytest.raises(OSError, match="no space"):
        trial.run()
    assert given_powers(board)[-1] == 0.0
    assert len(board.written) < 30


def test_a_missing_reading_asks_for_low_power():
    trial, board = on_script([COLD] * 50 + [None] + [COLD] * 400, duration_s=300.0)
    trial.run()
    powers = given_powers(board)
    assert 0.1 in powers
    assert set(powers) == {0.0, 0.1, 0.8}
    assert trial.record.finish().skipped == 1


def test_a_stale_reading_is_no_sample():
    stale = {"temperature": RawSample(-60.0, COLD, 1024.0)}
    trial, _ = on_script([COLD] * 50 + [stale] + [COLD] * 400, duration_s=300.0)
    trial.run()
    record = trial.record.finish()
    assert record.skipped == 1
    assert 50.0 not in record.t_s


def test_a_run_whose_cycles_nobody_publishes_ends_in_time():
    clock = ManualClock()
    settings = alone(bench_settings(), "tank")
    trial = Trial(
        "tank",
        plan(settings, "tank", None, 2.0, 300.0),
        lambda publish: loop_for(settings, clock, lambda cycle: None, beside=False),
        clock,
    )
    assert trial.run().ending is Ending.FINISHED
    assert 300.0 < clock.now_s() < 320.0


def test_the_rate_limit_of_the_supervisor_is_in_force():
    trial, board = on_script([COLD], rise_per_s=0.05)
    trial.run()
    powers = given_powers(board)
    assert max(b - a for a, b in pairwise(powers)) <= 0.05 + 1e-9


def test_the_mode_is_manual_all_along():
    trial, cycles = simulated(300.0)
    trial.run()
    assert {cycle.step.mode for cycle in cycles} == {Mode.MANUAL}
    assert {cycle.step.state for cycle in cycles} == {State.RUN}


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("band_k", [1.0, 4.0])
def test_the_band_is_passed_by_no_more_than_the_element_holds(seed, band_k):
    trial, cycles = simulated(seed=seed, band_k=band_k)
    outcome = trial.run()
    assert outcome.ending is Ending.FINISHED
    true_c = [cycle.truth["true_temperature_c"] for cycle in cycles]
    stored_k = 0.0449 * 20.0  # full power into 8 l for as long as element and sensor lag
    assert max(true_c) < 37.5 + stored_k
    assert outcome.hottest_c == pytest.approx(max(true_c), abs=0.15)
    reached = next(t for t, each in enumerate(true_c) if each > 37.5 - band_k)
    assert min(true_c[reached:]) > 37.5 - band_k - 0.5


@pytest.mark.parametrize(("volume_l", "heater_w"), [(1.0, 600.0), (8.0, 1500.0)])
def test_heat_that_the_controller_knows_to_be_under_way_stays_within_the_band(volume_l, heater_w):
    settings = bench_settings(default_profile(), 1)
    board = settings.boards["daq"].model_copy(update={"volume_l": volume_l, "heater_w": heater_w})
    trial, cycles = simulated(source=settings.model_copy(update={"boards": {"daq": board}}))
    trial.run()
    true_c = [cycle.truth["true_temperature_c"] for cycle in cycles]
    assert 37.0 < max(true_c) < 37.5  # without, the litre comes to 39 degC
    power = trial.record.finish().u
    assert sum(abs(b - a) > 0.5 for a, b in pairwise(power)) >= 12


def test_both_powers_are_given_again_and_again_within_the_band():
    trial, _ = simulated(1200.0)
    trial.run()
    power = trial.record.finish().u
    changes = [t for t in range(1, len(power)) if abs(power[t] - power[t - 1]) > 0.5]
    assert len(changes) >= 12


def test_a_latch_of_an_earlier_run_gets_no_power():
    settings = alone(bench_settings(seed=1), "tank")
    clock = SimulatedClock()
    latch = {"tank": Alarm("trip.over_temperature", 9, 1, 0.0, "hot", latched=True)}
    trial = Trial(
        "tank",
        plan(settings, "tank", None, 2.0, 300.0),
        lambda publish: loop_for(settings, clock, publish, beside=False, latched=latch),
        clock,
    )
    outcome = trial.run()
    assert outcome.ending is Ending.FAULT
    assert "latched before this start" in outcome.why


def test_only_the_named_loop_and_its_boards_are_touched():
    content = {
        "boards": {name: {"kind": "null"} for name in ("a", "b", "spare")},
        "loops": {
            name: TABLE | {"sensor": {"board": board}, "actuator": {"board": board}, "mode": "auto"}
            for name, board in (("left", "a"), ("right", "b"))
        },
    }
    single = alone(load(content), "right")
    assert list(single.loops) == ["right"]
    assert list(single.boards) == ["b"]
    assert single.loops["right"].mode is Mode.MANUAL


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"powers": (0.0, 0.9), "power_max": 0.5}, "powers up to 0.5, .* got 0.9"),
        ({"powers": (0.5, 0.5)}, "low < high"),
        ({"band_k": 40.0}, "within the set points .* at least 5 degC, got -2.5 to 37.5"),
        ({"band_k": 0.05}, "a band wider than"),
        ({"trip_above_c": 39.0}, "expected a trip above 40.19 degC, .* got trip_above_c 39"),
        ({"duration_s": 100.0}, "at least 240 s, 240 periods, got 100 s"),
        ({"period_s": 60.0, "duration_s": 86400.0}, "wider than 5.4 K"),
    ],
)
def test_an_impossible_plan_is_refused(changed, message):
    asked = {"powers": None, "band_k": 2.0, "duration_s": 1200.0}
    asked |= {key: value for key, value in changed.items() if key in asked}
    table = TABLE | {key: value for key, value in changed.items() if key not in asked}
    with pytest.raises(ConfigError, match=message):
        plan(load({"loops": {"tank": table}}), "tank", **asked)


def test_without_named_powers_the_loop_gets_what_it_may():
    excitation = plan(load({"loops": {"tank": TABLE | {"power_max": 0.6}}}), "tank", None, 2.0, 900)
    assert (excitation.low, excitation.high) == (0.0, 0.6)
    assert (excitation.bottom_c, excitation.top_c) == (35.5, 37.5)
    assert math.isclose(excitation.early_k, 0.0449 * 0.6)
