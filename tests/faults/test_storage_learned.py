"""Faults 38 and 40 of a learnt model: a write cut short leaves the old one or the new one.

A child process is killed at every single call into C that a write makes, one after the other.
"""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow  # a process for every call

KILL_AT_EVERY_CALL = """
import json, os, signal, sys
from pathlib import Path
from thermoctl.services.learned import LearnedStore

store = LearnedStore(Path(sys.argv[1]))

def run_until(fatal):
    calls = []
    def watch(frame, event, called):
        if event == "c_call":
            calls.append(called.__name__)
            if len(calls) == fatal:
                os.kill(os.getpid(), signal.SIGKILL)
    sys.setprofile(watch)
    store.save("tank", {"adaptive": {"gain": 2.0}})
    sys.setprofile(None)
    return calls

store.save("tank", {"adaptive": {"gain": 1.0}})
calls, outcomes = run_until(0), []
for fatal in range(1, len(calls) + 1):
    store.save("tank", {"adaptive": {"gain": 1.0}})
    child = os.fork()
    if child == 0:
        run_until(fatal)
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    assert os.WIFSIGNALED(status), fatal
    models, warning = store.load("tank")
    outcomes.append(warning or models["adaptive"].model["gain"])
store.save("tank", {"adaptive": {"gain": 2.0}})
print(json.dumps({"calls": calls, "outcomes": outcomes, "files": os.listdir(sys.argv[1])}))
"""


def test_a_kill_at_any_call_leaves_the_old_model_or_the_new_one_and_no_litter(tmp_path):
    command = [sys.executable, "-c", KILL_AT_EVERY_CALL, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    outcomes, calls = result["outcomes"], result["calls"]
    first_new = outcomes.index(2.0)
    assert first_new > 0
    assert set(outcomes[:first_new]) == {1.0}
    assert set(outcomes[first_new:]) == {2.0}
    assert calls.index("fsync") < calls.index("replace")
    assert "fsync" in calls[calls.index("replace") :]
    assert result["files"] == ["model-tank.json"]
