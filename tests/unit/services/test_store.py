"""State on disk: what was stored comes back; what was not is a warning, and a latch stays one."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.services.store import (
    UNREADABLE,
    Latch,
    LatchStore,
    RunRecord,
    RunStore,
    StateStore,
)
from thermoctl.signals import Mode

LATCH = Latch("trip.over_temperature", "expected below 50, got 61.5", 9, 1.7e9)
GARBAGE = {
    "empty": b"",
    "zeroes": b"\0" * 200,
    "torn": b'{"format": 1, "written_utc_s": 1.7e9, "cont',
    "binary": bytes(range(256)),
    "a list": b"[1, 2]",
    "deep": b"[" * 60_000,
    "long": b" " * 70_000,
    "newer format": b'{"format": 2, "written_utc_s": 1.7e9, "content": {}}',
    "no time": b'{"format": 1, "written_utc_s": NaN, "content": {}}',
    "the future": b'{"format": 1, "written_utc_s": 1.8e9, "content": {}}',
}


def test_a_latch_comes_back_as_it_was_saved(tmp_path, wall_clock):
    store = LatchStore(tmp_path / "state", wall_clock=wall_clock)
    assert store.load("tank") is None
    assert store.save("tank", LATCH)
    assert store.load("tank") == LATCH
    assert store.load("mash") is None


def test_what_could_not_be_put_in_place_is_told_and_leaves_no_litter(tmp_path, wall_clock):
    store = StateStore(tmp_path, wall_clock)
    store.path_of("run-tank").mkdir()
    with pytest.raises(OSError, match="run-tank"):
        store.write("run-tank", {})
    assert [each.name for each in tmp_path.iterdir()] == ["run-tank.json"]


def test_a_cleared_latch_is_gone_and_clearing_twice_is_fine(tmp_path, wall_clock):
    store = LatchStore(tmp_path, tmp_path / "run", wall_clock)
    store.save("tank", LATCH)
    store.clear("tank")
    store.clear("tank")
    assert store.load("tank") is None
    assert not store.exists("tank")


@pytest.mark.parametrize("content", GARBAGE.values(), ids=GARBAGE)
def test_a_latch_file_that_cannot_be_read_counts_as_latched(tmp_path, wall_clock, content):
    (tmp_path / "latch-tank.json").write_bytes(content)
    latch = LatchStore(tmp_path, wall_clock=wall_clock).load("tank")
    assert latch is not None
    assert latch.code == UNREADABLE


@given(content=st.binary(max_size=300))
@settings(max_examples=200)
def test_no_content_of_a_latch_file_means_unlatched(content, tmp_path_factory):
    directory = tmp_path_factory.mktemp("latch")
    (directory / "latch-tank.json").write_bytes(content)
    assert LatchStore(directory).load("tank") is not None


def test_a_latch_file_that_is_a_folder_counts_as_latched(tmp_path):
    (tmp_path / "latch-tank.json").mkdir()
    latch = LatchStore(tmp_path).load("tank")
    assert latch is not None
    assert latch.code == UNREADABLE


@pytest.mark.parametrize(
    "content",
    [{}, {"code": 3, "text": "x"}, {"code": "x"}],
)
def test_a_latch_record_of_another_shape_counts_as_latched(tmp_path, wall_clock, content):
    StateStore(tmp_path, wall_clock).write("latch-tank", content)
    latch = LatchStore(tmp_path, wall_clock=wall_clock).load("tank")
    assert latch is not None
    assert latch.code == UNREADABLE


def test_a_latch_whose_date_is_unknown_is_kept_without_one(tmp_path):
    store = LatchStore(tmp_path)
    store.save("tank", Latch("sensor.open", "text"))
    latch = store.load("tank")
    assert latch is not None
    assert math.isnan(latch.since_utc_s)


def test_the_spare_folder_holds_the_latch_when_the_first_does_not(tmp_path, wall_clock):
    blocked = tmp_path / "state"
    blocked.write_text("a file where a folder should be")
    store = LatchStore(blocked, tmp_path / "run", wall_clock)
    assert store.save("tank", LATCH) is False
    assert LatchStore(tmp_path / "elsewhere", tmp_path / "run", wall_clock).load("tank") == LATCH


def test_no_folder_at_all_is_an_error(tmp_path):
    blocked = tmp_path / "state"
    blocked.write_text("")
    with pytest.raises(OSError):
        LatchStore(blocked, blocked).save("tank", LATCH)


@given(loop=st.text(min_size=1, max_size=15))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_any_loop_name_makes_one_file_in_the_folder(loop, tmp_path_factory):
    directory = tmp_path_factory.mktemp("names")
    store = LatchStore(directory)
    store.save(loop, LATCH)
    assert store.load(loop) == LATCH
    (entry,) = directory.iterdir()
    assert entry.is_file()


def test_a_run_record_comes_back_as_it_was_saved(tmp_path):
    store = RunStore(tmp_path)
    record = RunRecord(Mode.AUTO, 41.5)
    assert store.load("tank") == (None, None)
    store.save("tank", record)
    assert store.load("tank") == (record, None)


@pytest.mark.parametrize("content", GARBAGE.values(), ids=GARBAGE)
def test_a_run_record_that_cannot_be_read_is_ignored_with_a_warning(tmp_path, wall_clock, content):
    (tmp_path / "run-tank.json").write_bytes(content)
    record, warning = RunStore(tmp_path, wall_clock).load("tank")
    assert record is None
    assert warning is not None
    assert "run-tank.json cannot be understood: " in warning


@pytest.mark.parametrize(
    "content",
    [
        {"mode": "turbo", "setpoint_c": 41.0},
        {"mode": "auto", "setpoint_c": True},
        {"mode": "auto", "setpoint_c": "41"},
        {"mode": None, "setpoint_c": 41.0},
    ],
)
def test_a_run_record_of_another_shape_is_ignored_with_a_warning(tmp_path, wall_clock, content):
    StateStore(tmp_path, wall_clock).write("run-tank", content)
    record, warning = RunStore(tmp_path, wall_clock).load("tank")
    assert record is None
    assert warning is not None


def test_a_record_of_last_hour_survives_a_clock_set_back(tmp_path, wall_clock):
    store = RunStore(tmp_path, wall_clock)
    store.save("tank", RunRecord(Mode.MANUAL, 20.0))
    wall_clock.utc_s -= 3600.0
    assert store.load("tank") == (RunRecord(Mode.MANUAL, 20.0), None)


def test_a_record_from_the_future_is_ignored(tmp_path, wall_clock):
    store = RunStore(tmp_path, wall_clock)
    store.save("tank", RunRecord(Mode.AUTO, 41.0))
    wall_clock.utc_s -= 31_536_000.0
    record, warning = store.load("tank")
    assert record is None
    assert "future" in (warning or "")


def test_what_is_no_json_leaves_the_old_document(tmp_path, wall_clock):
    store = StateStore(tmp_path, wall_clock)
    store.write("x", {"value": 1})
    with pytest.raises(ValueError):
        store.write("x", {"value": math.nan})
    assert store.read("x").document == {"value": 1}
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.json"]
    assert json.loads((tmp_path / "x.json").read_text())["written_utc_s"] == 1.7e9
