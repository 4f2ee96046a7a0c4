"""Orders weighed beside a running loop, as a user sees them."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.e2e

AQUARIUM = (Path(__file__).parents[2] / "config" / "aquarium.toml").read_text()
ON_OFF = AQUARIUM.replace('"adaptive"', '"on-off"').replace("calmness", "#")
ORDERS = "\n[loops.tank.orders]\n"


def lines_of(folder, config, duration):
    (folder / "own.toml").write_text(config)
    came = subprocess.run(
        [
            sys.executable,
            "-m",
            "thermoctl",
            "--sim",
            "-c",
            "own.toml",
            "--speed",
            "max",
            "--duration",
            duration,
            "--no-history",
            "--json",
        ],
        cwd=folder,
        env=os.environ,
        capture_output=True,
        text=True,
        timeout=60.0,
        check=True,
    )
    return [json.loads(line) for line in came.stdout.splitlines()][:-1]


def test_a_bench_test_tells_the_order_once_it_is_known_and_nothing_else_changes(tmp_path):
    plain = lines_of(tmp_path, ON_OFF, "25m")
    weighed = lines_of(tmp_path, ON_OFF + ORDERS, "25m")
    assert "order" not in weighed[500]
    last = weighed[-1]
    n, m, delay = last.pop("order")
    assert last.pop("order_probability") >= 0.95
    assert (n, m) <= (3, 2)
    assert delay >= 8  # lags of 13.5 and 6 s look like dead time
    assert last.keys() == plain[-1].keys()
    steered = ("temperature_c", "power", "accepted_power", "a", "innovation_k", "state")
    for before, after in zip(plain, weighed, strict=True):
        assert [before[key] for key in steered] == [after[key] for key in steered]


def test_a_daemon_that_weighs_orders_runs_and_ends_as_any_other(start):
    daemon = start(config=AQUARIUM + ORDERS)
    daemon.wait_for("board.opened")
    code, _ = daemon.end(signal.SIGTERM)
    assert code == 0
    assert daemon.named("loop.stopped")[0]["power_0_confirmed"] is True
    assert not daemon.named("orders.failed")
