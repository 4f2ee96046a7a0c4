import math

import numpy as np
import pytest

from thermoctl.signals import (
    Beliefs,
    Command,
    Cycle,
    Estimate,
    Measurement,
    Mode,
    State,
    Step,
)
from thermoctl.studies.experiment import (
    Measures,
    Run,
    RunError,
    limit_cycle,
    measure,
    run_from_cycles,
)

T_S = np.arange(3600.0)
NOISE = np.random.default_rng(2).standard_normal((2, len(T_S)))


def run_with(true_c, power=None, setpoint_c=37.5, measured_c=None):
    """A run of which only temperature and power matter."""
    length = len(true_c)
    unknown = np.full(length, math.nan)
    return Run(
        np.arange(float(length)),
        true_c if measured_c is None else measured_c,
        true_c,
        np.zeros(length) if power is None else power,
        np.full(length, setpoint_c),
        unknown,
        unknown,
    )


def warmed(after, start_c=25.0, rise_s=500.0):
    """A straight warm-up over `rise_s`, then 37.5 degC plus `after`, in K."""
    ramp = np.minimum(start_c + (37.5 - start_c) * T_S / rise_s, 37.5)
    return np.where(ramp < 37.5, ramp, 37.5 + after)


def test_bias_and_deviation_are_those_of_the_true_temperature():
    held = 0.25 + 0.05 * NOISE[0]
    found = measure(run_with(warmed(held), measured_c=warmed(held) + NOISE[1]))
    assert found.bias_k == pytest.approx(0.25, abs=0.005)
    assert found.deviation_k == pytest.approx(0.05, rel=0.05)
    assert found.cycle_k is None


def test_without_the_truth_the_sensor_is_judged():
    run = run_with(np.full(len(T_S), math.nan), measured_c=warmed(0.25 + 0.0 * T_S))
    assert measure(run).bias_k == pytest.approx(0.25)


@pytest.mark.parametrize("period_s", [30.0, 88.0, 200.0])
@pytest.mark.parametrize("amplitude", [0.05, 0.35])
def test_a_limit_cycle_is_found_under_noise(period_s, amplitude):
    wave = amplitude * np.sin(2 * np.pi * T_S / period_s) + 0.1 * amplitude * NOISE[0]
    found = measure(run_with(warmed(wave)))
    assert found.cycle_period_s == pytest.approx(period_s, rel=0.03)
    assert found.cycle_k == pytest.approx(2 * amplitude, rel=0.15)


def test_noise_about_the_mean_is_not_counted_as_cycles():
    wave = np.sin(2 * np.pi * T_S / 200.0) + 0.3 * NOISE[0]
    assert limit_cycle(T_S, wave)[1] == pytest.approx(200.0, rel=0.05)


@pytest.mark.parametrize("values", [NOISE[0], np.zeros(3600), 1e-3 * T_S, NOISE[0][:1]])
def test_noise_rest_and_drift_are_no_limit_cycle(values):
    assert limit_cycle(T_S[: len(values)], values) is None


def test_samples_that_are_not_known_do_not_hide_a_limit_cycle():
    wave = np.sin(2 * np.pi * T_S / 100.0)
    wave[::17] = math.nan
    cycle = limit_cycle(T_S, wave)
    assert cycle == (pytest.approx(2.0, rel=0.05), pytest.approx(100.0, rel=0.03))


def test_warm_up_ends_a_tenth_of_a_kelvin_before_the_set_point():
    found = measure(run_with(warmed(0.0 * T_S)))
    assert found.warm_up_s == pytest.approx(500.0 * (1 - 0.1 / 12.5), abs=1.0)


def test_overshoot_of_the_warm_up_is_no_regulation():
    peak = 0.8 * np.exp(-(T_S - 500.0).clip(0.0) / 60.0)
    found = measure(run_with(warmed(peak)))
    assert found.overshoot_k == pytest.approx(0.8, rel=0.01)
    assert found.range_k < 0.01
    assert found.window_s == pytest.approx(3600 - 496 - 300, abs=2)


def test_cooling_is_judged_from_the_other_side():
    mirror = 75.0 - warmed(0.2 * np.exp(-(T_S - 500.0).clip(0.0) / 60.0))
    found = measure(run_with(mirror))
    assert found.warm_up_s == pytest.approx(496.0, abs=1.0)
    assert found.overshoot_k == pytest.approx(0.2, rel=0.01)


def test_travel_counts_full_ranges_a_minute():
    power = np.where(T_S % 20.0 < 10.0, 1.0, 0.0)  # up and down three times a minute
    found = measure(run_with(warmed(0.0 * T_S), power=power))
    assert found.travel_per_min == pytest.approx(6.0, rel=0.01)
    assert found.mean_power == pytest.approx(0.5, abs=0.01)


def test_a_run_that_never_arrives_has_no_measures():
    assert measure(run_with(np.full(100, 25.0))) == Measures()
    assert measure(run_with(np.full(100, math.nan))) == Measures()


def test_a_run_that_ends_on_arrival_has_no_regulation():
    found = measure(run_with(np.array([30.0, 34.0, 37.45])))
    assert (found.warm_up_s, found.overshoot_k, found.window_s) == (2.0, 0.0, None)


def test_a_sensor_that_fails_at_the_end_leaves_nothing_to_judge():
    lost = warmed(0.0 * T_S)
    lost[500:] = math.nan
    assert measure(run_with(lost)).window_s is None


@pytest.mark.parametrize("t_s", [np.array([0.0]), np.array([0.0, 0.0]), np.array([1.0, 0.0])])
def test_a_run_must_go_forward_in_time(t_s):
    same = np.zeros(len(t_s))
    with pytest.raises(RunError, match="in the order of time"):
        Run(t_s, same, same, same, same, same, same)


def test_a_run_needs_arrays_of_one_length():
    with pytest.raises(RunError, match="one length"):
        Run(T_S, T_S, T_S, T_S[:-1], T_S, T_S, T_S)


def cycle(t_s, truth):
    step = Step(
        t_s=t_s,
        measurement=Measurement(t_s, 25.0 + t_s),
        mode=Mode.AUTO,
        state=State.RUN,
        setpoint_c=37.5,
        command=Command(0.9, t_s + 2.0, "control"),
        controller="self-tuning-mv",
        estimate=Estimate(np.zeros(1), np.eye(1)),
        beliefs=Beliefs(a=0.9, a_sd=0.1) if t_s > 10.0 else Beliefs(),
    )
    return Cycle("tank", step, accepted_power=0.75, truth=truth)


def test_cycles_become_a_run_with_the_power_that_was_accepted():
    run = run_from_cycles(cycle(10.0 + k, {"true_temperature_c": 24.0 + k}) for k in range(3))
    assert run.t_s.tolist() == [0.0, 1.0, 2.0]
    assert run.measured_c.tolist() == [35.0, 36.0, 37.0]
    assert run.true_c.tolist() == [24.0, 25.0, 26.0]
    assert run.power.tolist() == [0.75] * 3
    np.testing.assert_equal(run.a, [math.nan, 0.9, 0.9])
    np.testing.assert_equal(run.a_sd, [math.nan, 0.1, 0.1])


def test_cycles_of_real_hardware_know_no_truth():
    run = run_from_cycles(cycle(float(k), {}) for k in range(3))
    assert np.all(np.isnan(run.true_c))
    assert run.judged_c is run.measured_c


@pytest.mark.parametrize("count", [0, 1])
def test_less_than_two_cycles_are_no_run(count):
    with pytest.raises(RunError, match=f"got {count}"):
        run_from_cycles(cycle(float(k), {}) for k in range(count))
