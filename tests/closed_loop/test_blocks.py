"""A bath heated by a block: one that comes down slowly, one that full power warms at once.

Each warms up, steps to 42 degC and meets cold water, with figures to meet.
"""

from pathlib import Path

import numpy as np
import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import SetPoint, State

pytestmark = pytest.mark.slow

CASCADE = Path(__file__).parents[2] / "config" / "cascade.toml"
SOUND = {State.RUN, State.RIDE, State.HOLD}
SETPOINTS_C = (37.5, 42.0, 42.0)


def ran(document, lag_s, seed):
    """Return the bath's true temperatures leg by leg, how far each goes beyond, and all states."""
    document["boards"]["daq"] |= {"tolerances": 0.1, "element_lag_s": lag_s}
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
    legs = np.split(np.array([cycle.truth["true_temperature_c"] for cycle in bath]), 3)
    beyond_k = [float(leg.max()) - to_c for leg, to_c in zip(legs, SETPOINTS_C, strict=True)]
    print(f"lag {lag_s:g} s, specimen {seed}: beyond {np.round(beyond_k, 3)} K")
    return legs, beyond_k, {cycle.step.state for cycle in cycles}


@pytest.mark.parametrize("lag_s", [30.0, 60.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_what_a_slow_block_still_holds_carries_no_bath_beyond_its_set_point(lag_s, seed):
    legs, beyond_k, states = ran(load(CASCADE).model_dump(), lag_s, seed)
    assert states <= SOUND
    assert max(beyond_k) <= 0.06
    assert max(1e3 * float(leg[-600:].std()) for leg in legs) <= 25.0


@pytest.mark.parametrize(
    ("law", "lag_s", "seed"),
    [("adaptive", lag_s, seed) for lag_s in (5.0, 12.0) for seed in (1, 2, 3)]
    + [("pid", lag_s, seed) for lag_s in (12.0, 40.0) for seed in (1, 2)],
)
def test_a_bath_is_held_by_a_block_of_which_nothing_is_configured(law, lag_s, seed):
    """An `adaptive` one is learnt however quick it is; a `pid` lets a hot one cool down."""
    document = load(CASCADE).in_force()
    for loop in ("bath", "block"):
        document["loops"][loop]["controller"] = law
    del document["loops"]["block"]["jump_k"], document["loops"]["block"]["model"]
    legs, beyond_k, states = ran(document, lag_s, seed)
    assert states <= SOUND
    assert max(beyond_k) <= 0.25
    assert float(np.abs(legs[2][-300:] - 42.0).max()) <= 0.15
