"""The keeper of latches: the disk follows the regulator, an operator's deletion is a request."""

from __future__ import annotations

import threading

import pytest

from thermoctl.services.latches import LatchKeeper
from thermoctl.services.store import Latch, LatchStore
from thermoctl.signals import Alarm

ALARM = Alarm("trip.over_temperature", 9, 1, 12.0, "expected below 50, got 61.5", latched=True)
OTHER = Alarm("sensor.open", 1, 1, 13.0, "counts at the top", latched=True)


@pytest.fixture
def state(tmp_path):
    return tmp_path / "state"


@pytest.fixture
def store(state, tmp_path, wall_clock):
    return LatchStore(state, tmp_path / "run", wall_clock)


@pytest.fixture
def acks():
    return []


@pytest.fixture
def told():
    return []


@pytest.fixture
def keeper(store, acks, wall_clock, told):
    return LatchKeeper(store, acks.append, wall_clock=wall_clock, report=told.append)


def test_a_latch_is_on_disk_after_one_pass(keeper, store):
    keeper.latched("tank", ALARM)
    keeper.keep()
    assert store.load("tank") == Latch(ALARM.code, ALARM.text, 9, 1.7e9)
    assert keeper.problem is None


def test_a_latch_repeated_every_cycle_keeps_its_date(keeper, store, wall_clock):
    for _ in range(3):
        keeper.latched("tank", ALARM)
        keeper.keep()
        wall_clock.utc_s += 1.0
    assert store.load("tank").since_utc_s == 1.7e9


def test_a_latch_taken_over_from_an_earlier_run_keeps_its_date(store, acks, wall_clock):
    store.save("tank", Latch(ALARM.code, ALARM.text, 9, 1.6e9))
    keeper = LatchKeeper(store, acks.append, wall_clock=wall_clock)
    keeper.latched("tank", ALARM)
    keeper.keep()
    assert store.load("tank").since_utc_s == 1.6e9


def test_a_second_cause_replaces_the_first(keeper, store):
    keeper.latched("tank", ALARM)
    keeper.keep()
    keeper.latched("tank", OTHER)
    keeper.keep()
    assert store.load("tank").code == "sensor.open"


def test_a_cleared_latch_leaves_the_disk(keeper, store, acks):
    keeper.latched("tank", ALARM)
    keeper.keep()
    keeper.cleared("tank")
    keeper.keep()
    assert store.load("tank") is None
    assert acks == []


def test_a_latch_nobody_took_over_is_never_removed(keeper, store):
    store.save("tank", Latch(ALARM.code, ALARM.text))
    keeper.cleared("tank")
    keeper.keep()
    assert store.exists("tank")


def test_latch_clear_latch_in_one_pass_ends_latched(keeper, store):
    keeper.latched("tank", ALARM)
    keeper.cleared("tank")
    keeper.latched("tank", OTHER)
    keeper.keep()
    assert store.load("tank").code == "sensor.open"


def test_a_deleted_file_is_one_request_and_comes_back_until_it_is_granted(keeper, store, acks):
    keeper.latched("tank", ALARM)
    keeper.keep()
    store.clear("tank")
    for _ in range(3):
        keeper.keep()
    assert acks == ["tank"]
    assert store.exists("tank")
    keeper.cleared("tank")
    keeper.keep()
    assert not store.exists("tank")


def test_a_write_that_fails_is_tried_until_it_holds_and_told_once(keeper, store, state, told):
    state.write_text("in the way")
    keeper.latched("tank", ALARM)
    for _ in range(3):
        keeper.keep()
    assert "spare folder" in keeper.problem
    assert store.exists("tank")
    state.unlink()
    keeper.keep()
    assert keeper.problem is None
    assert (state / "latch-tank.json").is_file()
    assert [event.name for event in told] == ["latch.unsaved", "latch.saved"]
    assert told[0].t_s == ALARM.since_s


def test_without_any_folder_the_latch_waits_in_memory(tmp_path, acks, wall_clock):
    blocked = tmp_path / "state"
    blocked.write_text("in the way")
    store = LatchStore(blocked, wall_clock=wall_clock)
    keeper = LatchKeeper(store, acks.append, wall_clock=wall_clock)
    keeper.latched("tank", ALARM)
    keeper.keep()
    assert "latch of tank" in keeper.problem
    blocked.unlink()
    keeper.keep()
    assert store.load("tank").code == ALARM.code
    assert acks == []


def test_the_thread_stores_at_once_and_before_it_closes(store, acks):
    keeper = LatchKeeper(store, acks.append, poll_s=3600.0)
    keeper.start()
    keeper.latched("tank", ALARM)
    assert keeper.close(timeout_s=30.0)
    assert store.load("tank").code == ALARM.code


def test_a_keeper_that_could_not_write_does_not_close_as_if_it_had(store, state, acks):
    state.write_text("in the way")
    keeper = LatchKeeper(store, acks.append, poll_s=3600.0)
    keeper.start()
    keeper.latched("tank", ALARM)
    assert not keeper.close(timeout_s=30.0)


def test_the_thread_hands_a_deletion_on(store):
    asked = threading.Event()
    keeper = LatchKeeper(store, lambda loop: asked.set(), poll_s=0.001)
    keeper.latched("tank", ALARM)
    keeper.keep()
    store.clear("tank")
    keeper.start()
    assert asked.wait(30.0)
    assert keeper.close(timeout_s=30.0)
