"""A bath heated by a block that full power warms by several K in a second, with figures to meet."""

from pathlib import Path

import numpy as np
import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import SetPoint, State

pytestmark = pytest.mark.slow

CONFIG = Path(__file__).parents[2] / "config"
SOUND = {State.RUN, State.RIDE, State.HOLD}


def cascade(lag_s, seed, bath, block):
    """Return truth and states of a warm-up, a step and cold water; no jump is configured."""
    document = load(CONFIG / "cascade.toml").in_force()
    document["boards"]["daq"] |= {"tolerances": 0.1, "element_lag_s": lag_s}
    document["loops"]["bath"]["controller"] = bath
    document["loops"]["block"]["controller"] = block
    del document["loops"]["block"]["jump_k"], document["loops"]["block"]["model"]
    cycles, clock = [], SimulatedClock()
    loop = loop_for(bench_settings(load(document), seed), clock, cycles.append, beside=False)
    for t_s in range(5400):
        clock.sleep_until(float(t_s))
        if t_s == 1800:
            loop.ask(SetPoint(42.0), "bath")
        if t_s == 3600:
            loop.boards[0].board.disturb("cold-water", 0.5)
        loop.cycle(float(t_s))
    assert loop.shut_down()
    bath = [cycle for cycle in cycles if cycle.loop == "bath"]
    truth = np.array([cycle.truth["true_temperature_c"] for cycle in bath])
    legs = np.split(truth, 3)
    beyond_k = [float(leg.max()) - to_c for leg, to_c in zip(legs, (37.5, 42.0, 42.0), strict=True)]
    ends = zip(legs, (37.5, 42.0, 42.0), strict=True)
    off_k = [float(np.abs(leg[-300:] - to_c).max()) for leg, to_c in ends]
    print(f"lag {lag_s:g} s, {seed}: beyond {np.round(beyond_k, 2)}, off {np.round(off_k, 2)} K")
    return beyond_k, off_k, {cycle.step.state for cycle in cycles}


@pytest.mark.parametrize("lag_s", [5.0, 12.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_adaptive_loop_holds_a_quick_block(lag_s, seed):
    beyond_k, off_k, states = cascade(lag_s, seed, "adaptive", "adaptive")
    assert states <= SOUND
    assert max(beyond_k) <= 0.25
    assert off_k[2] <= 0.15


@pytest.mark.parametrize("lag_s", [12.0, 40.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_pid_lets_a_hot_block_cool_down(lag_s, seed):
    beyond_k, off_k, states = cascade(lag_s, seed, "pid", "pid")
    assert states <= SOUND
    assert max(beyond_k) <= 0.25
    assert off_k[2] <= 0.15
