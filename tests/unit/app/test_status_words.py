"""What `thermoctl status` says of a loop: its shadow, its ramp, and what is to come."""

from dataclasses import asdict

import pytest

from thermoctl.app.commands.control import _described, _line
from thermoctl.app.cycle_record import cycle_record
from thermoctl.app.sim import bench_settings, simulate
from thermoctl.signals import ShadowScore


@pytest.fixture(scope="module")
def record():
    """The record of a loop after a few seconds, as a status holds it."""
    cycle = list(simulate(bench_settings(seed=1), 5.0))[-1]
    return cycle_record(cycle) | {"age_s": 0.2, "period_s": 1.0, "missed": 0}


def rows(record):
    """Return the lines of a status by their name; the colons stand below each other."""
    lines = [line.split(" : ") for line in _described(record).splitlines()]
    assert len({len(name) for name, _ in lines}) == 1
    return {name.strip(): value for name, value in lines}


def test_a_shadow_has_its_name_its_power_and_its_score_in_words(record):
    score = asdict(ShadowScore(600.0, 0.013, 0.5, 0.8, 0.021, 0.025))
    told = rows(record | {"shadow_power": 0.2, "shadow_score": score})
    assert told["Shadow"] == "self-tuning-mv 20.0 %"
    words = "over 10 min 1.3 % apart, moves 1.6 × as much, misses by 25 mK, not 21 mK"
    assert told["Shadow score"] == words


def test_a_shadow_that_is_not_compared_yet_says_so(record):
    assert rows(record)["Shadow score"] == "compared after a minute in auto"


def test_a_loop_without_a_shadow_has_no_line_of_it(record):
    assert "Shadow" not in rows(record | {"shadow": None})


def test_a_ramp_says_where_it_is_while_the_controller_follows_it(record):
    way = {"setpoint_c": 40.0, "reference_c": 25.8}
    assert rows(record | way)["Set point"] == "40.00 °C, ramp at 25.80 °C"
    assert rows(record | way | {"mode": "off"})["Set point"] == "40.00 °C"
    assert rows(record | way | {"reference_c": 40.0})["Set point"] == "40.00 °C"


def test_the_last_cycle_is_told_by_how_long_ago_it_was(record):
    assert rows(record)["Last cycle"] == "0.2 s ago"


def test_a_line_of_a_cycle_says_where_the_ramp_is_and_where_it_leads(record):
    way = {"setpoint_c": 40.0, "reference_c": 25.8}
    assert "set  40.00 °C, ramp at 25.80 °C  power" in _line(record | way)
    assert "ramp" not in _line(record | way | {"reference_c": 40.0})


def test_an_arrival_and_a_load_have_lines_only_while_there_are_any(record):
    feasible = record["feasible"] | {"arrival_s": 720.0, "arrival_sd_s": 45.0}
    told = rows(record | {"feasible": feasible, "load": 0.2})
    assert (told["Arrives"], told["Load told"]) == ("in 12 min ± 2 min", "20.0 %")
    quiet = rows(record | {"feasible": feasible | {"arrival_s": None}, "load": 0.0})
    assert not {"Arrives", "Load told"} & set(quiet)


def test_a_deviation_is_that_from_the_ramp_while_there_is_one_as_in_the_view(record):
    way = {"temperature_c": 36.76, "setpoint_c": 40.0, "reference_c": 36.743}
    assert rows(record | way)["Deviation"] == "+17 mK from the ramp"
    assert rows(record | way | {"mode": "off"})["Deviation"] == "−3.24 K from the set point"
    assert rows(record | way | {"temperature_c": None})["Deviation"] == "–"
