"""Two sensors against one on the rig: how much calmer are reading and water?"""

import numpy as np
import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, default_profile
from thermoctl.runtime.clock import SimulatedClock

pytestmark = pytest.mark.slow

SEEDS = (1, 2, 3)
SETTLED_S, SECONDS = 1800, 3600


def deviations(seed, sensors):
    """Return the deviation of the water and of the steps of the reading, in mK."""
    document = load(default_profile()).model_dump(exclude_none=True)
    (table,), (board,) = document["loops"].values(), document["boards"].values()
    board["second_sensor"] = sensors == 2
    if sensors == 2:
        table["second_sensor"] = {**table["sensor"], "input": "temperature2"}
    cycles, clock = [], SimulatedClock()
    loop = loop_for(bench_settings(load(document), seed), clock, cycles.append, beside=False)
    for t_s in range(SECONDS):
        clock.sleep_until(float(t_s))
        loop.cycle(float(t_s))
    assert loop.shut_down()
    settled = cycles[SETTLED_S:]
    water_c = np.array([cycle.truth["true_temperature_c"] for cycle in settled])
    read_c = np.array([cycle.step.measurement.temperature_c for cycle in settled])
    return 1e3 * water_c.std(), 1e3 * np.diff(read_c).std()


def test_two_sensors_quieten_the_reading_by_the_root_of_two_and_the_water_by_less():
    with_one = np.array([deviations(seed, 1) for seed in SEEDS])
    with_two = np.array([deviations(seed, 2) for seed in SEEDS])
    water, read = np.exp(np.log(with_two / with_one).mean(axis=0))
    print(
        f"water: {with_one[:, 0].mean():.1f} mK with one sensor, {with_two[:, 0].mean():.1f} mK "
        f"with two (ratio {water:.2f}); steps of the reading: ratio {read:.2f}"
    )
    assert read == pytest.approx(np.sqrt(0.5), abs=0.03)
    assert water < 0.9
