"""Tanks that are cooled, and tanks that are heated and cooled, with figures to meet.

Each tank is a specimen with tolerances of its own and is judged on the true temperature of its
water. Overshoot is what lies beyond the set point, on the side away from where the water came.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import SetPoint, State

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

CONFIG = Path(__file__).parents[2] / "config"


@dataclass(frozen=True)
class Leg:
    """A set point held for so long, and what befalls the tank when it has begun."""

    setpoint_c: float
    seconds: int
    befalls: tuple[str, float] | None = None
    overshoot_k: float = 0.1
    deviation_mk: float = 25.0


@dataclass(frozen=True)
class Row:
    """A profile, with other keys of its board and its controller, through some legs."""

    name: str
    profile: str
    legs: tuple[Leg, ...]
    seed: int
    board: dict[str, Any] = field(default_factory=dict)
    controller: dict[str, Any] = field(default_factory=dict)
    at_least: float = 0.0
    changeover_s: float = 5.0


COOLING = (Leg(12.0, 3900), Leg(10.0, 1500))
BOTH = (Leg(18.0, 2700), Leg(30.0, 1500), Leg(24.0, 2100))
WAITING = (Leg(18.0, 2700, deviation_mk=50.0), Leg(30.0, 1500), Leg(24.0, 2100))
SMALL = {"volume_l": 2.0, "heater_w": 375.0, "cooler_w": 75.0}
ROWS = (
    *(Row(f"cooled, specimen {n}", "cool", COOLING, n) for n in (1, 2, 3)),
    Row("cooled, 2 l", "cool", COOLING, 4, board={"volume_l": 2.0, "cooler_w": 100.0}),
    Row("cooled, in a draught", "cool",
        (Leg(12.0, 3900), Leg(12.0, 2400, befalls=("draught", 4.0))), 5),
    *(Row(f"heated and cooled, specimen {n}", "heat-cool", BOTH, n, at_least=-1.0)
      for n in (1, 2, 3)),
    Row("heated and cooled, 2 l", "heat-cool", BOTH, 4, board=SMALL, at_least=-1.0),
    Row("a minute between heater and cooler", "heat-cool", WAITING, 1, at_least=-1.0,
        changeover_s=60.0),
    Row("a cooler as strong as the heater", "heat-cool", BOTH, 5, board={"cooler_w": 1500.0},
        controller={"cooling_ratio": 1.0}, at_least=-1.0),
    Row("a ratio half of what it is", "heat-cool", BOTH, 6, controller={"cooling_ratio": 0.1},
        at_least=-1.0),
)  # fmt: skip


def play(row):
    """Return the cycles of a row, leg by leg."""
    document = load(CONFIG / f"{row.profile}.toml").model_dump()
    document["boards"]["daq"] |= {"tolerances": 0.1, **row.board}
    loop = document["loops"]["tank"]
    ours = {} if "kind" in row.controller else loop["controller"]
    loop["controller"] = {**ours, **row.controller}
    if loop["cooler"] is not None:
        loop["cooler"]["changeover_s"] = row.changeover_s
    cycles, clock, legs = [], SimulatedClock(), []
    loop = loop_for(bench_settings(load(document), row.seed), clock, cycles.append, beside=False)
    t_s = 0
    for leg in row.legs:
        loop.ask(SetPoint(leg.setpoint_c))
        if leg.befalls is not None:
            loop.boards[0].board.disturb(*leg.befalls)
        for _ in range(leg.seconds):
            clock.sleep_until(float(t_s))
            loop.cycle(float(t_s))
            t_s += 1
        legs.append(cycles[-leg.seconds :])
    assert loop.shut_down()
    return legs


def figures(leg, cycles):
    """Return what a leg measured, by the names of its limits."""
    truth = np.array([cycle.truth["true_temperature_c"] for cycle in cycles])
    away = np.sign(leg.setpoint_c - truth[0])
    return {
        "overshoot_k": float((away * (truth - leg.setpoint_c)).max()),
        "deviation_mk": 1e3 * float(truth[-900:].std()),
    }


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_the_second_uses_meet_their_figures(row):
    missed = {}
    for leg, cycles in zip(row.legs, play(row), strict=True):
        measured = figures(leg, cycles)
        print(f"{row.name}, {leg.setpoint_c:g} degC", {k: round(v, 3) for k, v in measured.items()})
        assert {cycle.step.state for cycle in cycles} <= {State.RUN, State.RIDE, State.HOLD}
        assert all(row.at_least <= cycle.accepted_power <= 1.0 for cycle in cycles)
        assert not any(c.truth["heater_w"] and c.step.command.power < 0.0 for c in cycles[1:])
        missed |= {(leg, k): v for k, v in measured.items() if not v <= getattr(leg, k)}
    assert missed == {}


# -- a pid that is told how weak its cooler is -----------------------------------------------------


def seconds_outside(leg, cycles, band_k=0.1):
    """Return after how many seconds of a leg the water stays within the band."""
    truth = np.array([cycle.truth["true_temperature_c"] for cycle in cycles])
    return int(np.flatnonzero(np.abs(truth - leg.setpoint_c) > band_k)[-1]) + 1


@pytest.mark.parametrize("changeover_s", [5.0, 60.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_pid_that_is_told_the_ratio_settles_sooner_than_one_that_is_not(seed, changeover_s):
    legs = (Leg(30.0, 900), Leg(18.0, 2700), Leg(15.0, 1800), Leg(24.0, 1500))
    measured = {}
    for ratio in (1.0, 0.2):
        pid = {"kind": "pid", "action": "heat-cool", "cooling_ratio": ratio}
        row = Row("", "heat-cool", legs, seed, controller=pid, changeover_s=changeover_s)
        measured[ratio] = [
            {**figures(leg, cycles), "settled_s": seconds_outside(leg, cycles)}
            for leg, cycles in zip(legs, play(row), strict=True)
        ]
        print(f"seed {seed}, changeover {changeover_s:g} s, ratio {ratio:g}:", *measured[ratio])
    for untold, told in zip(measured[1.0], measured[0.2], strict=True):
        assert told["settled_s"] < untold["settled_s"] - 80
    for untold, told in zip(measured[1.0][1:3], measured[0.2][1:3], strict=True):
        assert told["overshoot_k"] <= 0.1
        assert untold["overshoot_k"] > 0.3
        assert told["deviation_mk"] <= 50.0  # of BOTH's and WAITING's cold legs


# -- a loop within a loop --------------------------------------------------------------------------

BLOCK_MAX_C = 80.0
"""The hottest that the outer loop of the profile may ask for."""


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_cascade_holds_the_bath_and_its_block_stays_below_its_maximum(seed):
    document = load(CONFIG / "cascade.toml").model_dump()
    document["boards"]["daq"]["tolerances"] = 0.1
    cycles, clock = [], SimulatedClock()
    loop = loop_for(bench_settings(load(document), seed), clock, cycles.append, beside=False)
    for t_s in range(3600):
        clock.sleep_until(float(t_s))
        if t_s == 1800:
            loop.boards[0].board.disturb("cold-water", 0.5)
        loop.cycle(float(t_s))
    assert loop.shut_down()
    bath = [cycle for cycle in cycles if cycle.loop == "bath"]
    truth = np.array([cycle.truth["true_temperature_c"] for cycle in bath])
    hottest_c = max(cycle.truth["element_c"] for cycle in cycles)
    overshoot_k, again_k = truth[:1800].max() - 37.5, truth[1800:].max() - 37.5
    deviation_mk = 1e3 * truth[1200:1800].std()
    print(
        f"cascade, specimen {seed}: overshoot {overshoot_k:.3f} K, {deviation_mk:.1f} mK rms, "
        f"after half a litre of cold water {again_k:.3f} K, block at most {hottest_c:.2f} degC"
    )
    assert {cycle.step.state for cycle in cycles} <= {State.RUN, State.RIDE, State.HOLD}
    assert overshoot_k <= 0.1
    assert again_k <= 0.15
    assert deviation_mk <= 30.0
    assert abs(truth[-300:] - 37.5).max() <= 0.15
    assert hottest_c <= BLOCK_MAX_C + 2.0
