"""Patterns that would stretch patience with a bad sensor, and times that make no sense."""

import math
from itertools import cycle, islice

import numpy as np
import pytest

from thermoctl.regulator.judge import Judged, Verdict, judge
from thermoctl.regulator.limits import Limits
from thermoctl.signals import Acknowledge, ManualPower, Measurement, Mode, Quality, SetPoint, State

PAPER = {"kind": "self-tuning-mv", "reference_time_s": 60.0}  # knows no holding power at first
LIMITS = Limits(trip_above_c=60.0, trip_below_c=0.0, setpoint_min_c=5.0, setpoint_max_c=55.0)


def play(drive, pattern, seconds):
    """Repeat `pattern` of "G" good, "M" missing, "S" a spike of 20 K down, "H" above the trip."""
    steps = []
    for each in islice(cycle(pattern), seconds):
        offset_k = {"S": -20.0, "H": 30.0}.get(each, 0.0)
        steps.append(drive.step(Quality.MISSING if each == "M" else Quality.GOOD, offset_k))
    return steps


def longest_run(steps, power=0.0):
    """Return for how many steps in a row the power was above `power`."""
    longest = run = 0
    for step in steps:
        run = run + 1 if step.command.power > power else 0
        longest = max(longest, run)
    return longest


@pytest.mark.parametrize("pattern", ["G" + "M" * 58, "G" + "M" * 30, "GGMMM"])
def test_a_sensor_that_is_mostly_gone_is_safe_within_a_minute_or_two(warm, pattern):
    steps = play(warm, pattern, 900)
    first = [step.state for step in steps].index(State.SAFE)
    print(f"pattern {pattern[:6]}...: SAFE after {first} s")
    assert first <= 300
    assert steps[-1].state is State.SAFE
    assert sum(step.command.power > 0.0 for step in steps) <= 320


@pytest.mark.parametrize("share", [0.2, 0.3])
@pytest.mark.slow
def test_a_plant_warms_up_though_a_reading_in_four_is_missing_from_the_first_second(
    drive_with, share
):
    rng, cold = np.random.default_rng(3), drive_with(water_c=25.0)
    for _ in range(1500):
        cold.step(Quality.MISSING if rng.random() < share else Quality.GOOD)
    print(f"{share:.0%} missing: {cold.water_c:.2f} degC, SAFE for {safe_s(cold)} s")
    assert abs(cold.water_c - 37.5) < 0.3
    assert safe_s(cold) < 600


def safe_s(drive):
    """Return for how many seconds a drive was SAFE."""
    return sum(step.state is State.SAFE for step in drive.steps)


def test_after_a_break_of_the_line_missing_readings_take_back_their_time_and_no_more(warm):
    warm.run(120, Quality.MISSING)
    assert warm.steps[-1].state is State.SAFE
    warm.run(21)  # twenty seconds between good readings
    warm.run(5, Quality.MISSING)
    warm.run(15)
    assert warm.steps[-1].state is State.SAFE
    assert warm.run(2).state is State.RUN


def test_a_hold_at_full_power_is_not_renewed_by_one_reading_in_three(drive_with):
    cold = drive_with(water_c=25.0, controller=PAPER)
    assert cold.run(20).command.power == 1.0
    steps = play(cold, "MMG", 60)
    assert [step.state for step in steps].index(State.SAFE) <= 9
    assert steps[-1].command.power == 0.0


def test_every_other_sample_is_enough_to_control_on(warm):
    steps = play(warm, "GM", 1800)
    assert State.SAFE not in {step.state for step in steps}
    assert max(step.command.power for step in steps[60:]) < 0.6
    assert abs(warm.water_c - 37.5) < 0.5


@pytest.mark.slow
def test_spikes_every_other_sample_for_an_hour_are_never_believed(warm):
    steps = play(warm, "SG", 3600)
    assert [step for step in steps[::2] if "sensor.spike" not in names(step)] == []
    assert max(step.command.power for step in steps) < 0.6
    assert abs(warm.water_c - 37.5) < 0.5


def names(step):
    return " ".join(event.name for event in step.events)


def test_two_spikes_for_one_reading_are_safe(warm):
    steps = play(warm, "SSG", 60)
    assert [step.state for step in steps].index(State.SAFE) <= 12
    assert steps[-1].command.power == 0.0


def test_growing_spikes_do_not_widen_what_is_believed(warm):
    for n in range(600):
        step = warm.step(offset_k=-(1.5 + 0.05 * n) if n % 2 else 0.0)
        assert "sensor.spike" in names(step) or n % 2 == 0
    assert abs(warm.water_c - 37.5) < 0.5


def test_a_noisy_sensor_is_believed_within_a_few_readings():
    noise_k = [0.0, 3.0, -2.0, 1.0, -3.5, 2.5, -1.0, 3.0, -2.5, 0.5]
    memory, verdicts = Judged(), []
    for n in range(200):
        memory = judge(memory, Measurement(float(n), 37.0 + noise_k[n % 10]), LIMITS)
        verdicts.append(memory.verdict)
    assert set(verdicts[10:]) == {Verdict.GOOD}


def test_noise_beyond_every_measure_is_not_believed():
    memory, good = Judged(), 0
    for n in range(200):
        memory = judge(memory, Measurement(float(n), 30.0 + 12.5 * (-1.0) ** n), LIMITS)
        good += memory.verdict is Verdict.GOOD
    assert good <= 101


def test_above_the_limit_every_other_reading_is_safe_and_not_half_the_heat(warm):
    steps = play(warm, "HG", 600)
    assert [step.state for step in steps].index(State.SAFE) == 2
    assert all(step.command.power == 0.0 for step in steps[2:])


def test_a_second_reading_beyond_the_limit_after_half_a_minute_is_a_first_one_again(warm):
    play(warm, "H" + "G" * 31, 32)
    assert warm.step(offset_k=30.0).state is State.HOLD
    assert warm.step().state is State.RUN


# -- time ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("far_s", [1e9, 1e17, 1e300])
@pytest.mark.parametrize(("controller", "seconds"), [(PAPER, 5), ("adaptive", 60)])
def test_patience_runs_out_wherever_time_has_jumped_to(drive_with, far_s, controller, seconds):
    cold = drive_with(water_c=25.0, controller=controller)
    assert cold.run(20).command.power == 1.0
    cold.see(Measurement(far_s, 25.5))
    cold.see(Measurement(far_s, 25.5))
    after = [cold.see(Measurement(far_s, quality=Quality.MISSING)) for _ in range(seconds)]
    assert max([step.command.power for step in after[5:]], default=0.0) < 0.1
    assert after[-1].state is State.SAFE
    assert after[-1].command.power == 0.0


def test_a_jump_of_time_is_no_half_minute_of_good_readings(warm):
    warm.run(3, Quality.SHORT)
    warm.step()
    assert warm.see(Measurement(warm.t_s + 1e9, 37.5)).state is State.SAFE


def test_a_jump_of_time_does_not_lift_the_limit_of_rise(drive_with):
    cold = drive_with(water_c=20.0, rise_per_s=0.01)
    before = cold.run(5).command.power
    assert cold.see(Measurement(1e6, 20.1)).command.power <= before + 0.031


def test_a_jump_of_time_is_not_learnt_from(warm):
    theta = warm.steps[-1].estimate.theta.item()
    far = warm.see(Measurement(warm.t_s + 1e6, warm.water_c))
    assert far.estimate.theta.item() == pytest.approx(theta, abs=1e-4)


@pytest.mark.parametrize("times", [[5.0, 4.0, 3.0, 2.0], [math.nan] * 4, [-1e9] * 4, [7.0] * 4])
def test_time_that_goes_backwards_or_is_none_goes_on_by_periods(drive_with, times):
    drive = drive_with(water_c=25.0)
    drive.see(Measurement(10.0, 25.0))
    stepped = [drive.see(Measurement(t_s, 25.0)).t_s for t_s in times]
    assert stepped == [11.0, 12.0, 13.0, 14.0]


@pytest.mark.parametrize(("period_s", "at_most_s"), [(0.1, 3.2), (1.0, 3.0), (10.0, 20.0)])
def test_a_hold_ends_by_time_and_not_by_samples(drive_with, period_s, at_most_s):
    drive = drive_with(water_c=25.0, period_s=period_s)
    t_s = 0.0
    for _ in range(5):
        t_s += period_s
        assert drive.see(Measurement(t_s, 25.0)).command.power > 0.0
    held_s = 0.0
    while drive.power > 0.0:
        held_s += period_s
        drive.see(Measurement(t_s + held_s, quality=Quality.MISSING))
        assert held_s <= at_most_s + 1e-9
    print(f"period {period_s} s: held for {held_s:.1f} s")


# -- requests at awkward moments -------------------------------------------------------------------


def latched(drive):
    drive.step(offset_k=30.0)
    assert drive.step(offset_k=30.0).state is State.LATCHED
    return drive


def test_nothing_but_an_acknowledgement_ends_a_latch(warm):
    latched(warm)
    for mode in cycle((Mode.OFF, Mode.MANUAL, Mode.AUTO)):
        warm.regulator.request(mode)
        warm.regulator.request(ManualPower(1.0))
        step = warm.step()
        assert (step.state, step.command.power) == (State.LATCHED, 0.0)
        if len(warm.steps) > 400:
            break


def test_acknowledging_again_and_again_does_not_shorten_the_half_minute(warm):
    latched(warm)
    warm.step()
    for _ in range(29):
        warm.regulator.request(Acknowledge())
        assert warm.step().command.power == 0.0
    warm.run(3)
    assert warm.steps[-1].state is State.RUN


def test_acknowledging_again_and_again_does_not_make_open_circuits_forgotten(warm):
    for _ in range(2):
        assert warm.step(Quality.OPEN).state is State.SAFE
        warm.regulator.request(Acknowledge())
        warm.step()
        warm.regulator.request(Acknowledge())
    assert warm.step(Quality.OPEN).state is State.LATCHED


@pytest.mark.parametrize("first", ["sensor.open", "trip.over_temperature"])
def test_of_two_latches_the_second_holds_when_the_first_is_acknowledged(warm, first):
    for _ in range(3):
        warm.step(Quality.OPEN)
        warm.step()
    latched(warm)
    warm.step()
    codes = {alarm.code for alarm in warm.steps[-1].alarms if alarm.latched}
    assert codes == {"sensor.open", "trip.over_temperature"}
    warm.regulator.request(Acknowledge(first))
    assert warm.run(60).state is State.LATCHED
    warm.regulator.request(Acknowledge())
    assert warm.run(40).state is State.RUN


def test_changing_the_mode_every_cycle_gives_no_heat_without_a_sensor(warm):
    modes = cycle((Mode.MANUAL, Mode.AUTO, Mode.OFF))
    powers = []
    for _ in range(120):
        warm.regulator.request(next(modes))
        powers.append(warm.step(Quality.MISSING).command.power)
    assert max(powers) < 0.6
    assert not any(powers[60:])


def test_manual_power_may_be_lowered_while_a_reading_is_missing_but_not_raised(warm):
    warm.regulator.request(Mode.MANUAL)
    warm.regulator.request(ManualPower(0.4))
    warm.run(5)
    warm.regulator.request(ManualPower(0.9))
    assert warm.step(Quality.MISSING).command.power == 0.4
    warm.regulator.request(ManualPower(0.1))
    assert warm.step(Quality.MISSING).command.power == 0.1


@pytest.mark.slow
@pytest.mark.parametrize("value_c", [0.0, 60.0])
def test_a_set_point_on_the_limit_itself_is_held_or_latched_never_beyond(drive_with, value_c):
    drive = drive_with(water_c=30.0, controller=PAPER)
    drive.regulator.request(SetPoint(value_c))
    drive.run(3600)
    assert drive.water_c <= 60.5
    assert max(step.command.power for step in drive.steps[-600:]) < 0.6
