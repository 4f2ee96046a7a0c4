"""The PID on the simulated aquarium, tuned by nobody but itself, with figures to meet.

Judged on the true temperature of the water, as in the scenarios of the other laws. The deviation
that minimum variance would leave in an hour of melting ice is 9.6 mK; a PI with gains by SIMC is
expected to leave one and a half times as much.
"""

from pathlib import Path

import numpy as np
import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import ChooseController, ManualPower, Mode, SetPoint, State

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

AQUARIUM = Path(__file__).parents[2] / "config" / "aquarium.toml"
BOUND_MK = 9.6


def play(seconds, events=(), seed=51, *, checked=True, **options):
    """Return the cycles of a run; `events` are (time, what is asked or befalls)."""
    document = load(AQUARIUM).model_dump()
    document["loops"]["tank"].update(controller={"kind": "pid", **options})
    document["loops"]["tank"]["heater_check"]["enabled"] = checked
    settings = bench_settings(load(document), seed)
    board = settings.boards["daq"].model_copy(update={"tolerances": 0.1})
    settings = settings.model_copy(update={"boards": {"daq": board}})
    cycles, clock = [], SimulatedClock()
    loop = loop_for(settings, clock, cycles.append, beside=False)
    for t_s in range(seconds):
        clock.sleep_until(t_s)
        for at_s, event in events:
            if at_s == t_s and isinstance(event, tuple):
                loop.boards[0].board.disturb(*event)
            elif at_s == t_s:
                loop.ask(event)
        loop.cycle(t_s)
    assert loop.shut_down()
    assert not any(e.name == "controller.failed" for cycle in cycles for e in cycle.step.events)
    assert {cycle.step.state for cycle in cycles} <= {State.RUN, State.RIDE, State.HOLD}
    return cycles


def truth(cycles):
    return np.array([cycle.truth["true_temperature_c"] for cycle in cycles])


def powers(cycles):
    return np.array([cycle.accepted_power for cycle in cycles])


def told(cycles, name):
    """Return when the event `name` came, and its fields."""
    return [(cycle.step.t_s, event.fields) for cycle in cycles for event in cycle.step.events
            if event.name == name]  # fmt: skip


def settled_s(water_c, setpoint_c, band_k=0.1):
    outside = np.flatnonzero(np.abs(water_c - setpoint_c) > band_k)
    return outside[-1] + 1 if outside.size else 0


@pytest.mark.parametrize("seed", [51, 52, 53])
def test_it_tunes_on_the_way_up_and_holds_within_1_6_times_the_bound(seed):
    cycles = play(5400, seed=seed)
    water_c, power = truth(cycles), powers(cycles)
    last = slice(-3600, None)
    travel = 60.0 * np.abs(np.diff(power[last])).mean()
    figures = (water_c.max() - 37.5, settled_s(water_c, 37.5), 1e3 * water_c[last].std(), travel)
    print(seed, [round(float(figure), 3) for figure in figures])
    ((at_s, fields),) = told(cycles, "controller.tuned")
    assert fields["active"]
    assert water_c[int(at_s)] < 25.0 + 0.5 * 12.5 + 0.3
    assert [f["active"] for _, f in told(cycles, "controller.tuning")] == [True, False]
    assert figures[0] <= 0.15
    assert figures[1] <= 560.0
    assert figures[2] <= 1.6 * BOUND_MK
    assert travel <= 1.6


@pytest.mark.parametrize(
    ("event", "setpoint_c", "overshoot_k", "within_s"),
    [
        (SetPoint(40.0), 40.0, 0.2, 260),
        (("cold-water", 1.0), 37.5, 0.4, 240),
        (("half-gone", 0.5), 37.5, 0.3, 400),
    ],
    ids=("step", "cold water", "half gone"),
)
def test_what_befalls_it_is_over_within_minutes(event, setpoint_c, overshoot_k, within_s):
    water_c = truth(play(2400, [(1200, event)]))[1200:]
    figures = (water_c.max() - setpoint_c, settled_s(water_c, setpoint_c))
    print(event, [round(float(figure), 3) for figure in figures])
    assert figures[0] <= overshoot_k
    assert figures[1] <= within_s


def test_a_relay_tunes_as_well_and_its_swing_is_small():
    cycles = play(5400, tuning="relay")
    ((at_s, _),) = told(cycles, "controller.tuned")
    water_c, power = truth(cycles), powers(cycles)
    swing_c = water_c[600 : int(at_s)]
    print(at_s, np.ptp(swing_c), 1e3 * water_c[-3600:].std())
    assert 600.0 < at_s < 1800.0
    assert np.abs(swing_c - 37.5).max() < 0.5
    assert water_c[-3600:].std() <= 1.8e-3 * BOUND_MK
    assert 60.0 * np.abs(np.diff(power[-3600:])).mean() <= 1.8


@pytest.mark.parametrize("power", [0.05, 0.2, 0.7])
def test_it_takes_over_from_a_person_without_a_bump(power):
    events = [(900, Mode.MANUAL), (900, ManualPower(power)), (1000, Mode.AUTO)]
    given = powers(play(1100, events))
    assert given[999] == pytest.approx(power, abs=0.01)
    assert given[1000] == pytest.approx(power, abs=0.06)


def test_in_the_shadow_it_learns_from_who_steers_and_takes_over_without_a_bump():
    document = load(AQUARIUM).model_dump()
    document["loops"]["tank"].update(controller={"kind": "adaptive"}, shadow={"kind": "pid"})
    settings, cycles, clock = bench_settings(load(document), 51), [], SimulatedClock()
    loop = loop_for(settings, clock, cycles.append, beside=False)
    for t_s in range(3000):
        clock.sleep_until(t_s)
        if t_s == 1500:
            loop.ask(ChooseController("pid"))
        loop.cycle(t_s)
    assert loop.shut_down()
    water_c, power = truth(cycles), powers(cycles)
    assert told(cycles, "controller.tuned")[0][0] == 1500
    assert {cycle.step.controller for cycle in cycles[1500:]} == {"pid"}
    assert power[1500] == pytest.approx(power[1499], abs=0.08)
    assert water_c[1500:] == pytest.approx(np.full(1500, 37.5), abs=0.1)


def test_after_an_hour_without_mains_it_is_back_with_half_a_kelvin_too_much():
    without = [(at_s, ("sag", 0.95)) for at_s in range(1200, 4800, 60)]
    water_c = truth(play(6600, without, checked=False))  # or it were a heater that does nothing
    print(water_c[1200:4800].min(), water_c[4800:].max())
    assert water_c[1200:4800].min() < 25.0
    assert water_c[4800:].max() - 37.5 < 0.6
    assert water_c[-600:] == pytest.approx(np.full(600, 37.5), abs=0.1)
