"""How the daemon ends: signals at awkward moments, threads that die; and reloads of anything."""

import os
import re
import signal
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.e2e

ROOT = Path(__file__).parents[2]
AQUARIUM = (ROOT / "config" / "aquarium.toml").read_text()
PATIENCE_S = 15.0

WATCHED = """
import atexit, sys
from pathlib import Path
from thermoctl.app.daemon import daemon
from thermoctl_drivers.simulated import SimulatedBoard as Board

powers = []
write, close = Board.write, Board.close
def watched_write(self, outputs, *rest):
    taken = write(self, outputs, *rest)
    powers.append(taken["heater"])
    return taken
Board.write = watched_write
atexit.register(lambda: print("POWERS", powers[0] > 0.0, powers[-1], flush=True))
BREAK
try:
    ended = daemon.Daemon([Path(sys.argv[1])], Path(sys.argv[2])).run()
finally:
    print("HEATED", any(powers), flush=True)
print("RAN", ended, flush=True)
sys.exit(0 if ended else 1)
"""


@pytest.fixture
def broken(start):
    """Return a function that starts a daemon after the Python in `breaks`."""
    return lambda breaks: start(WATCHED.replace("BREAK", breaks))


BROKEN_READ = """
read = Board.read
def broken(self, deadline_s):
    if len(powers) >= 3:
        raise ERROR
    return read(self, deadline_s)
Board.read = broken
"""


@pytest.mark.parametrize("error", ["SystemExit(0)", "KeyboardInterrupt()", "GeneratorExit()"])
def test_a_control_thread_that_is_ended_leaves_power_0_says_so_and_is_no_success(broken, error):
    daemon = broken(BROKEN_READ.replace("ERROR", error))
    daemon.wait_for("loop.started")
    began_s = time.monotonic()
    code = daemon.process.wait(PATIENCE_S)
    print(f"{error} in the control thread: ended after {time.monotonic() - began_s:.2f} s")
    assert code == 1
    assert error.partition("(")[0] in daemon.named("loop.failed")[0]["error"]
    text = daemon.log.read_text()
    assert "HEATED True" in text
    assert "POWERS True 0.0" in text
    assert daemon.named("loop.stopped")[0]["power_0_confirmed"] is True


BROKEN_MAIN = """
store = daemon.Resumption.store
def broken(self, settings, cycles):
    if len(powers) >= 3:
        raise RuntimeError("the main thread has a bug")
    store(self, settings, cycles)
daemon.Resumption.store = broken
"""


def test_a_main_thread_that_dies_takes_the_heat_with_it(broken):
    daemon = broken(BROKEN_MAIN)
    assert daemon.process.wait(PATIENCE_S) == 1
    text = daemon.log.read_text()
    assert "the main thread has a bug" in text
    assert "POWERS True 0.0" in text
    assert daemon.named("loop.stopped")[0]["power_0_confirmed"] is True


def test_a_signal_in_the_middle_of_a_reload_ends_it_with_power_0(broken):
    daemon = broken("pass")
    daemon.wait_for("board.opened")
    code, took_s = daemon.end(signal.SIGHUP, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
    print(f"HUP TERM HUP INT: ended after {took_s:.2f} s")
    assert (code, took_s < 2.0) == (0, True)
    assert " 0.0\n" in daemon.log.read_text()  # the last power that was written


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=["TERM", "INT"])
def test_a_signal_while_it_starts_ends_it_with_nothing_switched_on(start, number):
    daemon = start()
    daemon.wait_for("loop.started")  # the control thread begins about now
    code, took_s = daemon.end(number, number)
    print(f"{number!r} at the start: ended after {took_s:.2f} s")
    assert (code, took_s < 2.0) == (0, True)
    assert daemon.named("loop.stopped")[0]["output_may_be_on"] is False


def test_a_signal_while_a_board_hangs_in_opening_ends_it_within_two_seconds(start):
    leader, follower = os.openpty()  # somebody holds the line and never answers
    try:
        text = (ROOT / "config" / "thermodaq.toml").read_text()
        config = re.sub(r'port = "[^"]*"', f'port = "{os.ttyname(follower)}"', text)
        daemon = start(config=config)
        daemon.wait_for("loop.started")
        time.sleep(0.5)
        code, took_s = daemon.end(signal.SIGTERM)
    finally:
        os.close(leader)
        os.close(follower)
    print(f"TERM while a board hangs in opening: ended after {took_s:.2f} s")
    assert (code, took_s < 2.0) == (0, True)
    assert "Traceback" not in daemon.log.read_text()
    stopped = daemon.named("loop.stopped")[0]
    assert (stopped["output_may_be_on"], stopped["unreached"]) == (False, ["daq"])
    assert stopped["power_0_confirmed"] is False  # nobody was there to confirm it


HUNG_READ = BROKEN_READ.replace("raise ERROR", "__import__('time').sleep(60)")


def test_a_driver_that_hangs_for_ever_cannot_keep_the_process_and_is_no_success(broken):
    daemon = broken(HUNG_READ)
    daemon.wait_for("board.opened")
    time.sleep(3.5)
    code, took_s = daemon.end(signal.SIGTERM)
    print(f"TERM while a driver hangs: ended after {took_s:.2f} s")
    assert (code, took_s < 2.5) == (1, True)
    assert daemon.named("loop.stopped")[0]["power_0_confirmed"] is False


def test_a_reload_of_anything_at_all_leaves_the_old_configuration_in_force(start):
    daemon = start()
    daemon.wait_for("board.opened")
    bad = [
        b"\xff\xfe\x00nonsense",
        b"a = " + b"[" * 20_000,
        *(AQUARIUM.replace("setpoint_c = 37.5", f"setpoint_c = {text}").encode()
          for text in ("nan", "1e400", '"warm"', "90.0")),
        AQUARIUM.replace("[loops.tank", '[loops."tank.two"').encode(),
        None,
    ]  # fmt: skip
    for count, content in enumerate(bad, start=1):
        daemon.config.unlink()
        if content is not None:
            daemon.config.write_bytes(content)
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for("config.refused", count)
    daemon.config.write_text(AQUARIUM.replace("setpoint_c = 37.5", "setpoint_c = 38.5"))
    daemon.process.send_signal(signal.SIGHUP)
    daemon.wait_for("setpoint.changed")
    (changed,) = daemon.named("setpoint.changed")
    assert (changed["before_c"], changed["after_c"]) == (37.5, 38.5)
    assert daemon.end(signal.SIGTERM)[0] == 0
