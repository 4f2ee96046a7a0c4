"""How a command ends: which exit code goes with what, and in which words it is told."""

from __future__ import annotations

import io
import json
import os
import signal
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from thermoctl.app.cli import cli, main
from thermoctl.app.commands.endings import (
    Terminated,
    exit_code_of,
    prepare_streams,
    terminable,
    words_of,
)
from thermoctl.errors import BoardConfigError, LinkError, NotPermitted, Unavailable
from thermoctl.services.store import LatchStore

NOBODY = pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")


def ended(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Return exit code, stdout and stderr of a command."""
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    assert isinstance(end.value.code, int)
    return (end.value.code, *capsys.readouterr())


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (click.UsageError("no"), 2),
        (Unavailable("no"), 69),
        (NotPermitted("no"), 77),
        (PermissionError(13, "no"), 77),
        (BoardConfigError("no"), 78),
        (LinkError("no"), 1),
        (FileNotFoundError(2, "no"), 1),
        (click.Abort(), 130),
    ],
    ids=lambda value: type(value).__name__,
)
def test_every_kind_of_error_has_its_exit_code(error, code):
    assert exit_code_of(error) == code


def test_an_error_of_the_system_is_told_by_file_and_words_without_its_number():
    assert words_of(FileNotFoundError(2, "No such file", "a.csv")) == "a.csv: No such file"
    assert words_of(OSError(28, "No space left on device")) == "No space left on device"


def test_input_that_ends_before_an_answer_is_no_interruption():
    @click.command()
    def asking():
        click.prompt("Volume")

    result = CliRunner().invoke(asking, input="", standalone_mode=False)
    assert words_of(result.exception) == "expected an answer, got the end of input"
    assert words_of(click.Abort()) == "interrupted"


def test_a_termination_is_an_interruption_with_a_code_of_its_own():
    @click.command()
    def terminated():
        raise Terminated

    came = CliRunner().invoke(terminated, standalone_mode=False).exception
    assert isinstance(came, click.Abort)
    assert (exit_code_of(came), words_of(came)) == (143, "terminated")


def test_sigterm_ends_what_is_terminable_once_and_is_given_back():
    before = signal.getsignal(signal.SIGTERM)
    with terminable():
        with pytest.raises(Terminated):
            signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGTERM)  # nothing comes of it
    assert signal.getsignal(signal.SIGTERM) == before


def test_alarms_without_a_daemon_and_a_configuration_say_that_both_are_missing(
    capsys, tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    for module in ("commands.alarms", "settings"):
        monkeypatch.setattr(f"thermoctl.app.{module}.ETC", tmp_path)
    monkeypatch.setattr("thermoctl.services.control_place.SERVICE", tmp_path / "none.sock")
    for command in (["alarms"], ["alarms", "ack"]):
        code, out, err = ended(capsys, *command)
        assert (code, out) == (3, "")
        assert err == (
            "thermoctl: expected a running daemon, or -c FILE to see what one has left\n"
        )


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("--sim --speed 1e9", "--speed: expected a number above 0, up to 1e6, or max, got '1e9'"),
        ("--speed max", "expected --speed only with --sim"),
        ("-c tank.toml", "expected -c or --config only with --sim"),
        ("-c a.toml run", "expected -c or --config only with --sim; those of run stand behind it"),
        ("--sim run", "expected --sim without a command"),
        ("run --fast", "no such option '--fast'"),
        ("swim", "no such command 'swim'"),
        ("--sim --seed -1", "--seed: expected a whole number from 0 on, got -1"),
        ("--sim --seed x", "--seed: expected a whole number from 0 on, got 'x'"),
        ("simulate nope", "KIND: expected one of thermodaq, got 'nope'"),
        (
            "reproduce",
            "expected a command, one of ozbek2021, bicer2017, lainiotis, experiment; see",
        ),
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(capsys, arguments, told):
    code, out, err = ended(capsys, *arguments.split())
    assert (code, out) == (2, "")
    assert err.startswith(f"thermoctl: {told}")
    assert "--help" in err
    assert err.count("\n") == 1


def test_wrong_usage_travels_as_json_where_that_was_asked_for(capsys):
    code, out, err = ended(capsys, "--json")
    error = json.loads(out)["error"]
    assert code == error["exit_code"] == 2
    assert err == f"thermoctl: {error['text']}\n"


def test_a_character_that_an_encoding_does_not_have_becomes_a_question_mark(monkeypatch):
    narrow = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", narrow)
    prepare_streams()
    print("37.5 °C", flush=True)
    assert narrow.buffer.getvalue() == b"37.5 ?C\n"


def every_command(group: click.Group, context: click.Context) -> list[click.Context]:
    """Return a context for each command below a group, groups included."""
    found = []
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        inner = click.Context(command, parent=context, info_name=name)
        found += [
            inner,
            *(every_command(command, inner) if isinstance(command, click.Group) else []),
        ]
    return found


def test_no_summary_of_a_command_is_cut():
    top = click.Context(cli, info_name="thermoctl")
    for context in (top, *every_command(cli, top)):
        if isinstance(context.command, click.Group):
            assert "..." not in context.get_help().partition("Commands:")[2], context.command_path


@NOBODY
def test_a_configuration_without_the_right_to_read_it_is_exit_77(capsys, tmp_path):
    file = tmp_path / "tank.toml"
    file.touch(mode=0o000)
    code, _, err = ended(capsys, "config", "check", "-c", str(file))
    assert (code, err) == (77, f"thermoctl: {file}: expected the right to read it, got none\n")


@NOBODY
def test_a_latch_without_the_right_to_read_it_is_not_taken_for_one(tmp_path: Path):
    store = LatchStore(tmp_path)
    store.check_readable("tank")
    latch = tmp_path / "latch-tank.json"
    latch.touch(mode=0o000)
    with pytest.raises(NotPermitted, match=r"latch-tank\.json should be readable"):
        store.check_readable("tank")
