"""A converter that is too coarse is told of, with what to set; one that will do is not."""

import sqlite3
from contextlib import closing
from types import SimpleNamespace

import pytest

from thermoctl.app.bench import BenchOptions, run_bench
from thermoctl.app.doctor import WARN, examine
from thermoctl.app.readings import coarse_readings
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, default_profile


def with_converter(**keys):
    """Return the aquarium's settings with another converter."""
    settings = load(default_profile())
    daq = settings.boards["daq"].model_copy(update=keys)
    return settings.model_copy(update={"boards": {"daq": daq}})


def test_a_single_conversion_of_ten_bits_is_told_with_what_to_set():
    told = coarse_readings(with_converter(bits=10, conversions=1))
    assert list(told) == ["tank"]
    assert "in steps of 488 mK" in told["tank"]
    assert "set conversions to 32, 4 at least" in told["tank"]


@pytest.mark.parametrize(("bits", "conversions"), [(10, 2), (12, 1), (16, 1)])
def test_neither_two_conversions_nor_more_bits_alone_will_do(bits, conversions):
    assert coarse_readings(with_converter(bits=bits, conversions=conversions))


def test_eight_bits_are_too_few_whatever_is_averaged():
    told = coarse_readings(with_converter(bits=8, conversions=32))
    assert "take a converter of more bits" in told["tank"]


@pytest.mark.parametrize(("bits", "conversions"), [(10, 4), (10, 32), (12, 32), (16, 8)])
def test_what_will_do_is_not_told(bits, conversions):
    assert coarse_readings(with_converter(bits=bits, conversions=conversions)) == {}


def test_a_quiet_converter_of_many_bits_needs_no_mean():
    quiet = with_converter(bits=16, conversions=1, noise_mv=0.1, pickup_mv=0.0)
    assert coarse_readings(quiet) == {}


def test_a_board_that_tells_nothing_of_its_converter_is_not_judged():
    settings = with_converter()
    unknown = settings.model_copy(update={"boards": {"daq": SimpleNamespace(kind="other")}})
    assert coarse_readings(unknown) == {}


def test_a_bench_test_says_it_once_at_its_start(capsys):
    settings = bench_settings(with_converter(bits=10, conversions=1), 1)
    run_bench(settings, BenchOptions(float("inf"), 5.0, as_json=True, history=None))
    (line,) = capsys.readouterr().err.splitlines()[:1]
    assert line.startswith("thermoctl: loops.tank.sensor: a conversion of boards.daq is in steps")


def test_the_event_at_the_start_of_a_bench_test_stands_in_its_history(tmp_path):
    settings = bench_settings(with_converter(bits=10, conversions=1), 1)
    path = tmp_path / "run.sqlite"
    run_bench(settings, BenchOptions(float("inf"), 5.0, as_json=True, history=path))
    with closing(sqlite3.connect(path)) as history:
        rows = history.execute("SELECT count(*) FROM events WHERE name = 'config.coarse'")
        assert rows.fetchone() == (1,)


def test_the_doctor_warns(tmp_path):
    path = tmp_path / "tank.toml"
    text = default_profile().read_text(encoding="utf-8")
    path.write_text(text.replace("bits = 12", "bits = 10\nconversions = 1"), encoding="utf-8")
    path.chmod(0o644)
    warned = [each.text for each in examine([path], tmp_path) if each.status == WARN]
    assert any(each.startswith("loops.tank.sensor: a conversion of boards.daq") for each in warned)
