"""The board behind a pseudo terminal, in real time: a driver on it, and the daemon itself."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
import serial

from thermoctl.app.simulate import WiredBoard, board_for, serve, simulate_thermodaq, terminal, wired
from thermoctl.errors import LinkError
from thermoctl.plant.parameters import TankParameters
from thermoctl.runtime.clock import MonotonicClock
from thermoctl_drivers.thermodaq import ThermoDaq, ThermoDaqSettings
from thermoctl_drivers.thermodaq_chip import missing

pytestmark = pytest.mark.hil

CONFIG = Path(__file__).parents[2] / "config" / "thermodaq.toml"
PATIENCE_S = 60.0  # a daemon that met no board at once heats after 30 s of good data
DEAD_MAN_S = 2.5
HELD_CYCLES = 5
REPLY_S = 0.5  # of a noisy machine; a board answers within 20 ms


@contextmanager
def running(link: Path, firmware: str) -> Iterator[WiredBoard]:
    """Yield a board and its tank, living in real time behind `link`."""
    if firmware == "simavr" and (why := missing()):
        pytest.skip(why)
    board = board_for(firmware)  # type: ignore[arg-type]
    over = threading.Event()
    with closing(board), terminal(link) as descriptor:
        device = wired(board, TankParameters(initial_c=37.0))
        thread = threading.Thread(target=serve, args=(device, descriptor, over.is_set))
        thread.start()
        try:
            yield device
        finally:
            over.set()
            thread.join()


def wait_until(reached: Callable[[], bool], what: str) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not reached():
        if time.monotonic() > until_s:
            pytest.fail(f"not within {PATIENCE_S} s: {what}")
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.parametrize("firmware", ["simavr", "python"])
def test_the_driver_on_a_terminal_measures_heats_and_is_cut_by_the_board(
    tmp_path: Path, firmware: str
) -> None:
    clock = MonotonicClock()
    settings = ThermoDaqSettings(port=str(tmp_path / "daq"), reply_timeout_s=REPLY_S)
    with running(tmp_path / "daq", firmware) as device:
        port = serial.Serial(settings.port, settings.baud, timeout=0.0, exclusive=True)
        board = ThermoDaq(settings, port, clock)
        board.open(clock.now_s() + 5.0)
        time.sleep(0.5)
        sample = board.read(clock.now_s() + 2.0)["temperature"]
        kelvin = sample.counts / sample.full_scale * 500.0
        assert kelvin - 273.15 == pytest.approx(36.9, abs=0.6)
        assert 0.1 <= clock.now_s() - sample.t_s < 1.0
        assert board.write({"heater": 1.0}, 60.0, clock.now_s() + 2.0) == {"heater": 1.0}
        sent_s = device.t_s
        wait_until(lambda: device.board.on_s > 0.5, "the heater on")
        wait_until(lambda: device.t_s > sent_s + DEAD_MAN_S + 0.5, "the dead-man")
        assert device.board.on_s < DEAD_MAN_S + 0.5
        board.read(clock.now_s() + 2.0)
        assert board.health().counters["cuts"] == 1
        board.close()


@pytest.mark.slow
def test_a_terminal_that_ends_is_a_lost_link(tmp_path: Path) -> None:
    clock = MonotonicClock()
    settings = ThermoDaqSettings(port=str(tmp_path / "daq"), reply_timeout_s=REPLY_S)
    with running(tmp_path / "daq", "python"):
        port = serial.Serial(settings.port, settings.baud, timeout=0.0)
        board = ThermoDaq(settings, port, clock)
        board.open(clock.now_s() + 5.0)
    with pytest.raises(LinkError):
        board.read(clock.now_s() + 0.2)
    board.close()
    assert not (tmp_path / "daq").exists()


def test_a_link_that_is_a_file_is_not_replaced(tmp_path: Path) -> None:
    mine = tmp_path / "daq"
    mine.write_text("mine")
    with pytest.raises(FileExistsError):
        simulate_thermodaq(mine, firmware="python", duration_s=0.0)
    assert mine.read_text() == "mine"


def test_a_simulation_says_which_board_is_running(tmp_path: Path) -> None:
    told: list[str] = []
    simulate_thermodaq(tmp_path / "d", firmware="python", duration_s=0.0, report=told.append)
    assert told == [
        "the board is played in Python",
        f"{tmp_path / 'd'} is the board; set port to it",
    ]


@contextmanager
def daemon(folder: Path, port: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Yield the daemon on a copy of the board's profile whose port is `port`."""
    config = folder / "thermodaq.toml"
    text = CONFIG.read_text(encoding="utf-8")
    assert '"/dev/thermodaq"' in text
    config.write_text(text.replace('"/dev/thermodaq"', f'"{port}"'), encoding="utf-8")
    (folder / "run").mkdir(mode=0o700)
    environ = {**os.environ, "XDG_RUNTIME_DIR": str(folder / "run")}
    environ.pop("NOTIFY_SOCKET", None)
    command = [sys.executable, "-m", "thermoctl", "run", "-c", str(config)]
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(
            [*command, "--state", str(folder / "state")], env=environ, stderr=log, stdout=log
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait(PATIENCE_S)


def in_control(folder: Path) -> list[tuple[float, float]]:
    """Return power and what was taken of it, for every cycle in RUN that was steered.

    Full power is not counted: a law that has not seen its plant before begins with it.
    """
    history = folder / "state" / "history.sqlite"
    if not history.exists():
        return []
    with closing(sqlite3.connect(f"file:{history}?mode=ro", uri=True)) as connection:
        rows = connection.execute(
            "select power, accepted_power from cycles"
            " where state = 'run' and accepted_power > 0 and power < 1"
        )
        return rows.fetchall()


@pytest.mark.slow
@pytest.mark.e2e
def test_the_board_cuts_within_three_seconds_of_a_killed_daemon(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with running(tmp_path / "daq", "simavr") as device:
        with daemon(tmp_path, tmp_path / "daq") as process:
            wait_until(lambda: device.board.on_s > 0.5, "heat from the daemon")
            wait_until(lambda: len(in_control(tmp_path)) >= HELD_CYCLES, "cycles in control")
            assert device.tank.temperature_c == pytest.approx(37.25, abs=0.5)
            for power, accepted in in_control(tmp_path):
                assert accepted == pytest.approx(power, abs=0.01)
            process.send_signal(signal.SIGKILL)
            killed_s = device.t_s
            process.wait(PATIENCE_S)
        wait_until(lambda: device.t_s > killed_s + 3.0, "three seconds")
        cut_after_s = device.board.off_since_s - killed_s
        on_s = device.board.on_s
        wait_until(lambda: device.t_s > killed_s + 4.0, "another second")
        with capsys.disabled():
            print(f"\nkill -9 of the daemon: heater off {cut_after_s:.2f} s later")
        assert cut_after_s <= 3.0
        assert device.board.on_s == on_s
