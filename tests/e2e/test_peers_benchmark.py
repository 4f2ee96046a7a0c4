"""The benchmark beside other packages: what it compares agrees; its times are judged by nobody."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

PEERS = Path(__file__).parents[2] / "benchmarks" / "peers.py"
pytestmark = pytest.mark.e2e


def benchmark(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the benchmark to its end."""
    return subprocess.run(
        [sys.executable, str(PEERS), *arguments],
        capture_output=True,
        text=True,
        timeout=300.0,
        check=False,
    )


@pytest.mark.slow
def test_every_peer_that_is_there_computes_what_the_laws_compute():
    done = benchmark("--rounds", "1", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    compared = {line["peer"] for line in found["lines"]}
    assert compared >= {"padasip, adapt", "filterpy", "simdkalman"}, found["absent"]
    assert [line for line in found["lines"] if not line["agrees"]] == []
    assert {goal["n"] for goal in found["goals"]} == {1, 2, 4}


def test_no_rounds_are_refused_by_name():
    done = benchmark("--rounds", "0")
    assert done.returncode == 2
    assert "--rounds must be at least 1, got 0" in done.stderr
