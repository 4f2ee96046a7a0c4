"""What leaves the program for each cycle, under the default controller and in its shadow."""

import json

import pytest

from thermoctl.app.cycle_record import as_line
from thermoctl.app.sim import bench_settings, simulate


@pytest.fixture(scope="module")
def lines():
    """Return the lines of eleven minutes of the aquarium."""
    return [json.loads(as_line(cycle)) for cycle in simulate(bench_settings(), 660.0, seed=4)]


def test_the_default_and_the_law_of_the_paper_in_its_shadow(lines):
    assert {(each["controller"], each["shadow"]) for each in lines} == {
        ("adaptive", "self-tuning-mv")
    }
    assert all(0.0 <= each["shadow_power"] <= 1.0 for each in lines)


def test_the_simple_model_is_told_under_every_controller(lines):
    learnt = lines[1:]
    for key in ("a", "a_sd", "inflation", "innovation_k"):
        assert all(isinstance(each[key], float) for each in learnt), key


def test_gain_lag_and_holding_power_are_the_default_s_own(lines):
    last = lines[-1]
    assert last["gain"] == pytest.approx(0.042, rel=0.1)
    assert 0.0 < last["gain_sd"] < 0.005
    assert 10.0 < last["lag_s"] < 60.0
    assert 0.1 < last["holding_power"] < 0.3


def test_the_score_is_an_object_of_its_own_from_the_first_minute_on(lines):
    assert {each["shadow_score"] is None for each in lines[:50]} == {True}
    score = lines[-1]["shadow_score"]
    assert set(score) == {
        "span_s", "apart", "travel_per_min", "shadow_travel_per_min", "surprise_k",
        "shadow_surprise_k",
    }  # fmt: skip
    assert score["span_s"] == 600.0
    assert 0.0 < score["surprise_k"] < score["shadow_surprise_k"]
