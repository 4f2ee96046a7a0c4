"""A second start with the stored model: sooner at rest, and none the worse on another plant.

What the first start learnt goes through the file that a daemon writes. Then the plant is the same,
or somebody has changed it meanwhile; what the controller is told is the same in every row. Tanks
have tolerances, and are judged on the true temperature of their water.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.services.learned import LearnedStore, ModelKeeper

pytestmark = pytest.mark.slow  # several minutes of plants

AQUARIUM = Path(__file__).parents[2] / "config" / "aquarium.toml"
SETPOINT_C, BAND_K, HELD_S, SEED = 37.5, 0.1, 120, 32


@dataclass(frozen=True)
class Row:
    """A plant, and what a start with the model of the rig must meet on it.

    The figures of a first start on the same plant and seed stand beside each row.
    """

    name: str
    seconds: int
    tank: dict[str, Any] = field(default_factory=dict)
    overshoot_k: float = 0.1
    settled_s: float = np.inf
    dropped_s: float = np.inf
    largest_k: float = np.inf


ROWS = (
    Row("the same plant", 900, settled_s=390),  # 420 s at the first start
    Row("half the water", 700, {"volume_l": 4.0}, settled_s=275, dropped_s=60),  # 252 s
    Row("twice the water", 1300, {"volume_l": 16.0}, settled_s=830),  # 802 s
    Row("three times the lag", 1200, {"element_lag_s": 40.5, "sensor_lag_s": 18.0},
        settled_s=680),  # 608 s, at most 650
    Row("a third of the lag", 900, {"element_lag_s": 4.5, "sensor_lag_s": 2.0}, settled_s=400),
    Row("half the heater", 1400, {"heater_w": 750.0}, settled_s=920),  # 880 s
    Row("twice the heater", 700, {"heater_w": 3000.0}, settled_s=275, dropped_s=60),  # 242 s
    Row("an eighth of the water", 700, {"volume_l": 1.0, "ice_kg": 0.0}, overshoot_k=0.15,
        settled_s=190, dropped_s=30),  # 123 s, at most 144
    Row("a restart at the set point", 700, {"initial_c": SETPOINT_C}, largest_k=0.3),
)  # fmt: skip


def play(tank, seconds, remembered=None):
    """Return the cycles of a loop on `tank`, begun with what is `remembered`."""
    document = load(AQUARIUM).model_dump()
    document["loops"]["tank"].update(controller={"kind": "adaptive"}, shadow=None)
    settings = bench_settings(load(document), SEED)
    board = settings.boards["daq"].model_copy(update={"tolerances": 0.1, **tank})
    settings = settings.model_copy(update={"boards": {"daq": board}})
    cycles, clock = [], SimulatedClock()
    loop = loop_for(
        settings, clock, cycles.append, beside=False, remembered={"tank": remembered or {}}
    )
    for second in range(seconds):
        clock.sleep_until(float(second))
        loop.cycle(float(second))
    assert loop.shut_down()
    return cycles


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Return the store of a daemon that has run for twenty minutes on the rig."""
    store = LearnedStore(tmp_path_factory.mktemp("state"))
    cycles = play({}, 1200)
    ModelKeeper(store, lambda: 0.0).store({"tank": cycles[-1]}, at_end=True)
    return store


def events(cycles, name):
    """Return when the event `name` was, in s."""
    return [cycle.step.t_s for cycle in cycles for each in cycle.step.events if each.name == name]


def errors_k(cycles):
    return np.array([cycle.truth["true_temperature_c"] - SETPOINT_C for cycle in cycles])


def settled_s(cycles):
    """Return from when on the water is within .1 K for two minutes."""
    within = (np.abs(errors_k(cycles)) <= BAND_K).astype(float)
    held = np.convolve(within, np.ones(HELD_S), mode="valid") > HELD_S - 0.5
    return float(np.argmax(held)) if held.any() else np.inf


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_a_start_with_the_model_of_the_rig_meets_its_figures(row, store):
    remembered, warning = store.load("tank")
    assert warning is None
    cycles = play(row.tank, row.seconds, remembered)
    overshoot_k = errors_k(cycles).max()
    dropped = events(cycles, "model.dropped")
    print(f"{row.name}: {overshoot_k:.3f} K, {settled_s(cycles):.0f} s, dropped {dropped}")
    assert len(events(cycles, "model.recalled")) == 1
    assert overshoot_k < row.overshoot_k
    assert settled_s(cycles) < row.settled_s
    assert np.abs(errors_k(cycles)).max() < row.largest_k
    if row.dropped_s < np.inf:
        assert dropped
        assert dropped[0] < row.dropped_s


def test_the_model_of_the_same_plant_is_trusted_within_a_quarter_of_its_warm_up(store):
    cycles = play({}, 120, store.load("tank")[0])
    assert [cycles[0].step.origin, cycles[-1].step.origin] == ["trial", "stored"]
    assert events(cycles, "model.trusted")[0] < 100.0


POISON = {
    "a gain ten times too small": {"gain_k_per_s": 0.004, "gain_sd_k_per_s": 0.0001},
    "a gain ten times too large": {"gain_k_per_s": 0.42, "gain_sd_k_per_s": 0.001},
    "hardly any loss left to hold": {"loss_k_per_s": 0.038},
    "a loss that heats": {"loss_k_per_s": -0.02},
    "the shortest lag": {"likeliest": 0},
    "the longest lag": {"likeliest": -1},
    "noise of ten kelvin": {"noise_variance_k2": 100.0},
}


@pytest.mark.parametrize("changed", POISON.values(), ids=POISON)
def test_a_model_that_lies_within_its_bounds_costs_no_more_than_a_tenth_of_a_kelvin(
    changed, store, tmp_path
):
    """Fault 39: whatever passes for plausible is found out before the water is at its set point."""
    path = tmp_path / "model-tank.json"
    whole = json.loads(store.path_of("tank").read_text())
    model = whole["content"]["models"]["adaptive"]["model"]
    sure = [-30.0] * len(model["log_weights"])
    sure[changed.get("likeliest", 0)] = 0.0
    model.update(changed | ({"log_weights": sure} if "likeliest" in changed else {}))
    if "loss_k_per_s" not in changed:
        share = model["gain_k_per_s"]
        model["loss_k_per_s"] = min(model["loss_k_per_s"], 0.5 * share)
    path.write_text(json.dumps(whole))
    cycles = play({}, 900, LearnedStore(tmp_path).load("tank")[0])
    assert events(cycles, "model.recalled")
    overshoot_k = errors_k(cycles).max()
    print(f"{overshoot_k:.3f} K, settled {settled_s(cycles):.0f} s")
    assert overshoot_k < 0.1
    assert settled_s(cycles) < 520.0
