"""Faults 38 and 40 of a learnt model: a write cut short leaves the old one or the new one.

A child process is killed at every single call into C that a write makes, one after the other.
"""

from __future__ import annotations

import pytest

pytestmark = pytest.mark.slow  # a process for every call

STORED = """
from thermoctl.services.learned import LearnedStore

store = LearnedStore(folder)

def before():
    store.save("tank", {"adaptive": {"gain": 1.0}})

def act():
    store.save("tank", {"adaptive": {"gain": 2.0}})

def found():
    models, warning = store.load("tank")
    return warning or models["adaptive"].model["gain"]
"""


def test_a_kill_at_any_call_leaves_the_old_model_or_the_new_one_and_no_litter(
    kill_at_every_call, tmp_path
):
    result = kill_at_every_call(tmp_path, STORED)
    outcomes, calls = result["outcomes"], result["calls"]
    first_new = outcomes.index(2.0)
    assert first_new > 0
    assert set(outcomes[:first_new]) == {1.0}
    assert set(outcomes[first_new:]) == {2.0}
    assert calls.index("fsync") < calls.index("replace")
    assert "fsync" in calls[calls.index("replace") :]
    assert result["files"] == ["model-tank.json"]
