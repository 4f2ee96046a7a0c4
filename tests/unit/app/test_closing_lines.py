"""What a person is told at the end of a run."""

import math

import pytest

from thermoctl.app.report import Summary, closing_lines

HELD = {
    "duration_s": 3600.0,
    "steps": 3601,
    "missed": 0,
    "overshoot_k": 0.1234,
    "settled_s": 412.0,
    "deviation_mk": 8.31,
    "max_deviation_mk": 25.7,
    "travel_per_min": 0.4111,
    "final_temperature_c": 37.455467961274384,
    "wall_s": 60.004,
}


def told(**figures):
    return [line.replace("\u00a0", " ") for line in closing_lines({**HELD, **figures})]


def test_a_run_that_held_is_told_in_four_lines_with_units():
    assert told() == [
        "Ran       1 h simulated in 1 min, 3,601 cycles",
        "Settled   after 6 min 52 s, overshoot 0.12 K",
        "Held      the set point with an rms deviation of 8 mK, at most 26 mK",
        "Ended at  37.46 °C; power moved 0.4 full ranges a minute",
    ]


def test_a_run_that_did_not_settle_says_so_and_judges_nothing():
    lines = told(settled_s=None, deviation_mk=None, max_deviation_mk=None)
    assert lines[1].startswith("Settled   never: not within ±0.1 K of the set point for 60 s")
    assert lines[2] == "Held      not judged before it has settled"


def test_cycles_that_were_missed_are_counted():
    assert told(missed=12)[0].endswith("3,601 cycles, 12 missed")


def test_a_run_without_a_cycle_says_so():
    assert closing_lines(Summary().as_dict()) == ["Ran       no cycle was finished"]


@pytest.mark.parametrize("unknown", [None, math.nan])
def test_what_is_not_known_is_a_dash(unknown):
    lines = told(final_temperature_c=unknown, travel_per_min=unknown)
    assert lines[3] == "Ended at  –; power moved – full ranges a minute"


def test_no_line_is_wider_than_a_terminal():
    wide = told(settled_s=None, overshoot_k=35.0, missed=1_000_000, duration_s=9e7, steps=9e7)
    assert max(map(len, wide)) <= 80
