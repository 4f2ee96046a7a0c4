"""``thermoctl alarms ack``: all, or one by its code, through a daemon or in what it left."""

import json

import pytest

from thermoctl.app.cli import main
from thermoctl.app.commands.alarms import _acknowledged
from thermoctl.errors import Refused
from thermoctl.services.store import Latch, LatchStore

ROWS = [
    {"loop": "tank", "code": "sensor.disagree"},
    {"loop": "tank", "code": "heater.no_response"},
    {"loop": "oven", "code": "sensor.disagree"},
]


class Daemon:
    """What a client asks, with three alarms in two loops."""

    def __init__(self):
        self.acknowledged = []

    def ask(self, do, *, loop=None):
        assert do == "alarms"
        return {"alarms": [row for row in ROWS if loop in (None, row["loop"])]}

    def ask_loop(self, do, *, code=None, loop=None):
        assert do == "ack"
        self.acknowledged.append((code, loop))
        rows = self.ask("alarms", loop=loop)["alarms"]
        return {"acknowledged": [row for row in rows if code in (None, row["code"])]}


def test_one_code_is_acknowledged_in_every_loop_that_has_it_and_nothing_else():
    daemon = Daemon()
    assert _acknowledged(daemon, "sensor.disagree", None) == [ROWS[0], ROWS[2]]
    assert daemon.acknowledged == [("sensor.disagree", "tank"), ("sensor.disagree", "oven")]


def test_one_code_is_acknowledged_in_the_loop_that_is_named():
    assert _acknowledged(Daemon(), "sensor.disagree", "oven") == [ROWS[2]]


def test_without_a_code_all_are_acknowledged_at_once():
    daemon = Daemon()
    assert _acknowledged(daemon, None, None) == ROWS
    assert daemon.acknowledged == [(None, None)]


def test_a_code_that_no_loop_has_is_told_what_there_is():
    with pytest.raises(Refused, match=r"one of sensor.disagree, heater.no_response") as refused:
        _acknowledged(Daemon(), "sensor.open", None)
    assert "got 'sensor.open'" in str(refused.value)


@pytest.fixture
def left(tmp_path, monkeypatch, whole):
    """Return a function that runs ``alarms`` on what a daemon left: one latch."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr("thermoctl.services.control_place.SERVICE", tmp_path / "none.sock")
    path, state = tmp_path / "tank.toml", tmp_path / "state"
    path.write_text(whole)
    state.mkdir(mode=0o700)
    LatchStore(state).save("tank", Latch("trip.over_temperature", "61 degC", 5, 1.6e9))

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(["alarms", *arguments, "-c", str(path), "--state", str(state)])
        return ended.value.code

    return run


def test_a_latch_that_was_left_is_cleared_by_its_code(left, capsys):
    assert left("ack", "trip.over_temperature") == 0
    assert capsys.readouterr().out == "tank: trip.over_temperature acknowledged\n"
    assert left("ack", "--json") == 0
    assert json.loads(capsys.readouterr().out) == []


def test_a_latch_that_was_left_stays_when_another_code_is_meant(left, capsys):
    assert left("ack", "sensor.open") == 1
    assert "expected one of trip.over_temperature, got 'sensor.open'" in capsys.readouterr().err
    assert left("ack", "trip.over_temperature") == 0


def test_a_file_that_is_no_socket_is_told_as_such(tmp_path, capsys):
    path = tmp_path / "tank.toml"
    path.write_text("")
    with pytest.raises(SystemExit) as ended:
        main(["status", "--socket", str(path)])
    assert ended.value.code == 3
    told = f"expected the socket of a running daemon, got another file: {path}"
    assert told in capsys.readouterr().err
