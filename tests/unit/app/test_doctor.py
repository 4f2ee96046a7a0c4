"""What ``thermoctl doctor`` finds."""

from __future__ import annotations

import json
import os
import tomllib
from datetime import UTC, datetime
from pathlib import Path

import pytest

from thermoctl.app import serial_ports
from thermoctl.app.cli import main
from thermoctl.app.compose import board_builder
from thermoctl.app.doctor import (
    FAIL,
    OK,
    WARN,
    boards,
    examine,
    latches,
    service,
    state_folder,
    wall_clock,
)
from thermoctl.app.settings import load
from thermoctl.errors import LinkError
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.services.lock import DaemonLock, device_lock_path
from thermoctl.services.store import Latch, LatchStore

PATIENCE_S = 0.2


def foreign_settings(whole: str, behaviour: str):
    """Return settings whose board is that of another package, behaving in a certain way."""
    content = tomllib.loads(whole)
    content["boards"]["daq"] = {"kind": "foreign", "behaviour": behaviour}
    content["service"] = {"accept_no_dead_man": True}
    return load(content)


def visit(whole: str, behaviour: str, tmp_path: Path) -> list[tuple[str, str]]:
    """Return status and text of what a visit to such a board finds."""
    found = boards(foreign_settings(whole, behaviour), tmp_path, SimulatedClock(), PATIENCE_S)
    assert {finding.check for finding in found} == {"board daq"}
    return [(finding.status, finding.text) for finding in found]


# -- boards ----------------------------------------------------------------------------------------


def test_a_board_that_works_is_identified_told_power_0_and_read(whole, foreign, tmp_path):
    found = visit(whole, "well", tmp_path)
    assert found == [
        (OK, "foreign somewhere, version 7"),
        (WARN, "no dead-man: an independent thermostat must be fitted"),
        (OK, "heater: told power 0, took 0"),
        (OK, "temperature of loop tank: 32.03 °C"),  # 2500 of 4096 at 5 V, 10 mV/K
    ]


@pytest.mark.parametrize("behaviour", ["well", "lost", "breaks", "mute", "open", "willful"])
def test_no_board_is_ever_told_more_than_power_0_and_each_is_closed(
    whole, foreign, tmp_path, behaviour
):
    visit(whole, behaviour, tmp_path)
    assert foreign.written[-1] == "closed"
    assert all(each == {"heater": 0.0} for each in foreign.written[:-1])


@pytest.mark.parametrize(
    ("behaviour", "told"),
    [
        ("lost", "expected a board, got silence; check wiring"),
        ("breaks", "RuntimeError in the driver: a bug"),
        ("mute", "expected input 'temperature' of loop tank, the board sent nothing"),
        ("open", "100.0% of full scale is no temperature; check the sensor"),
        ("willful", "heater: told power 0, took 0.5"),
        ("hangs", "no answer within 0.2 s"),
    ],
)
def test_a_board_that_fails_says_how(whole, foreign, tmp_path, behaviour, told):
    failures = [text for status, text in visit(whole, behaviour, tmp_path) if status == FAIL]
    assert len(failures) == 1
    assert told in failures[0]


def test_boards_are_left_alone_while_a_daemon_runs(whole, foreign, tmp_path):
    with DaemonLock(tmp_path / "daemon.lock"):
        [(status, text)] = visit(whole, "well", tmp_path)
    assert status == OK
    assert text == f"not asked: the daemon is running (process {os.getpid()})"
    assert foreign.written == []


def test_the_dead_man_of_a_board_is_told_with_its_time(whole, tmp_path):
    found = boards(load(tomllib.loads(whole)), tmp_path, SimulatedClock(), PATIENCE_S)
    texts = [finding.text for finding in found if finding.status == OK]
    assert "dead-man: the board cuts the heater by itself 2.5 s after the last command" in texts


# -- ports -----------------------------------------------------------------------------------------


@pytest.fixture
def pty():
    """Return the name of a pseudo terminal."""
    ours, theirs = os.openpty()
    yield os.ttyname(theirs)
    os.close(ours)
    os.close(theirs)


def test_a_port_that_is_free_has_no_obstacle(pty):
    assert serial_ports.obstacle(pty) is None


def test_a_port_that_is_not_there_is_an_obstacle(tmp_path):
    assert "is not there; plug the board in" in (serial_ports.obstacle(str(tmp_path / "no")) or "")


def test_what_is_no_terminal_is_no_serial_port(pty, tmp_path):
    (tmp_path / "port").touch()
    for port in ("/dev/null", str(tmp_path), str(tmp_path / "port")):
        assert serial_ports.obstacle(port) == (
            f"{port} is no serial port; set port to one of the ports above"
        )
    assert serial_ports.is_terminal(pty)


@pytest.mark.parametrize("group", [0, 12345])
def test_nobody_is_told_to_join_a_group_that_is_not_for_ports(tmp_path, group):
    port = tmp_path / "port"
    port.touch()
    port.chmod(0o640)
    try:
        os.chown(port, -1, group)
    except PermissionError:
        pytest.skip("only root may give a file to another group")
    remedy = serial_ports._remedy(str(port))
    assert "usermod" not in remedy
    assert remedy.endswith("mode 0640; install the udev rule")


def test_a_port_that_a_daemon_has_locked_names_its_process(pty, tmp_path, monkeypatch):
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    with DaemonLock(device_lock_path(tmp_path, pty)):
        told = serial_ports.obstacle(pty)
    assert told == f"{pty} is in use by a daemon (process {os.getpid()})"
    assert serial_ports.obstacle(pty) is None


def test_a_serial_port_is_opened_by_one_alone(pty, minimal):
    board = {"kind": "thermodaq", "port": pty}
    settings = load(minimal | {"boards": {"daq": board}})
    build = board_builder(settings.boards["daq"], SimulatedClock())
    first = build()
    with pytest.raises(LinkError, match=r"another program holds it"):
        build()
    first.close()
    build().close()


def test_looking_at_a_lock_neither_takes_nor_makes_it(tmp_path):
    lock = tmp_path / "a.lock"
    assert serial_ports.holder_of(lock) is None
    assert not lock.exists()
    with DaemonLock(lock):
        assert serial_ports.holder_of(lock) == str(os.getpid())
    with DaemonLock(lock):
        pass


def test_a_url_is_left_to_its_driver():
    assert serial_ports.obstacle("socket://127.0.0.1:9") is None


# -- the machine -----------------------------------------------------------------------------------


def test_a_state_folder_that_can_be_made_is_not_made(tmp_path):
    finding = state_folder(tmp_path / "a" / "b")
    assert finding.status == OK
    assert "made at the first start" in finding.text
    assert list(tmp_path.iterdir()) == []


def test_a_state_folder_that_everybody_may_write_to_fails(tmp_path):
    tmp_path.chmod(0o777)
    assert state_folder(tmp_path).status == FAIL


def test_a_state_folder_that_is_a_file_fails(tmp_path):
    (tmp_path / "state").touch()
    assert state_folder(tmp_path / "state").status == FAIL


@pytest.mark.parametrize(("year", "status"), [(1970, WARN), (2026, OK), (2150, WARN)])
def test_a_wall_clock_far_off_is_told(year, status):
    assert wall_clock(datetime(year, 1, 1, tzinfo=UTC)).status == status


def test_a_unit_is_found_where_it_is_installed(tmp_path):
    assert service([tmp_path]).status == WARN
    (tmp_path / "thermoctl.service").touch()
    assert service([tmp_path / "none", tmp_path]).text == str(tmp_path / "thermoctl.service")


# -- the command -----------------------------------------------------------------------------------


def test_a_bad_configuration_fails_with_every_line_of_it(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text("[loops.tank]\nsetpoint_c = 1\ntrip_above = 2\n")
    texts = [f.text for f in examine([path], tmp_path, SimulatedClock()) if f.status == FAIL]
    assert len(texts) == 2
    assert f"{path}:3: loops.tank.trip_above: unknown key" in texts[1]


def test_a_latched_loop_fails_and_says_what_to_do(tmp_path, whole):
    settings = load(tomllib.loads(whole))
    assert list(latches(settings, tmp_path)) == []
    LatchStore(tmp_path).save("tank", Latch("trip.over_temperature", "61.0 °C above 60 °C"))
    [found] = latches(settings, tmp_path)
    assert found.status == FAIL
    assert found.text == (
        "loop tank: trip.over_temperature, 61.0 °C above 60 °C; "
        "remove the cause, then: thermoctl alarms ack"
    )


def test_a_healthy_machine_exits_0_and_an_ill_one_1(tmp_path, whole, capsys):
    good, bad = tmp_path / "good.toml", tmp_path / "bad.toml"
    good.write_text(whole)
    good.chmod(0o644)
    bad.write_text(whole.replace('"simulated"\nvolume_l = 8.0', '"thermodaq"\nport = "/dev/none"'))
    for path, code in ((good, 0), (bad, 1)):
        with pytest.raises(SystemExit) as ended:
            main(["doctor", "-c", str(path), "--state", str(tmp_path / "state"), "--json"])
        assert ended.value.code == code
        told = json.loads(capsys.readouterr().out)
        assert told["ok"] is (code == 0)
        assert {"configuration", "ports", "board daq", "state", "clock", "service"} <= {
            each["check"] for each in told["findings"]
        }
