"""``thermoctl simulate``: the tank in FILE is the one behind the port; what is not is named."""

import signal
import tomllib

import pytest
from click.testing import CliRunner

from thermoctl.app import simulate as simulation
from thermoctl.app.cli import cli
from thermoctl.errors import ConfigError
from thermoctl.runtime.clock import SimulatedClock
from thermoctl_drivers.simulated import SimulatedBoard, SimulatedSettings

BOARD = """
[boards.bath]
kind = "simulated"
volume_l = 1.0
heater_w = 600.0
element_lag_s = 40.0
sensor_lag_s = 9.0
transport_s = 5.0
tolerances = 0.1
noise_mv = 2.0
pickup_mv = 7.0
mains_hz = 60.0
seed = 5
"""


@pytest.fixture
def told(tmp_path, monkeypatch):
    """Return a function that simulates a file, and returns what was asked for and what was said."""
    before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)}
    asked = {}
    monkeypatch.setattr(simulation, "simulate_thermodaq", lambda link, **keys: asked.update(keys))

    def run(content, *words):
        path = tmp_path / "board.toml"
        path.write_text(content)
        path.chmod(0o644)
        command = ["simulate", "thermodaq", "--link", str(tmp_path / "l"), "-c", str(path)]
        came = CliRunner().invoke(cli, [*command, *words])
        if came.exception is not None and not isinstance(came.exception, SystemExit):
            raise came.exception
        return asked, came.stderr

    yield run
    for each, handler in before.items():
        signal.signal(each, handler)


def test_tank_wires_and_seed_are_those_of_the_file_and_no_loop_is_needed(told):
    asked, said = told(BOARD)
    tank = asked["parameters"]
    assert (tank.element.rated_w, asked["seed"]) == (600.0, 5)
    assert asked["wiring"] == simulation.Wiring(2.0, 7.0, 60.0)
    assert said == ""
    keys = tomllib.loads(BOARD)["boards"]["bath"]
    board = SimulatedBoard(SimulatedSettings(**keys), None, SimulatedClock())
    assert tank == board._tank.parameters  # the same specimen, lag for lag
    assert tank.element.lag_s == pytest.approx(40.0, rel=0.5)
    assert tank.element.lag_s != 40.0
    assert tank.probe.lag_s == pytest.approx(9.0, rel=0.5)


def test_a_seed_on_the_command_line_comes_first(told):
    assert told(BOARD, "--seed", "7")[0]["seed"] == 7


def test_what_the_board_cannot_have_is_named(told):
    extra = 'bits = 12\nconversions = 4\ncooler_w = 100.0\npower_stage = "linear"\n'
    _, said = told(BOARD + extra)
    assert "boards.bath: bits, conversions not used by a thermodaq: it has a conv" in said
    assert "boards.bath: power_stage not used" in said
    assert "boards.bath: cooler_w not used by a thermodaq: it only heats" in said


def test_a_file_without_a_simulated_board_says_whose_tank_it_is(told):
    asked, said = told('[boards.daq]\nkind = "thermodaq"\nport = "/dev/ttyUSB0"\n')
    assert asked["parameters"] is None
    assert "no board of kind simulated there: the tank is that of Özbek (2021)" in said


def test_a_key_that_no_board_has_is_refused_with_its_line(told):
    with pytest.raises(ConfigError, match=r"boards.bath.pickups_mv: unknown key; did you mean"):
        told(BOARD + "pickups_mv = 1.0\n")
