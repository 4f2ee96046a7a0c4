"""What a person is told at the end of a run."""

import json
import math
from types import SimpleNamespace

import pytest

from thermoctl.app.bench import BenchOptions, run_bench
from thermoctl.app.report import Summary, closing_lines
from thermoctl.app.sim import bench_settings, default_profile
from thermoctl.signals import Mode, State

HELD = {
    "duration_s": 3600.0,
    "steps": 3601,
    "missed": 0,
    "overshoot_k": 0.1234,
    "settled_s": 412.0,
    "settled_for_good_s": 412.0,
    "deviation_mk": 8.31,
    "max_deviation_mk": 25.7,
    "travel_per_min": 0.4111,
    "final_temperature_c": 37.455467961274384,
    "latched": False,
    "ended": {"tank": {"mode": "auto", "state": "run", "alarms": []}},
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
    nothing = dict.fromkeys(("deviation_mk", "max_deviation_mk"))
    lines = told(settled_for_good_s=None, settled_s=None, **nothing)
    assert lines[1].startswith("Settled   never: not within ±0.1 K of the set point for 60 s")
    assert lines[2] == "Held      not judged before it was reached"


def test_a_run_that_reached_its_set_point_and_left_it_did_not_settle():
    line = "Settled   never; first there after 6 min 52 s, overshoot 0.12 K"
    assert told(settled_for_good_s=None)[1] == line


def test_a_run_that_came_back_says_when_it_was_there_first():
    line = "Settled   after 10 min; first there after 6 min 52 s, overshoot 0.12 K"
    assert told(settled_for_good_s=600.0)[1] == line


def test_a_loop_that_is_latched_has_a_line_of_its_own():
    end = {"mode": "auto", "state": "latched", "alarms": ["trip.over_temperature"]}
    *_, line = told(latched=True, ended={"tank": end})
    assert line == "Off       tank ended LATCHED, off until acknowledged: trip.over_temperature"


def cycle(t_s, deviation_k, loop="tank", state=State.RUN):
    """Return a finished cycle at 37.5 degC with so much deviation."""
    measurement = SimpleNamespace(temperature_c=37.5 + deviation_k)
    step = SimpleNamespace(
        t_s=t_s,
        setpoint_c=37.5,
        measurement=measurement,
        mode=Mode.AUTO,
        state=state,
        alarms=[SimpleNamespace(code="trip.over_temperature")] * (state is State.LATCHED),
    )
    return SimpleNamespace(loop=loop, step=step, truth={}, accepted_power=0.5, missed=0)


def figures_of(deviations_k):
    """Return the summary of a run with these deviations, one a second."""
    summary = Summary()
    for t_s, deviation_k in enumerate(deviations_k):
        summary.add(cycle(float(t_s), deviation_k))
    return summary.as_dict()


def test_what_leaves_the_band_again_was_reached_and_has_not_settled():
    swings = [-0.05] * 200 + [0.3] * 10 + [-0.05] * 30
    figures = figures_of([-1.0] * 100 + swings)
    assert (figures["settled_s"], figures["settled_for_good_s"]) == (100.0, None)
    assert figures["max_deviation_mk"] == 300.0


def test_what_comes_back_to_stay_has_settled_there():
    figures = figures_of([-1.0] * 100 + [0.05] * 100 + [0.3] * 10 + [0.05] * 90)
    assert (figures["settled_s"], figures["settled_for_good_s"]) == (100.0, 210.0)


BLIND = [math.nan] * 6
HELD_K = [-1.0] * 100 + [0.05] * 100


@pytest.mark.parametrize("unseen", [BLIND, BLIND * 100])
def test_what_nobody_saw_to_the_end_has_been_reached_and_has_not_settled(unseen):
    figures = figures_of(HELD_K + unseen)
    assert (figures["settled_s"], figures["settled_for_good_s"]) == (100.0, None)


def test_what_nobody_saw_for_a_while_has_settled_after_it():
    figures = figures_of(HELD_K + BLIND + [0.05] * 90)
    assert (figures["settled_s"], figures["settled_for_good_s"]) == (100.0, 206.0)


@pytest.mark.parametrize("after", [[], [0.05] * 90])
def test_a_few_readings_that_are_missing_do_not_undo_what_has_settled(after):
    figures = figures_of(HELD_K + BLIND[1:] + after)
    assert (figures["settled_s"], figures["settled_for_good_s"]) == (100.0, 100.0)


def test_a_minute_that_was_not_seen_whole_settles_nothing():
    figures = figures_of([-1.0] * 100 + [0.05] * 60 + BLIND[1:])
    assert (figures["settled_s"], figures["settled_for_good_s"]) == (None, None)


def test_readings_that_are_missing_do_not_change_when_the_set_point_was_reached():
    figures = figures_of([-1.0] * 100 + [0.05] * 30 + BLIND * 5 + [0.05] * 5)
    assert (figures["settled_s"], figures["settled_for_good_s"]) == (100.0, None)


def test_the_summary_says_how_every_loop_ended():
    summary = Summary()
    summary.add(cycle(0.0, 0.0))
    summary.add(cycle(0.0, 50.0, loop="oven", state=State.LATCHED))
    figures = summary.as_dict()
    assert figures["latched"] is True
    assert figures["ended"]["tank"]["state"] == "run"
    assert figures["ended"]["oven"]["alarms"] == ["trip.over_temperature"]


def test_a_run_that_latches_says_so_on_stderr_and_in_its_summary(capsys, tmp_path):
    path = tmp_path / "hot.toml"
    text = default_profile().read_text(encoding="utf-8")
    text = text.replace("setpoint_c = 37.5", "setpoint_c = 29.99").replace("_c = 60.0", "_c = 30.0")
    path.write_text(text.replace("setpoint_max_c = 55.0", ""), encoding="utf-8")
    settings = bench_settings(path, 1)
    run_bench(settings, BenchOptions(float("inf"), 600.0, as_json=True, history=None))
    out, err = capsys.readouterr()
    summary = json.loads(out.splitlines()[-1])["summary"]
    assert summary["latched"] is True
    assert summary["ended"]["tank"]["state"] == "latched"
    assert "tank ended LATCHED, off until acknowledged: trip.over_temperature" in err


def test_cycles_that_were_missed_are_counted():
    assert told(missed=12)[0].endswith("3,601 cycles, 12 missed")


def test_a_run_without_a_cycle_says_so():
    assert closing_lines(Summary().as_dict()) == ["Ran       no cycle was finished"]


@pytest.mark.parametrize("unknown", [None, math.nan])
def test_what_is_not_known_is_a_dash(unknown):
    lines = told(final_temperature_c=unknown, travel_per_min=unknown)
    assert lines[3] == "Ended at  –; power moved – full ranges a minute"


def test_no_line_is_wider_than_a_terminal():
    wide = told(
        settled_for_good_s=None,
        settled_s=None,
        overshoot_k=35.0,
        missed=1_000_000,
        duration_s=9e7,
        steps=9e7,
    )
    assert max(map(len, wide)) <= 80
    assert max(map(len, told(settled_for_good_s=86_399.0, overshoot_k=35.0))) <= 80
