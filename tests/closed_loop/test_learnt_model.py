"""A loop that learns every parameter of its model, with and without the delay of the tank."""

import tomllib

import numpy as np
import pytest

from thermoctl.app.settings import load
from thermoctl.app.sim import profile, simulate

SETPOINT_C = 37.5


def regulated(**model):
    """Return the true deviation in K, and the powers, of the last of two hours."""
    content = tomllib.loads(profile("aquarium").read_text(encoding="utf-8"))
    (loop,) = content["loops"].values()
    loop["model"] = {"structure": "arx"} | model
    loop["controller"] = {"kind": "self-tuning-mv", "reference_time_s": 60.0}
    del loop["shadow"]
    loop["estimator"] = {"kind": "ckf", "R1": 1e-8, "R2": 0.1}
    loop["mode"], loop["setpoint_c"] = "auto", SETPOINT_C
    cycles = list(simulate(load(content), 7200.0, seed=2))[3600:]
    water_c = np.array([cycle.truth["true_temperature_c"] for cycle in cycles])
    return water_c - SETPOINT_C, np.array([cycle.accepted_power for cycle in cycles])


@pytest.mark.slow
def test_a_model_with_the_delay_of_the_tank_holds_it_several_times_better():
    without, jumps = regulated()
    deviation, powers = regulated(n=2, m=3, delay=10)
    rms_k = [float(np.sqrt(np.mean(each**2))) for each in (without, deviation)]
    travel = [float(np.abs(np.diff(each)).sum()) / 60.0 for each in (jumps, powers)]
    print(f"rms {rms_k[0]:.3f} and {rms_k[1]:.3f} K, travel {travel[0]:.1f} and {travel[1]:.1f}")
    assert rms_k[1] < 0.08
    assert 5.0 * rms_k[1] < rms_k[0]
    assert 3.0 * travel[1] < travel[0]
