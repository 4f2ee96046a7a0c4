"""A bath heated by a block that comes down slowly, with figures to meet."""

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


@pytest.mark.parametrize("lag_s", [30.0, 60.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_what_a_slow_block_still_holds_carries_no_bath_beyond_its_set_point(lag_s, seed):
    document = load(CONFIG / "cascade.toml").model_dump()
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
    truth = np.array([cycle.truth["true_temperature_c"] for cycle in bath])
    legs = np.split(truth, 3)
    beyond_k = [float(leg.max()) - to_c for leg, to_c in zip(legs, (37.5, 42.0, 42.0), strict=True)]
    rms_mk = [1e3 * float(leg[-600:].std()) for leg in legs]
    print(f"lag {lag_s:g} s, specimen {seed}: beyond {np.round(beyond_k, 3)} K, {rms_mk} mK rms")
    assert {cycle.step.state for cycle in cycles} <= {State.RUN, State.RIDE, State.HOLD}
    assert max(beyond_k) <= 0.06
    assert max(rms_mk) <= 25.0
