"""Commands against a running daemon: asked, refused, killed, and pestered by rude clients."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.e2e

AQUARIUM = (Path(__file__).parents[2] / "config" / "aquarium.toml").read_text()
PATIENCE_S = 15.0


def told(daemon, *words):
    ended = daemon.ask(*words, "--json")
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


def path_of(daemon):
    return daemon.folder / "run" / "thermoctl" / "control.sock"


def test_a_day_of_an_operator(daemon):
    shown = daemon.ask("status")
    assert shown.returncode == 0
    rows = [line.split(" : ") for line in shown.stdout.splitlines()]
    assert len({len(name) for name, _ in rows}) == 1  # the colons stand below each other
    assert {name.strip(): value for name, value in rows}["Set point"] == "37.50 °C"
    assert daemon.ask("set", "40").stdout == "tank: set point 40.00 °C\n"
    assert daemon.ask("get", "setpoint_c").stdout == "40.0\n"
    early = daemon.ask("output", "30%")
    assert (early.returncode, "manual" in early.stderr) == (1, True)
    assert told(daemon, "mode", "manual") == {"loop": "tank", "mode": "manual"}
    assert told(daemon, "output", "30%") == {"loop": "tank", "power": 0.3}
    assert told(daemon, "get", "power") == 0.3
    assert told(daemon, "mode", "auto", "--loop", "tank")["mode"] == "auto"
    assert told(daemon, "controller", "self-tuning-mv")["controller"] == "self-tuning-mv"
    assert told(daemon, "status")["loops"][0]["controller"] == "self-tuning-mv"
    assert (told(daemon, "alarms"), told(daemon, "alarms", "ack")) == ([], [])
    assert daemon.ask("status", "--check").returncode == 0
    daemon.wait_for("controller.changed")
    assert daemon.end(signal.SIGTERM)[0] == 0
    assert not path_of(daemon).exists()


def test_a_shell_is_offered_what_the_daemon_knows(daemon):
    def offered(*words):
        asked = {"_THERMOCTL_COMPLETE": "bash_complete", "COMP_WORDS": " ".join(words)}
        daemon.environ |= asked | {"COMP_CWORD": str(len(words) - 1)}
        return [line.partition(",")[2] for line in daemon.ask().stdout.splitlines()]

    assert offered("thermoctl", "get", "temp") == ["temperature_c"]
    assert offered("thermoctl", "mode", "off", "--loop", "t") == ["tank"]
    assert offered("thermoctl", "controller", "s") == ["self-tuning-mv"]


def test_refusals_say_what_was_expected_and_end_as_they_should(daemon):
    for words, code, text in [
        (("set", "99"), 1, "from 5 to 55"),
        (("set", "warm"), 2, "'warm'"),
        (("set", "40", "--loop", "bath"), 1, "tank"),
        (("mode", "program"), 2, "auto"),
        (("output", "30"), 2, "30%"),
        (("controller", "magic"), 1, "magic"),
        (("get", "wisdom"), 1, "temperature_c"),
        (("status", "--socket", str(daemon.folder / "none")), 3, "running daemon"),
        (("status", "--socket", "/" + "x" * 107), 69, "107 bytes"),
    ]:
        ended = daemon.ask(*words)
        assert (ended.returncode, ended.stdout) == (code, ""), words
        assert text in ended.stderr, words
        assert ended.stderr.startswith("thermoctl: "), words
    assert told(daemon, "get", "setpoint_c") == 37.5
    assert json.loads(daemon.ask("set", "99", "--json").stdout)["error"]["exit_code"] == 1


@pytest.mark.skipif(os.geteuid() == 0, reason="root may use every socket")
def test_a_socket_of_somebody_else_is_exit_77(daemon):
    path_of(daemon).chmod(0)
    assert daemon.ask("status").returncode == 77


def test_an_active_alarm_makes_the_check_exit_4(start):
    daemon = start(config=AQUARIUM.replace("initial_c = 25.0", "initial_c = 70.0"))
    daemon.wait_until(
        lambda: "latched" in daemon.ask("get", "state").stdout, "loop that is latched"
    )
    assert daemon.ask("status", "--check").returncode == 4
    (row,) = told(daemon, "alarms")
    assert (row["code"], row["latched"]) == ("trip.over_temperature", True)
    refused = daemon.ask("alarms", "ack")
    assert (refused.returncode, "still stands" in refused.stderr) == (1, True)


def test_watch_shows_cycles_until_it_is_interrupted(daemon):
    watch = subprocess.Popen(
        [sys.executable, "-m", "thermoctl", "watch", "--json"],
        env=daemon.environ,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    cycles = [json.loads(watch.stdout.readline()) for _ in range(3)]
    watch.send_signal(signal.SIGINT)
    _, errors = watch.communicate(timeout=PATIENCE_S)
    assert (watch.returncode, errors) == (0, "")
    assert cycles[0]["t_s"] < cycles[1]["t_s"] < cycles[2]["t_s"]
    assert cycles[0]["loop"] == "tank"
    assert daemon.process.poll() is None


def test_watch_ends_with_3_when_the_daemon_does(daemon):
    watch = subprocess.Popen(
        [sys.executable, "-m", "thermoctl", "watch"],
        env=daemon.environ,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert "°C" in watch.stdout.readline()
    assert daemon.end(signal.SIGTERM)[0] == 0
    _, errors = watch.communicate(timeout=PATIENCE_S)
    assert watch.returncode == 3
    assert "ended" in errors


def test_a_killed_daemon_leaves_a_socket_that_the_next_one_replaces(daemon):
    daemon.end(signal.SIGKILL)
    assert path_of(daemon).is_socket()
    assert daemon.ask("status").returncode == 3
    daemon.start()
    daemon.wait_for("socket.opened", 2)
    daemon.wait_for("board.opened", 2)
    daemon.wait_until(lambda: daemon.ask("status").returncode == 0, "answer")


def test_a_second_daemon_leaves_the_first_its_socket_and_controls_without_one(daemon):
    state = daemon.folder / "second"
    second = subprocess.Popen(
        [sys.executable, "-m", "thermoctl", "run", "-c", daemon.config, "--state", str(state)],
        env=daemon.environ,
        stderr=subprocess.PIPE,
        text=True,
    )
    names = []
    while not {"socket.unavailable", "board.opened"} <= set(names):
        names.append(json.loads(second.stderr.readline())["event"])
    listed = daemon.call("alarms", "--json")  # names the state folder, so it means the first
    second.send_signal(signal.SIGTERM)
    second.communicate(timeout=PATIENCE_S)
    assert second.returncode == 0
    assert listed.stdout == "[]\n"
    assert told(daemon, "status")["pid"] == daemon.process.pid


# -- rude clients ----------------------------------------------------------------------------------


def shout(client):
    """Send calls as fast as they are taken, and read nothing."""
    client.settimeout(0.2)
    client.sendall(b'{"v":1,"do":"set","value_c":41.0}\n' * 2000)


def babble(client):
    client.settimeout(0.2)
    client.sendall(os.urandom(65536))


def stare(client):
    """Watch, and never read."""
    client.sendall(b'{"v":1,"do":"watch"}\n' * 30)


def begin(client):
    """Begin a line, and never end it."""
    client.sendall(b'{"v": 1, "do": "set", "val')


def vanish(client):
    client.sendall(b'{"v":1,"do":"mode","mode":"auto"}\n')


def test_twenty_rude_clients_at_once_cost_no_cycle_and_nobody_his_answer(daemon):
    over = threading.Event()
    kept, manners = [], [shout, babble, stare, begin, vanish]

    def pester(rude):
        while not over.is_set():
            client = socket.socket(socket.AF_UNIX)
            with contextlib.suppress(OSError):
                client.connect(str(path_of(daemon)))
                rude(client)
            kept.append(client)
            if rude in (vanish, babble):
                kept.pop().close()
            over.wait(0.01 if rude is vanish else 0.5)

    rude = [threading.Thread(target=pester, args=(manners[n % 5],)) for n in range(20)]
    for thread in rude:
        thread.start()
    cycles = told(daemon, "get", "t_s")
    began_s, answers = time.monotonic(), 0
    try:
        while told(daemon, "get", "t_s") < cycles + 6.0:
            answers += 1
    finally:
        over.set()
        for thread in rude:
            thread.join()
        for client in kept:
            client.close()
    print(
        f"{answers} answers in {time.monotonic() - began_s:.1f} s beside {len(rude)} rude clients"
    )
    (record,) = told(daemon, "status")["loops"]
    assert record["missed"] == 0
    assert daemon.named("cycle.missed") == daemon.named("socket.failed") == []
    code, _ = daemon.end(signal.SIGTERM)
    assert code == 0
    assert daemon.named("loop.stopped")[0]["power_0_confirmed"] is True
