"""GPC on the simulated aquarium, untuned, with figures to meet.

Judged on the true temperature of the water. A perfect law needs 355 s for the warm-up of the rig as
ordered, 83 s for the step and 104 s for the litre of cold water, and leaves 10 mK in an hour of
melting ice; three seeds, each with its own tolerances.
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
BOUND_MK = 10.0


def play(seconds, events=(), seed=61, charge="self-tuning-gpc", shadow=None):
    """Return the cycles of a run; `events` are (time, what is asked or befalls)."""
    document = load(AQUARIUM).model_dump()
    document["loops"]["tank"].update(controller={"kind": charge}, shadow=shadow)
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
    failed = ("controller.failed", "shadow.failed")
    assert not any(event.name in failed for cycle in cycles for event in cycle.step.events)
    assert {cycle.step.state for cycle in cycles} <= {State.RUN, State.RIDE, State.HOLD}
    return cycles


def truth(cycles):
    return np.array([cycle.truth["true_temperature_c"] for cycle in cycles])


def powers(cycles):
    return np.array([cycle.accepted_power for cycle in cycles])


def doubts(cycles):
    """Return when and whether the gain was doubted."""
    return [(cycle.step.t_s, event.fields["active"]) for cycle in cycles
            for event in cycle.step.events if event.name == "controller.gain_doubtful"]  # fmt: skip


def settled_s(water_c, setpoint_c, band_k=0.1):
    outside = np.flatnonzero(np.abs(water_c - setpoint_c) > band_k)
    return outside[-1] + 1 if outside.size else 0


@pytest.mark.parametrize("seed", [61, 62, 63])
def test_it_warms_up_without_overshoot_and_holds_within_1_6_times_the_bound(seed):
    cycles = play(4800, seed=seed)
    water_c, power = truth(cycles), powers(cycles)
    last = slice(-3600, None)
    travel = 60.0 * np.abs(np.diff(power[last])).mean()
    figures = (water_c.max() - 37.5, settled_s(water_c, 37.5), 1e3 * water_c[last].std(), travel)
    print(seed, [round(float(figure), 3) for figure in figures])
    assert figures[0] <= 0.08
    assert figures[1] <= 500.0
    assert figures[2] <= 1.6 * BOUND_MK
    assert travel <= 0.5
    assert doubts(cycles) == []


@pytest.mark.parametrize(
    ("event", "setpoint_c", "overshoot_k", "within_s"),
    [
        (SetPoint(40.0), 40.0, 0.08, 130),
        (("cold-water", 1.0), 37.5, 0.1, 150),
        (("half-gone", 0.5), 37.5, 0.15, 120),
        (("dropout", 40.0), 37.5, 0.15, 120),
    ],
    ids=("step", "cold water", "half gone", "dropout"),
)
def test_what_befalls_it_is_over_within_two_minutes(event, setpoint_c, overshoot_k, within_s):
    cycles = play(1800, [(1200, event)])
    water_c = truth(cycles)[1200:]
    figures = (water_c.max() - setpoint_c, settled_s(water_c, setpoint_c))
    print(event, [round(float(figure), 3) for figure in figures])
    assert figures[0] <= overshoot_k
    assert figures[1] <= within_s
    assert doubts(cycles) == []


@pytest.mark.parametrize("power", [0.1, 0.25, 0.5])
def test_it_takes_over_from_a_person_with_the_power_that_keeps_the_water_where_it_is(power):
    by_hand = [(900, Mode.MANUAL), (900, ManualPower(power))]
    water_c = truth(play(1500, by_hand))
    too_much = (water_c[-1] - water_c[-61]) / 60.0 / 0.036  # it still warms or cools
    takeover = [(1499, SetPoint(round(float(water_c[-1]), 2))), (1500, Mode.AUTO)]
    given = powers(play(1560, by_hand + takeover))
    print(power, too_much, given[1499:1503])
    assert given[1499] == pytest.approx(power, abs=0.01)
    assert given[1500] == pytest.approx(power - too_much, abs=0.12)
    assert np.abs(np.diff(given[1500:])).max() < 0.05


def test_it_learns_in_the_shadow_and_takes_over_without_a_bump():
    cycles = play(
        2400,
        [(1500, ChooseController("self-tuning-gpc"))],
        charge="adaptive",
        shadow={"kind": "self-tuning-gpc"},
    )
    water_c, power = truth(cycles), powers(cycles)
    assert {cycle.step.controller for cycle in cycles[1500:]} == {"self-tuning-gpc"}
    assert power[1500] == pytest.approx(power[1499], abs=0.06)
    assert water_c[1500:] == pytest.approx(np.full(900, 37.5), abs=0.06)


@pytest.mark.xfail(
    strict=True,
    reason="the heater is asked 127 s after the mains fail, 7 s after they are back; with that "
    "the water is back after 424 s. Two seeds of three were asked before, too",
)
def test_two_minutes_without_mains_are_made_up_for_at_once():
    water_c = truth(play(2400, [(1200, ("sag", 0.95)), (1260, ("sag", 0.95))]))
    figures = (water_c[1200:].min(), water_c[1200:].max(), settled_s(water_c[1320:], 37.5))
    print([round(float(figure), 3) for figure in figures])
    assert figures[0] < 36.8
    assert figures[1] - 37.5 < 0.15
    assert figures[2] < 300
