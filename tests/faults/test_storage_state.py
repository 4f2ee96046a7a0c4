"""Fault 40: a write cut short at any point leaves the old record or the new one, never a torn one.

A child process is killed at every single call into C that a write makes, one after the other.
"""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

KILL_AT_EVERY_CALL = """
import json, os, signal, sys
from pathlib import Path
from thermoctl.services.store import Latch, LatchStore

store = LatchStore(Path(sys.argv[1]))
OLD, NEW = Latch("sensor.open", "old", 1, 1.0), Latch("trip.over_temperature", "new", 9, 2.0)

def act():
    store.save("tank", NEW) if sys.argv[2] == "save" else store.clear("tank")

def run_until(fatal):
    calls = []
    def watch(frame, event, called):
        if event == "c_call":
            calls.append(called.__name__)
            if len(calls) == fatal:
                os.kill(os.getpid(), signal.SIGKILL)
    sys.setprofile(watch)
    act()
    sys.setprofile(None)
    return calls

store.save("tank", OLD)
calls, outcomes = run_until(0), []
for fatal in range(1, len(calls) + 1):
    store.save("tank", OLD)
    child = os.fork()
    if child == 0:
        run_until(fatal)
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    assert os.WIFSIGNALED(status), fatal
    latch = store.load("tank")
    outcomes.append(None if latch is None else latch.text)
store.save("tank", NEW)
print(json.dumps({"calls": calls, "outcomes": outcomes, "files": os.listdir(sys.argv[1])}))
"""


@pytest.fixture(scope="module", params=["save", "clear"])
def killed(request, tmp_path_factory):
    """Return the calls of a save or a clear, and what was found after a kill at each of them."""
    folder = tmp_path_factory.mktemp("state")
    command = [sys.executable, "-c", KILL_AT_EVERY_CALL, str(folder), request.param]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return request.param, json.loads(done.stdout)


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
