"""What a tuning tells people: the numbers it found, with their error bars and units."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thermoctl.estimation import Order
from thermoctl.studies import figure as house
from thermoctl.studies.excitation import Excitation
from thermoctl.studies.record import Columns, Record
from thermoctl.studies.tuning import tune
from thermoctl.studies.tuning_figure import draw_tuning
from thermoctl.studies.tuning_words import tuning_json, tuning_lines

PERIOD_S, DELAY = 2.0, 4
SIGNAL = Excitation(0.0, 0.6, 35.5, 37.5, 1600.0, PERIOD_S, 0.06, 1)


@pytest.fixture(scope="module")
def tuning():
    """A tank that rises by .05 K a sample at full power, four samples after it was given."""
    rng = np.random.default_rng(6)
    u, y = np.repeat(rng.choice((0.0, 0.6), 40), 20), np.full(800, 36.0)
    for t in range(DELAY, len(y)):
        y[t] = y[t - 1] + 0.05 * u[t - DELAY] - 0.001 * (y[t - 1] - 15.0)
    y += 0.01 * rng.standard_normal(len(y))
    record = Record("made", PERIOD_S * np.arange(len(y)), u, y, Columns("y", "u", "t"))
    return tune(record, [Order(2, 1, DELAY)], 37.5)


def row(tuning, name):
    (text,) = (line for line in tuning_lines(tuning) if line.startswith(name))
    return text.removeprefix(name).strip()


@pytest.mark.parametrize(
    ("name", "key", "factor"),
    [
        ("gain", "gain_k_per_min", 1.0),
        ("lag", "lag_s", 1.0),
        ("holding power", "holding_power", 100.0),
        ("loss", "loss_k_per_min", 1.0),
    ],
)
def test_a_row_has_the_value_and_half_the_width_of_its_bounds(tuning, name, key, factor):
    bounded = getattr(tuning.words, key)
    value, spread = map(float, re.match(r"([\d.]+) ± ([\d.]+) ", row(tuning, name)).groups())
    assert value == pytest.approx(factor * bounded.value, rel=0.05)
    assert spread == pytest.approx(factor * (bounded.high - bounded.value), rel=0.05)


def test_a_dead_time_is_the_delay_but_for_the_sample_every_answer_takes(tuning):
    assert row(tuning, "dead time") == "6 s in order 2,1,4"


@pytest.fixture
def drawn(monkeypatch):
    """Return a function that draws a tuning and returns each panel's lines and the text below."""
    kept = []

    def keep(figure, path):
        lines = [[line.get_xydata() for line in panel.get_lines()] for panel in figure.axes]
        words = [
            [text.get_text() for text in (*panel.texts, panel.title, panel._right_title)]
            for panel in figure.axes
        ]
        kept.extend((lines, [text.get_text() for text in figure.texts], words))
        return path

    def draw(tuning):
        kept.clear()
        draw_tuning(tuning, SIGNAL, [Path("unused.png")])
        return kept

    monkeypatch.setattr(house, "save", keep)
    return draw


def test_the_answer_that_is_drawn_ends_on_gain_and_lag(tuning, drawn):
    words, model = drawn(tuning)[0][-1]
    assert model[-1] == pytest.approx(words[-1], rel=0.1)


def test_every_line_of_the_page_has_a_name(tuning, drawn):
    weighed = tune(tuning.record, [Order(1, 1, DELAY), Order(2, 1, DELAY)], 37.5)
    _, _, (_, power, orders, answer) = drawn(weighed)
    assert "taken" in power
    assert any("as the board took it: accepted_power in run.csv" in each for each in power)
    assert "settled: 95 %" in orders
    assert any(each.startswith("solid: model · dashed: gain ") for each in answer)


def test_of_a_plant_that_was_not_heard_no_answer_is_drawn_and_it_says_why(tuning, drawn):
    heard = len(drawn(tuning)[0])
    panels, below, _ = drawn(replace(tuning, words=None))
    assert len(panels) == heard - 1
    assert all(panels)
    assert "the power moved too little" in below[0]


def test_parameters_are_not_told_of_a_plant_that_was_not_heard(tuning):
    deaf = replace(tuning, words=None)
    assert tuning_json(tuning)["model"]["n"] == tuning.order.n
    assert tuning_json(deaf)["model"] is None
    assert not [line for line in tuning_lines(deaf) if line.startswith("Parameters")]
