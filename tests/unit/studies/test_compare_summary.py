"""Measures, statistics and verdicts, and how they are shown."""

import io
import json
import math

import numpy as np
import pytest
from rich.console import Console

from thermoctl.studies import figure as house
from thermoctl.studies.compare.figure import draw_comparison
from thermoctl.studies.compare.goals import GOALS, STATISTICS
from thermoctl.studies.compare.plants import FLEETS
from thermoctl.studies.compare.play import Trace
from thermoctl.studies.compare.present import as_json, print_table
from thermoctl.studies.compare.run import BOUND
from thermoctl.studies.compare.scenarios import SCENARIOS
from thermoctl.studies.compare.score import MEASURES, measured
from thermoctl.studies.compare.store import Result
from thermoctl.studies.compare.summary import summarise


def trace(off_k, power=None):
    off_k = np.asarray(off_k, dtype=float)
    t_s = np.arange(len(off_k), dtype=float)
    setpoint_c = np.full(len(off_k), 37.5)
    power = np.zeros(len(off_k)) if power is None else np.asarray(power, dtype=float)
    return Trace(t_s, setpoint_c + off_k, setpoint_c, power)


# -- measures --------------------------------------------------------------------------------------


def test_a_decay_settles_when_it_is_within_a_tenth_of_a_kelvin():
    off_k = -10.0 * np.exp(-np.arange(1000) / 50.0)
    assert measured(trace(off_k))["settled_s"] == math.ceil(50.0 * math.log(100.0))


def test_who_leaves_again_has_not_settled_before():
    off_k = np.zeros(1000)
    off_k[[10, 300]] = 0.2
    assert measured(trace(off_k))["settled_s"] == 301.0


def test_a_swing_that_ends_inside_has_not_settled():
    off_k = np.zeros(1000)
    off_k[850] = -0.2
    assert measured(trace(off_k))["settled_s"] is None


def test_what_never_was_outside_is_settled_at_once():
    assert measured(trace(np.full(100, 0.09)))["settled_s"] == 0.0


def test_overshoot_is_above_and_farthest_off_is_either_way():
    figures = measured(trace([-3.0, -1.0, 0.4, 0.0]))
    assert figures["overshoot_k"] == pytest.approx(0.4)
    assert figures["largest_k"] == pytest.approx(3.0)
    assert measured(trace([-3.0, -1.0]))["overshoot_k"] == 0.0


def test_deviation_is_about_the_mean_and_bias_is_the_mean():
    off_k = 0.02 + 0.01 * np.sqrt(2.0) * np.sin(2.0 * np.pi * np.arange(1000) / 50.0)
    figures = measured(trace(off_k))
    assert figures["bias_k"] == pytest.approx(0.02)
    assert figures["deviation_k"] == pytest.approx(0.01)


def test_travel_is_in_full_ranges_a_minute():
    assert measured(trace(np.zeros(61), [0.0, 1.0] * 30 + [0.0]))["travel_per_min"] == 60.0


# -- statistics and verdicts -----------------------------------------------------------------------


def results(settled_s, bound_s=(100.0, 100.0), controller="law", failure=None):
    runs = [
        Result(f"{controller}{seed}", controller, "rig", "warm-up", seed,
               {"settled_s": value, "overshoot_k": 0.01}, failure)
        for seed, value in enumerate(settled_s)
    ]  # fmt: skip
    bounds = [Result(f"b{seed}", BOUND, "rig", "warm-up", seed, {"settled_s": value})
              for seed, value in enumerate(bound_s)]  # fmt: skip
    return [*runs, *bounds]


def line(found, measure="settled_s"):
    (only,) = [each for each in summarise(found, ["law"]) if each.measure == measure]
    return only


def test_each_run_is_compared_with_the_bound_of_its_own_plant():
    score = line(results([110.0, 240.0], bound_s=(100.0, 200.0))).scores["law"]
    assert score.ratio["median"] == pytest.approx(1.15)
    assert score.ratio["max"] == pytest.approx(1.2)
    assert score.plain["mean"] == pytest.approx(175.0)


def test_the_95_per_cent_of_few_plants_are_the_worst_of_them():
    score = line(results([100.0, 130.0])).scores["law"]
    assert score.ratio["p95"] == pytest.approx(1.3)


def test_quantiles_of_twenty_plants_leave_the_worst_out():
    settled_s = [100.0 + seed for seed in range(20)]
    score = line(results(settled_s, bound_s=[100.0] * 20)).scores["law"]
    assert score.ratio["p95"] == pytest.approx(1.18)
    assert score.ratio["p90"] == pytest.approx(1.17)
    assert score.ratio["max"] == pytest.approx(1.19)


@pytest.mark.parametrize(
    ("settled_s", "failure", "passed"),
    [
        ([115.0, 125.0], None, True),
        ([121.0, 125.0], None, False),  # median over 1.2
        ([110.0, 145.0], None, False),  # 95 % over 1.4
        ([110.0, None], None, False),
        ([115.0, 125.0], "trip.over_temperature at 3 s", False),
    ],
)
def test_a_verdict_needs_every_goal_and_no_failure(settled_s, failure, passed):
    assert line(results(settled_s, failure=failure)).scores["law"].passed is passed


def test_a_measure_without_a_bound_is_judged_in_its_unit():
    overshoot = line(results([110.0, 110.0]), "overshoot_k")
    assert overshoot.bound is None
    assert overshoot.scores["law"].ratio is None
    assert overshoot.scores["law"].passed is True


def test_goals_are_of_fleets_scenarios_measures_and_statistics_that_are():
    for fleet, scenario, measure in GOALS:
        assert scenario in FLEETS[fleet].scenarios
        assert measure in SCENARIOS[scenario].measures
        assert {goal.statistic for goal in GOALS[fleet, scenario, measure]} <= set(STATISTICS)
    assert {m for each in SCENARIOS.values() for m in each.measures} <= set(MEASURES)


# -- how it is shown -------------------------------------------------------------------------------


def printed(found, controllers, encoding="utf-8"):
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding=encoding, write_through=True)
    print_table(Console(file=file, width=120), summarise(found, controllers), controllers)
    return raw.getvalue().decode(encoding)


def test_a_table_marks_what_misses_its_goal():
    text = printed(results([121.0, 125.0]), ["law"])
    (row,) = [each for each in text.splitlines() if "settled" in each]
    assert "100 s" in row
    assert "1.23 / 1.25 ▲" in row
    assert row.endswith("miss   ") or row.rstrip().endswith("miss")
    assert "2 plants" in text


def test_a_table_says_never_and_how_many_failed():
    found = results([110.0, None], failure="controller.failed at 0 s")
    (row,) = [each for each in printed(found, ["law"]).splitlines() if "settled" in each]
    assert "never / never" in row
    assert "2 failed" in row


def test_a_terminal_without_unicode_gets_a_table_too():
    assert "x" in printed(results([121.0, 125.0]), ["law"], encoding="ascii")


def test_json_has_null_for_what_was_never_reached():
    content = json.loads(json.dumps(as_json(summarise(results([110.0, None]), ["law"])),
                                    allow_nan=False))  # fmt: skip
    (settled,) = [each for each in content if each["measure"] == "settled_s"]
    law = settled["controllers"]["law"]
    assert law["ratio"]["p95"] is None
    assert law["ratio"]["median"] is None
    assert law["runs"] == 2
    assert settled["goals"][0] == {"statistic": "median", "at_most": 1.2, "plain": False}


def test_a_figure_is_drawn_whatever_was_never_reached(tmp_path):
    found = [*results([110.0, None]), *results([None, None], controller="other")]
    files = [tmp_path / "compare.png", tmp_path / "compare.svg"]
    lines = summarise(found, ["law", "other", "absent"])
    assert draw_comparison(lines, ["law", "other", "absent"], files) == files
    assert all(file.stat().st_size > 1000 for file in files)


@pytest.fixture
def page(monkeypatch):
    """Return a function that draws a comparison and returns its notes and the dashes of goals."""

    def draw(lines, controllers):
        kept = []

        def keep(figure, path):
            kept.append([text.get_text() for text in figure.texts])
            dashes = [line._unscaled_dash_pattern for line in figure.axes[0].get_lines()]
            kept.append({tuple(pattern) for _, pattern in dashes if pattern is not None})
            return path

        monkeypatch.setattr(house, "save", keep)
        draw_comparison(lines, controllers, ["unused.png"])
        return kept

    return draw


def test_a_figure_says_what_its_marks_and_names_mean(page):
    notes, dashes = page(summarise(results([110.0, 120.0]), ["law"]), ["law"])
    assert "dotted: goal of the median or mean; dashed: goal of the 95 %" in notes
    assert any(note.startswith("solid, at 1: the bound") for note in notes)
    assert f"rig: {FLEETS['rig'].text}" in notes
    assert dashes == {(1, 1), (4, 2)}


def test_a_figure_names_the_controllers_that_it_has_no_room_for(page):
    names = ["law", "b", "c", "d", "on-off"]
    found = [each for name in names for each in results([110.0], controller=name)]
    notes, _ = page(summarise(found, names), names)
    assert "not drawn, and in the table: on-off" in notes


def test_a_figure_has_a_letter_for_each_of_four_units(tmp_path):
    figures = {"settled_s": 50.0, "largest_k": 0.2, "deviation_k": 0.02, "travel_per_min": 0.3}
    found = [
        Result(f"{controller}{scenario}", controller, "tclab", scenario, 0, of, None)
        for controller, of in (("law", figures), (BOUND, {"deviation_k": 0.01}))
        for scenario in ("regulation", "second-heater")
    ]
    lines = summarise(found, ["law"])
    assert draw_comparison(lines, ["law"], [tmp_path / "compare.svg"])
