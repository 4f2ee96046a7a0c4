"""What is left of a write that was killed, at every call into C that it makes."""

import json
import subprocess
import sys

import pytest

# `before`, `act` and `found` are the test's: what is stored first, what is killed, what is left.
PROGRAM = """
import json, os, signal, sys
from pathlib import Path

folder = Path(sys.argv[1])
{text}

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

before()
calls, outcomes = run_until(0), []
for fatal in range(1, len(calls) + 1):
    before()
    child = os.fork()
    if child == 0:
        run_until(fatal)
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    assert os.WIFSIGNALED(status), fatal
    outcomes.append(found())
before()
print(json.dumps({{"calls": calls, "outcomes": outcomes, "files": os.listdir(folder)}}))
"""


@pytest.fixture(scope="session")
def kill_at_every_call():
    """Return a function: what calls `act` makes, what `found` says after each kill, what files."""

    def kill(folder, text):
        command = [sys.executable, "-c", PROGRAM.format(text=text), str(folder)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return kill
