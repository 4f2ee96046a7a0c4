"""Fault 40: a write cut short at any point leaves the old record or the new one, never a torn one.

A child process is killed at every single call into C that a write makes, one after the other.
"""

from __future__ import annotations

import pytest

STORED = """
from thermoctl.services.store import Latch, LatchStore

store = LatchStore(folder)
OLD, NEW = Latch("sensor.open", "old", 1, 1.0), Latch("trip.over_temperature", "new", 9, 2.0)

def before():
    store.save("tank", OLD)

def found():
    latch = store.load("tank")
    return None if latch is None else latch.text

def act():
"""
ACTS = {"save": '    store.save("tank", NEW)', "clear": '    store.clear("tank")'}


@pytest.fixture(scope="module", params=list(ACTS))
def killed(request, tmp_path_factory, kill_at_every_call):
    """Return the calls of a save or a clear, and what was found after a kill at each of them."""
    folder = tmp_path_factory.mktemp("state")
    return request.param, kill_at_every_call(folder, STORED + ACTS[request.param])


def test_a_kill_at_any_call_leaves_the_old_record_or_the_new_one(killed):
    kind, result = killed
    after = "new" if kind == "save" else None
    first_new = result["outcomes"].index(after)
    assert first_new > 0
    assert set(result["outcomes"][:first_new]) == {"old"}
    assert set(result["outcomes"][first_new:]) == {after}


def test_the_content_reaches_the_disk_before_its_name_and_the_folder_after(killed):
    kind, result = killed
    calls = result["calls"]
    if kind == "save":
        assert calls.index("fsync") < calls.index("replace")
        assert "fsync" in calls[calls.index("replace") :]
    else:
        assert "fsync" in calls[calls.index("unlink") :]


def test_kills_leave_no_litter(killed):
    assert killed[1]["files"] == ["latch-tank.json"]
