"""``thermoctl compare`` that is ended early: results are kept, and no process is left behind."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest

from thermoctl.app.commands.compare import RESULTS
from thermoctl.studies.compare.store import Store

pytestmark = pytest.mark.e2e

PATIENCE_S = 30.0
SEEDS = 300  # far more than are finished before the end


class Comparison:
    """One under way, the leader of a group; every process of it holds its standard streams."""

    def __init__(self, folder):
        self.results, self.gone = folder / RESULTS, False
        words = f"compare --controller on-off --scenario warm-up --seeds {SEEDS} --jobs 2 --out"
        self.process = subprocess.Popen(
            [sys.executable, "-m", "thermoctl", *words.split(), str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def wait_for_a_result(self):
        until_s = time.monotonic() + PATIENCE_S
        while not self.results.exists():
            assert self.process.poll() is None
            assert time.monotonic() < until_s
            time.sleep(0.02)

    def left(self):
        """Return exit code, stdout and stderr, once the last process has let go of the streams."""
        out, err = self.process.communicate(timeout=PATIENCE_S)
        self.gone = True
        return self.process.returncode, out, err

    def close(self):
        if not self.gone:
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait(PATIENCE_S)
        self.process.stdout.close()
        self.process.stderr.close()


@pytest.fixture
def comparison(tmp_path):
    """Return a comparison on two processes that has finished its first runs."""
    running = Comparison(tmp_path / "out")
    try:
        running.wait_for_a_result()
        yield running
    finally:
        running.close()


def kept(comparison):
    store = Store(comparison.results)
    assert 0 < len(store) < 2 * SEEDS
    assert store.passed_over == 0
    return len(store)


@pytest.mark.parametrize(
    ("number", "code", "word"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")],
    ids=["INT", "TERM"],
)
def test_a_signal_keeps_what_is_finished_and_leaves_no_process(comparison, number, code, word):
    comparison.process.send_signal(number)
    ended, out, err = comparison.left()
    assert (ended, out) == (code, "")
    told = f"{kept(comparison)} of {2 * SEEDS} runs are in {comparison.results}"
    assert f"{told}; the same command goes on from there" in err
    assert err.splitlines()[-1] == f"thermoctl: {word}"
    assert "Traceback" not in err


def test_sigterm_to_all_of_its_processes_is_the_same_end(comparison):
    comparison.process.send_signal(signal.SIGTERM)  # as `timeout` does: first one, then all
    os.killpg(comparison.process.pid, signal.SIGTERM)
    code, _, err = comparison.left()
    assert code == 143
    assert f"{kept(comparison)} of {2 * SEEDS} runs are in" in err
    assert "Traceback" not in err


def test_sigkill_leaves_no_process_either_and_keeps_what_is_finished(comparison):
    comparison.process.kill()
    assert comparison.left()[0] == -signal.SIGKILL
    assert kept(comparison)
