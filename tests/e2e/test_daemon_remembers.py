"""What a daemon takes up of an earlier run's learning, and what it leaves."""

import json
import signal

import pytest

from thermoctl.services.learned import LearnedStore

pytestmark = pytest.mark.e2e

PID = """
[boards.daq]
kind = "simulated"
initial_c = 37.5

[loops.tank]
setpoint_c = 37.5
trip_above_c = 60.0
mode = "auto"
resume = true
controller = {kind = "pid", tuning = "relay"}
shadow = "adaptive"

[loops.tank.sensor]
board = "daq"

[loops.tank.actuator]
board = "daq"
law = "square"
"""
FOUND = {
    "tuning": "relay",
    "tuned_form": "pi",
    "period_s": 1.0,
    "gain_per_k": 0.3,
    "integral_s": 120.0,
    "derivative_s": 0.0,
    "slope_k_per_s": 0.036,
    "text": "ultimate gain .96 per K, period 54 s",
}


@pytest.fixture
def folder(tmp_path):
    """Return the state folder, before any daemon."""
    folder = tmp_path / "state"
    folder.mkdir(mode=0o700)
    return folder


def value(daemon, key):
    return json.loads(daemon.ask("get", key, "--json").stdout)


def test_a_start_takes_a_model_up_and_the_end_stores_it_again(folder, start):
    store = LearnedStore(folder)
    store.save("tank", {"pid": FOUND})
    daemon = start(config=PID)
    daemon.wait_for("model.recalled")
    daemon.wait_for("socket.opened")
    assert daemon.named("model.recalled")[0]["controller"] == "pid"
    assert value(daemon, "model_origin") == "stored"
    daemon.wait_until(lambda: value(daemon, "state") == "run", "loop that runs")
    store.forget("tank")
    code, took_s = daemon.end(signal.SIGTERM)
    print(f"ended after {took_s:.2f} s")
    assert code == 0
    models, warning = store.load("tank")
    assert warning is None
    assert models["pid"].model["gain_per_k"] == FOUND["gain_per_k"]


def test_a_torn_file_is_ignored_with_the_reason_and_the_loop_runs(folder, start):
    path = LearnedStore(folder).path_of("tank")
    path.write_text('{"format": 1, "content"')
    daemon = start(config=PID)
    daemon.wait_for("state.ignored")
    daemon.wait_for("board.opened")
    assert str(path) in daemon.named("state.ignored")[0]["why"]
    assert daemon.end(signal.SIGTERM)[0] == 0


def test_an_implausible_model_is_ignored_law_by_law_with_the_reasons(folder, start):
    models = {"pid": FOUND | {"gain_per_k": 1e6}, "adaptive": {"action": "heat"}}
    LearnedStore(folder).save("tank", models)
    daemon = start(config=PID)
    daemon.wait_for("model.ignored", 2)
    reasons = {each["controller"]: each["why"] for each in daemon.named("model.ignored")}
    assert "gain_per_k" in reasons["pid"]
    assert "period_s" in reasons["adaptive"]
    assert daemon.end(signal.SIGTERM)[0] == 0


def test_a_controller_that_was_put_in_charge_is_in_charge_after_a_kill(folder, start):
    daemon = start(config=PID)
    daemon.wait_for("board.opened")
    daemon.wait_for("socket.opened")
    assert daemon.ask("controller", "adaptive").returncode == 0
    run = folder / "run-tank.json"
    daemon.wait_until(lambda: '"exchanged": true' in run.read_text(), "record of the exchange")
    daemon.end(signal.SIGKILL)
    daemon.start()
    daemon.wait_for("controller.resumed")
    daemon.wait_for("board.opened", 2)
    daemon.wait_for("socket.opened", 2)
    assert value(daemon, "controller") == "adaptive"
    daemon.end(signal.SIGTERM)
