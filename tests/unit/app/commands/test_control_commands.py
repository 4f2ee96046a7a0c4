"""What an operator types for a running daemon, and what is said where it cannot be."""

import pytest

from thermoctl.app.cli import main
from thermoctl.app.commands import control
from thermoctl.app.daemon.daemon import Daemon
from thermoctl.app.simulate import terminal
from thermoctl.errors import Refused, Unavailable


@pytest.mark.parametrize(
    ("typed", "told"), [("40K", "; 40K is -233.15 °C"), ("400F", "; 400F is 204.444 °C")]
)
def test_a_set_point_in_another_unit_that_is_refused_is_told_in_both(
    typed, told, monkeypatch, capsys
):
    def asked(*_, **keys):
        raise Refused(f"expected a set point from 5 to 55, got {keys['value_c']:g}")

    monkeypatch.setattr(control, "_asked", asked)
    with pytest.raises(SystemExit) as ended:
        main(["set", typed])
    assert ended.value.code == 1
    assert capsys.readouterr().err.rstrip().endswith(told)


@pytest.mark.parametrize(
    ("typed", "k_per_min"),
    [("2/min", 2.0), ("30K/h", 0.5), ("1E2/min", 100.0), (".5/min", 0.5), ("5e-1K/min", 0.5)],
)
def test_a_rate_may_be_written_as_any_number(typed, k_per_min):
    assert control._rate(typed) == pytest.approx(k_per_min)


@pytest.mark.parametrize("typed", ["0/min", "2", "2/s", "-1/min"])
def test_what_is_no_rate_is_told_what_one_is(typed):
    with pytest.raises(ValueError, match=r"a rate above 0 in K per minute or hour, such as 2/min"):
        control._rate(typed)


def test_a_link_that_is_taken_is_refused_before_anything_else_is_said(tmp_path, capsys):
    link = tmp_path / "board"
    link.write_text("mine")
    with pytest.raises(SystemExit) as ended:
        main(["simulate", "thermodaq", "--link", str(link), "--firmware", "python"])
    assert ended.value.code == 1
    text = "expected a path that is free, got one where something is"
    assert capsys.readouterr().err == f"thermoctl: {link}: {text}\n"


def test_a_link_that_an_earlier_run_left_is_taken_over(tmp_path):
    link = tmp_path / "board"
    link.symlink_to(tmp_path / "gone")
    with terminal(link):
        assert link.exists()


def test_a_socket_in_a_folder_that_is_not_there_makes_none(tmp_path, whole, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    path = tmp_path / "tank.toml"
    path.write_text(whole)
    socket = tmp_path / "mistyped" / "control.sock"
    with pytest.raises(Unavailable, match="expected a folder for --socket"):
        Daemon([path], tmp_path / "state", socket)
    assert not socket.parent.exists()
