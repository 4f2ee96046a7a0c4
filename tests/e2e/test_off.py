"""``thermoctl off``: power 0 when no daemon is there to do it."""

import os
from pathlib import Path

import pytest
from click.testing import CliRunner

from thermoctl.app.cli import cli
from thermoctl.services.lock import DaemonLock

pytestmark = pytest.mark.e2e

CONFIG = Path(__file__).parents[2] / "config"


@pytest.fixture
def off(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))

    def call(config):
        arguments = ["off", "-c", str(config), "--state", str(tmp_path / "state")]
        return CliRunner().invoke(cli, arguments, standalone_mode=False)

    return call


def test_every_board_is_told_power_0(off):
    result = off(CONFIG / "aquarium.toml")
    assert result.return_value == 0
    assert result.stdout.startswith("daq: power 0, simulated")


def test_a_board_that_is_not_there_is_told_of_and_is_no_success(off, tmp_path):
    config = tmp_path / "gone.toml"
    text = (CONFIG / "thermodaq.toml").read_text()
    config.write_text(text.replace("/dev/thermodaq", str(tmp_path / "gone")))
    result = off(config)
    assert result.return_value == 1
    assert "expected a board that takes power 0" in result.stderr


def test_a_daemon_that_runs_is_left_alone(off, tmp_path):
    with DaemonLock(tmp_path / "state" / "daemon.lock"):
        result = off(CONFIG / "aquarium.toml")
    said = str(result.exception)
    assert f"a daemon is running (process {os.getpid()} " in said
    assert "thermoctl mode off ends its heat, or stop it first" in said
