"""Minimum variance with a delay: on the reference d samples on, and with the least variance."""

import math

import numpy as np
import pytest

from thermoctl.control.minimum_variance import SelfTuningMinimumVariance
from thermoctl.estimation import start
from thermoctl.model.arx import Arx
from thermoctl.ports import Situation

SETPOINT_C = 40.0
STABLE = {1: [-0.95], 2: [-1.6, 0.63], 3: [-1.9, 1.12, -0.2]}


def closed_loop(law, theta, steps, noise=None, first_c=30.0):
    """Return outputs and inputs when the plant is the model and nothing is bounded."""
    structure = law.structure
    theta = np.array(theta)
    estimate = start(len(theta), 1e-12, theta)
    y, u = np.full(max(structure.n, 1), first_c), np.zeros(structure.u_memory)
    outputs, inputs = [first_c], []
    for t in range(steps):
        here = Situation(float(t), 1.0, y[0], SETPOINT_C, u[0], estimate, y[: structure.n], u)
        power = law.decide(law.start(), here)[1]
        u = np.concatenate(((power,), u[:-1]))
        value = float(structure.regressor(y, u) @ theta) + (0.0 if noise is None else noise[t])
        y = np.concatenate(((structure.temperature(value, u),), y[:-1]))
        outputs.append(y[0])
        inputs.append(power)
    return np.array(outputs), np.array(inputs)


@pytest.mark.parametrize("d", [1, 2, 5])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_output_is_on_the_reference_exactly_a_delay_later_and_stays(n, d):
    structure = Arx(n, 2, d, y_centre_c=20.0, y_scale_k=4.0, u_scale=0.5)
    law = SelfTuningMinimumVariance(structure)
    outputs, _ = closed_loop(law, [*STABLE[n], 0.2, 0.1], 40)
    assert outputs[d:] == pytest.approx(np.full(41 - d, SETPOINT_C), abs=1e-9)
    if d > 1:
        assert abs(outputs[d - 1] - SETPOINT_C) > 1.0


@pytest.mark.parametrize("d", [1, 3, 8])
def test_with_a_reference_time_the_error_falls_by_the_same_share_whatever_the_delay(d):
    law = SelfTuningMinimumVariance(Arx(2, 2, d, y_centre_c=20.0), reference_time_s=10.0)
    outputs, _ = closed_loop(law, [*STABLE[2], 0.2, 0.1], 60)
    error = SETPOINT_C - outputs[d - 1 :]
    assert error[1:] == pytest.approx(0.9 * error[:-1], abs=1e-9)


def test_without_past_outputs_the_model_still_looks_over_its_delay():
    law = SelfTuningMinimumVariance(Arx(0, 2, 3, y_centre_c=20.0), reference_time_s=4.0)
    outputs, _ = closed_loop(law, [15.0, 10.0], 60)
    error = SETPOINT_C - outputs[2:]
    assert error[1:] == pytest.approx(0.75 * error[:-1], abs=1e-9)


@pytest.mark.parametrize("d", [1, 3, 6])
@pytest.mark.slow
def test_the_variance_is_that_of_the_noise_that_no_power_could_have_met(d):
    steps, sigma = 8000, 0.1
    noise = sigma * np.random.default_rng(d).normal(size=steps)
    law = SelfTuningMinimumVariance(Arx(2, 2, d, y_centre_c=20.0))
    outputs, _ = closed_loop(law, [*STABLE[2], 0.2, 0.1], steps, noise)
    f = np.zeros(d + 2)  # the first d coefficients of 1/A, behind two zeros
    f[2] = 1.0
    for i in range(3, d + 2):
        f[i] = 1.6 * f[i - 1] - 0.63 * f[i - 2]
    least = sigma**2 * float(f[2:] @ f[2:])
    error = outputs[20:] - SETPOINT_C
    covariance = np.correlate(f[2:], f[2:], "full")
    spread = least * math.sqrt(2.0 * np.sum((covariance / covariance.max()) ** 2) / len(error))
    assert np.mean(error**2) == pytest.approx(least, abs=3.0 * spread)
    assert 3.0 * spread < 0.25 * least


def test_zeros_outside_the_unit_circle_are_not_cancelled_behind_a_delay_either():
    structure, theta = Arx(1, 2, 4), [-0.95, 0.1, 0.2]
    _, wild = closed_loop(SelfTuningMinimumVariance(structure, zero_radius=math.inf), theta, 40)
    assert np.abs(wild).max() > 1e9
    law = SelfTuningMinimumVariance(structure, reference_time_s=5.0)
    outputs, tame = closed_loop(law, theta, 200)
    assert np.abs(tame).max() < 20.0
    assert outputs[-1] == pytest.approx(SETPOINT_C, abs=0.01)


def test_a_power_that_is_not_remembered_is_nan_and_one_before_the_start_was_none():
    law, theta = SelfTuningMinimumVariance(Arx(1, 1, 3)), start(2, 1e-12, [-0.9, 0.1])
    y = np.array([37.0])

    def power(u):
        return law.decide(law.start(), Situation(0.0, 1.0, 37.0, 37.5, 0.1, theta, y, np.array(u)))[
            1
        ]

    assert math.isnan(power([0.1]))
    assert power([0.1, math.nan, math.nan]) == power([0.1, 0.0, 0.0])
