"""A set point so near a trip that a usual overshoot latches is told of; one with room is not."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from thermoctl.app.bench import BenchOptions, run_bench
from thermoctl.app.doctor import WARN, examine
from thermoctl.app.doubts import doubts
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, default_profile

PROFILES = sorted((Path(__file__).parents[3] / "config").glob("*.toml"))


def told(**keys) -> dict[str, str]:
    """Return what is told of a loop with a trip at 60 and `keys`, by key."""
    table = {"setpoint_c": 37.5, "trip_above_c": 60, "setpoint_max_c": 55, **keys}
    return {each.key: each.text for each in doubts(load({"loops": {"tank": table}}))}


@pytest.mark.parametrize("path", PROFILES, ids=lambda path: path.stem)
def test_no_profile_is_doubtful(path):
    assert doubts(load(path)) == []


@pytest.mark.parametrize(
    ("laws", "near_c", "far_c"),
    [
        ({"controller": "adaptive"}, 59.01, 59.0),
        ({"controller": "pid"}, 57.01, 57.0),
        ({"controller": "on-off"}, 57.01, 57.0),
        ({"controller": "adaptive", "shadow": "pid"}, 57.01, 57.0),
        ({"controller": "pid", "shadow": "adaptive"}, 57.01, 57.0),
    ],
)
def test_a_set_point_needs_the_room_of_its_laws(laws, near_c, far_c):
    near = told(setpoint_c=near_c, setpoint_max_c=near_c, **laws)
    assert list(near) == ["setpoint_c"]
    assert f"expected {far_c:g}, {60 - far_c:g} K below trip_above_c" in near["setpoint_c"]
    assert told(setpoint_c=far_c, setpoint_max_c=far_c, **laws) == {}


def test_the_highest_set_point_needs_room_as_well():
    assert "got 59.5" in told(setpoint_max_c=59.5)["setpoint_max_c"]


def test_without_a_highest_set_point_the_trip_itself_can_be_asked_for():
    words = told(setpoint_max_c=None)["setpoint_max_c"]
    assert words.startswith("expected 59, 1 K below trip_above_c, or farther, got none")


def test_what_heats_does_not_fall_below_the_lower_trip():
    assert told(setpoint_c=10.0, trip_below_c=9.9, setpoint_min_c=9.9) == {}


def test_what_cools_overshoots_downwards():
    cool = {"controller": {"kind": "adaptive", "action": "cool"}, "trip_below_c": 0.0}
    near = told(setpoint_c=0.5, setpoint_min_c=0.5, setpoint_max_c=60.0, **cool)
    assert list(near) == ["setpoint_c"]
    assert "expected 1, 1 K above trip_below_c" in near["setpoint_c"]
    assert told(setpoint_c=12.0, setpoint_min_c=5.0, setpoint_max_c=60.0, **cool) == {}


def board(kind: str, **keys) -> list[str]:
    """Return the keys that are doubtful in a loop on a board of this kind."""
    port = {"port": "/dev/null"} if kind == "thermodaq" else {}
    loop = {"setpoint_c": 37.5, "setpoint_max_c": 55, "trip_above_c": 60, **keys}
    loop |= {"sensor": {"board": "daq"}, "actuator": {"board": "daq"}}
    settings = load({"boards": {"daq": {"kind": kind, **port}}, "loops": {"tank": loop}})
    return [each.key for each in doubts(settings) if each.event == "config.unstated"]


@pytest.mark.parametrize(
    ("keys", "key"),
    [
        ({}, ["heater_w"]),
        ({"heater_w": 1500}, ["volume_l"]),
        ({"heater_w": 1500, "volume_l": 8}, []),
        ({"heater_check": {"weakest_k_per_s": 0.01}}, []),
        ({"heater_check": {"enabled": False}}, []),
        ({"controller": {"kind": "adaptive", "action": "cool"}}, []),
    ],
)
def test_a_real_heater_is_to_be_described(keys, key):
    assert board("thermodaq", **keys) == key
    assert board("simulated", **keys) == board("null", **keys) == []


@pytest.fixture
def narrow() -> str:
    """Return the aquarium, its shadow too, with its set point next to the trip, as TOML."""
    text = default_profile().read_text(encoding="utf-8")
    return text.replace("trip_above_c = 60.0", "trip_above_c = 38.0").replace(
        "setpoint_max_c = 55.0", "setpoint_max_c = 37.5"
    )


@pytest.fixture
def path(tmp_path, narrow) -> Path:
    """Return a file that holds it."""
    path = tmp_path / "narrow.toml"
    path.write_text(narrow, encoding="utf-8")
    path.chmod(0o644)
    return path


def test_a_bench_test_says_it_at_its_start_and_in_its_history(path, tmp_path, capsys):
    history = tmp_path / "run.sqlite"
    options = BenchOptions(float("inf"), 5.0, as_json=True, history=history)
    run_bench(bench_settings(path, 1), options)
    line = capsys.readouterr().err.splitlines()[0]
    assert line.startswith("thermoctl: loops.tank.setpoint_c: expected 35, 3 K below trip_above_c")
    with closing(sqlite3.connect(history)) as record:
        rows = record.execute("SELECT count(*) FROM events WHERE name = 'config.narrow'")
        assert rows.fetchone() == (1,)


def test_the_doctor_warns(path, tmp_path):
    warned = [each.text for each in examine([path], tmp_path) if each.status == WARN]
    assert any(each.startswith("loops.tank.setpoint_c: expected 35") for each in warned)
