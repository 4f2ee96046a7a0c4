"""Small vessels with strong heaters, never seen before and described by nobody.

The configuration is that of the rig, whose water rises by .045 K/s at most: what these do in a
period is far more, and yet no fault of the sensor.
"""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import State

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

AQUARIUM = Path(__file__).parents[2] / "config" / "aquarium.toml"
QUICK = {"sensor_lag_s": 2.0, "element_lag_s": 4.0}
VESSELS = {
    "half a litre with 1 kW, every second": (1.0, {"volume_l": 0.5, "heater_w": 1000.0}),
    ".37 K/s, every 10 s": (10.0, {"volume_l": 0.6, "heater_w": 1000.0, **QUICK}),
    ".37 K/s, every 5 s": (5.0, {"volume_l": 0.6, "heater_w": 1000.0, **QUICK}),
}


def play(vessel, seconds, spike_s=None, setpoint_c=37.5):
    """Return the cycles of a vessel under the default controller, with a spike of 20 K."""
    period_s, tank = VESSELS[vessel]
    document = tomllib.loads(AQUARIUM.read_text(encoding="utf-8"))
    document["loops"]["tank"].update(
        controller="adaptive", period_s=period_s, setpoint_c=setpoint_c
    )
    document["boards"]["daq"].update(ice_kg=0.0, dead_man_s=3.0 * period_s + 1.0, **tank)
    cycles, clock = [], SimulatedClock()
    loop = loop_for(bench_settings(load(document), 5), clock, cycles.append, beside=False)
    for number in range(int(seconds / period_s)):
        clock.sleep_until(number * period_s)
        if number * period_s == spike_s:
            loop.boards[0].board.disturb("spike", 20.0)
        loop.cycle(number * period_s)
    assert loop.shut_down()
    return cycles


def spikes(cycles):
    """Return when a reading was refused."""
    return [
        event.t_s for each in cycles for event in each.step.events if event.name == "sensor.spike"
    ]


def approaches():
    """Return vessels and set points; the second rises by 3.6 K between two samples."""
    yield from ((vessel, setpoint_c) for vessel in VESSELS for setpoint_c in (37.5, 50.0))


@pytest.mark.parametrize(("vessel", "setpoint_c"), list(approaches()))
def test_a_fast_vessel_comes_to_rest_at_its_set_point(vessel, setpoint_c):
    cycles = play(vessel, 2400, setpoint_c=setpoint_c)
    truth = np.array([each.truth["true_temperature_c"] for each in cycles])
    assert truth.max() - setpoint_c < 0.3
    assert np.abs(truth[-len(truth) // 4 :] - setpoint_c).max() < 0.15


@pytest.mark.parametrize("setpoint_c", [37.5, 50.0])
@pytest.mark.parametrize("vessel", VESSELS)
def test_no_healthy_reading_is_taken_for_a_spike(vessel, setpoint_c):
    cycles = play(vessel, 2400, setpoint_c=setpoint_c)
    truth = np.array([each.truth["true_temperature_c"] for each in cycles])
    print(vessel, setpoint_c, "rise", np.diff(truth).max(), "overshoot", truth.max() - setpoint_c)
    assert spikes(cycles) == []
    assert {each.step.state for each in cycles} == {State.RUN}


@pytest.mark.parametrize("spike_s", [10.0, 30.0, 1200.0])
@pytest.mark.parametrize("vessel", VESSELS)
def test_a_spike_of_20_k_is_one_from_the_second_reading_on(vessel, spike_s):
    cycles = play(vessel, 1500, spike_s)
    assert spikes(cycles) == [spike_s]
    settled = [each.truth["true_temperature_c"] for each in cycles[-len(cycles) // 10 :]]
    assert np.abs(np.array(settled) - 37.5).max() < 0.15
