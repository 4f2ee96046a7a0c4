import io
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from thermoctl.model.arx import Arx
from thermoctl.studies.experiment import Measures
from thermoctl.studies.laws import parse_law
from thermoctl.studies.present import (
    experiment_json,
    print_experiment,
    print_lines,
    print_replay,
    replay_json,
)
from thermoctl.studies.record import Columns, Record
from thermoctl.studies.replay import replay


@pytest.fixture
def result():
    rng = np.random.default_rng(3)
    u, y = rng.choice((0.0, 1.0), 300), np.zeros(300)
    for t in range(1, 300):
        y[t] = 0.9 * y[t - 1] + u[t - 1] + 0.1 * rng.standard_normal()
    record = Record("a.csv", np.arange(300.0), u, y, Columns("y", "u", "t"), 2, ("2 rows left",))
    return replay(record, Arx(2, 2, 1), [parse_law(word) for word in ("ckf", "nkf", "rls:0.98")])


class Ascii(io.StringIO):
    encoding = "ascii"


def printed(show, *what, width=120, file=io.StringIO):
    console = Console(file=file(), width=width)
    show(console, *what)
    return console.file.getvalue()


def test_a_long_line_goes_on_below_its_text_on_a_terminal_and_stays_whole_in_a_file():
    lines = ["Record   run.csv: 1,201 samples, every 1 s, 20 min", "", "a   b"]
    terminal = Console(file=io.StringIO(), width=30, force_terminal=True)
    print_lines(terminal, lines)
    assert terminal.file.getvalue().splitlines() == [
        "Record   run.csv: 1,201",
        "         samples, every 1 s,",
        "         20 min",
        "",
        "a   b",
    ]
    assert printed(print_lines, lines, width=30).splitlines() == lines


@pytest.mark.parametrize("width", [20, 80, 200])
def test_every_figure_is_shown_whole_on_a_terminal_of_any_width(result, width):
    text = printed(print_replay, result, width=width)
    assert "…" not in text
    for name in ("a1", "a2", "b1", "b2", "ckf", "nkf", "rls:0.98", "2 rows left"):
        assert name in text
    assert text.count(" ± ") >= 12


def test_a_narrow_terminal_gets_a_row_for_each_parameter(result):
    def rows(width):
        return [
            line.split()[:1] for line in printed(print_replay, result, width=width).splitlines()
        ]

    assert ["a1"] in rows(60)
    assert ["a1"] not in rows(120)


def test_json_knows_null_but_no_nan(result):
    lost = replace(result.scores[0], r2=math.nan, theta=(math.inf, 1.0))
    told = replay_json(replace(result, scores=(lost,)))
    assert told["estimators"][0]["r2"] is None
    assert told["estimators"][0]["theta"] == [None, 1.0]
    json.dumps(told, allow_nan=False)


def test_a_law_that_foresaw_nothing_is_called_by_name(result):
    lost = replace(result.scores[1], r2=-3.0)
    text = printed(print_replay, replace(result, scores=(result.scores[0], lost)))
    assert "nkf foresaw nothing" in text
    assert "ckf foresaw nothing" not in text


def test_a_law_worse_than_the_last_value_is_called_by_name(result):
    worse = replace(result.scores[2], rms_error=2.0 * result.conditions.persistence_rms)
    text = printed(print_replay, replace(result, scores=(result.scores[0], worse)))
    assert "Worse than the last value as prediction: rls:0.98." in text


@pytest.mark.parametrize(("p", "said"), [(0.04, True), (0.06, False)])
def test_innovations_that_are_not_white_are_remarked_on(result, p, said):
    scores = tuple(replace(score, whiteness_p=p) for score in result.scores)
    assert (
        "No innovations are white" in printed(print_replay, replace(result, scores=scores))
    ) == said


def test_whiteness_that_could_not_be_judged_is_unknown_and_no_verdict(result):
    unknown = {"whiteness_p": math.nan, "whiteness_unknown": "too few"}
    scores = tuple(replace(score, **unknown) for score in result.scores)
    text = printed(print_replay, replace(result, scores=scores))
    assert text.count("Whiteness unknown for ") == 3
    assert "Whiteness unknown for rls:0.98: too few." in text
    assert "No innovations" not in text


def test_a_verdict_is_of_those_laws_only_that_could_be_judged(result):
    first, second, _ = result.scores
    lost = replace(first, whiteness_p=math.nan, whiteness_unknown="it foresaw nothing")
    coloured = replace(second, whiteness_p=0.01)
    text = printed(print_replay, replace(result, scores=(lost, coloured)))
    assert "No innovations of nkf are white (p < 0.05)" in text


@pytest.mark.parametrize("width", [60, 120])
def test_an_ascii_console_gets_ascii_in_straight_columns(result, width):
    text = printed(print_replay, result, width=width, file=Ascii)
    assert text.isascii()
    assert "u -> y" in text
    rows = text[text.index("parameters") :].split("\n\n")[0].splitlines()
    assert len({len(row.rstrip()) for row in rows}) == 1
    assert printed(print_experiment, "ä", Measures(bias_k=-0.01), file=Ascii).isascii()


def test_measures_that_are_not_known_give_the_reason():
    nothing = printed(print_experiment, "title", Measures())
    assert nothing.count("the run was too short") == 1
    calm = Measures(300.0, 0.1, 900.0, -0.01, 0.02, 0.1, None, None, 0.4, 0.196)
    text = printed(print_experiment, "title", calm)
    assert text.count("no swing that comes back regularly") == 2
    assert "−0.010  K" in text
    assert "19.6  %" in text


def test_measures_as_json_have_units_in_their_names():
    told = experiment_json(Measures(warm_up_s=300.0), {"seed": 1}, [Path("x/e.png")])
    assert told["measures"]["warm_up_s"] == 300.0
    assert told["measures"]["cycle_k"] is None
    assert told["figures"] == {"png": "x/e.png"}
