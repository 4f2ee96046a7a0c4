"""What a replay whose order was chosen by the record tells of that choice."""

import io
import json

import numpy as np
import pytest
from rich.console import Console

from thermoctl.estimation import Order
from thermoctl.model.arx import Arx
from thermoctl.studies import figure as house
from thermoctl.studies.laws import parse_candidates, parse_law, parse_order_or_auto
from thermoctl.studies.orders import weigh
from thermoctl.studies.orders_words import percent
from thermoctl.studies.present import print_replay, replay_json
from thermoctl.studies.record import Columns, Record
from thermoctl.studies.replay import replay
from thermoctl.studies.replay_figure import draw_replay

CANDIDATES = parse_candidates("1-2,1,1-4")


def made(b=1.0, samples=500):
    rng = np.random.default_rng(5)
    u, y = np.repeat(rng.choice((0.0, 1.0), samples // 5), 5), np.zeros(samples)
    for t in range(2, samples):
        y[t] = 0.98 * y[t - 1] + b * u[t - 2] + 0.1 * rng.standard_normal()
    return Record("made", np.arange(float(samples)), u, y, Columns("y", "u", "t"))


def replayed(record, **constants):
    weighing = weigh(record, CANDIDATES, **constants)
    return replay(record, weighing, [parse_law("nkf")], **constants)


def printed(result):
    console = Console(file=io.StringIO(), width=120)
    print_replay(console, result)
    return console.file.getvalue()


def test_the_estimators_are_replayed_at_the_order_that_was_chosen():
    result = replayed(made())
    assert result.weighing.chosen == Order(1, 1, 2)
    assert result.conditions.order == Arx(1, 1, 2)
    theta = dict(zip(("a1", "b1"), result.scores[0].theta, strict=True))
    assert theta["a1"] == pytest.approx(-0.98, abs=0.01)
    assert theta["b1"] == pytest.approx(1.0, abs=0.05)


def test_scaling_and_noise_are_those_of_the_weighing():
    result = replayed(made())
    assert result.conditions.R2 == result.weighing.R2
    assert result.conditions.u_centre == result.weighing.scaling.u_centre
    assert result.conditions.R2_source.startswith("estimated")
    assert replayed(made(), R2=0.02).conditions.R2_source == "given"


def test_json_has_every_order_with_its_probability_and_the_chosen_one():
    told = json.loads(json.dumps(replay_json(replayed(made())), allow_nan=False))
    assert len(told["orders"]) == len(CANDIDATES)
    assert set(told["orders"][0]) == {"n", "m", "delay", "posterior"}
    assert sum(each["posterior"] for each in told["orders"]) == pytest.approx(1.0)
    assert told["chosen"] == {"n": 1, "m": 1, "delay": 2}
    assert told["undecided"] is None
    assert told["conditions"]["order"] == [1, 1, 2]


def test_json_of_an_order_that_was_given_says_nothing_of_others():
    told = replay_json(replay(made(), Arx(1, 1, 2), [parse_law("nkf")]))
    assert set(told) == {"samples", "estimators", "conditions"}


def test_an_undecided_record_is_replayed_at_the_most_probable_order_and_says_so():
    result = replayed(made(b=0.0))
    told = replay_json(result)
    assert told["chosen"] is None
    assert told["undecided"].startswith("the input is not heard")
    best = told["orders"][0]
    assert told["conditions"]["order"] == [best["n"], best["m"], best["delay"]]
    text = " ".join(printed(result).split())
    assert "undecided" in text
    assert "the most probable, is used" in text


def test_a_table_shows_the_most_probable_orders():
    text = printed(replayed(made()))
    rows = [line.split() for line in text.splitlines()]
    assert ["order", "n,m,d", "probability"] in rows
    assert any(row[:1] == ["1,1,2"] and row[-1] == "%" for row in rows)
    assert "from sample" in text


@pytest.mark.parametrize(("given", "source"), [({}, "from its errors"), ({"R2": 0.02}, "given")])
def test_the_lines_say_where_the_noise_comes_from(given, source):
    (line,) = (each for each in printed(replayed(made(), **given)).splitlines() if "nats" in each)
    assert line.endswith(source)


@pytest.mark.parametrize(
    ("probability", "shown"),
    [(1.0, "100 %"), (0.99999, "> 99.9 %"), (0.5, "50 %"), (1e-5, "< 0.1 %"), (0.0, "0 %")],
)
def test_nothing_uncertain_is_shown_as_certain(probability, shown):
    assert percent(probability) == shown


@pytest.mark.slow
@pytest.mark.parametrize("b", [1.0, 0.0])
def test_a_figure_has_a_panel_more_when_orders_were_weighed(tmp_path, monkeypatch, b):
    monkeypatch.setitem(house._STYLE, "savefig.dpi", 40.0)
    record = made(b)
    result = replayed(record)
    order = result.weighing.best.structure()
    plain = draw_replay(replay(record, order, [parse_law("nkf")]), [tmp_path / "plain.png"])
    more = draw_replay(result, [tmp_path / "more.png"])
    heights = [int.from_bytes(path.read_bytes()[20:24], "big") for path in (*plain, *more)]
    assert heights[1] > heights[0] + 40


@pytest.mark.parametrize(
    ("text", "count"), [("2,1,3", 1), ("1-3,1-2,1-8", 48), (" 1 , 1-2 , 4-6 ", 6), ("2,0,1", 1)]
)
def test_candidates_are_orders_or_ranges_of_them(text, count):
    orders = parse_candidates(text)
    assert len(set(orders)) == len(orders) == count


@pytest.mark.parametrize(
    "text", ["", "1", "1,1", "3-1,1,1", "1-,1,1", "1--2,1,1", "a,b,c", "-1,1,1"]
)
def test_what_is_no_range_of_orders_is_refused(text):
    with pytest.raises(ValueError, match=r"expected n,m,d or ranges .* got"):
        parse_candidates(text)


@pytest.mark.parametrize("text", ["1,1,201", "201,1,1", "1,1-99999999999,1"])
def test_orders_that_reach_too_far_back_are_refused_before_they_are_made(text):
    with pytest.raises(ValueError, match="at most, got"):
        parse_candidates(text)


def test_auto_is_a_word_for_the_order():
    assert parse_order_or_auto("auto") is None
    assert parse_order_or_auto("2,1,3") == Arx(2, 1, 3)
    with pytest.raises(ValueError, match="expected auto or n,m,d"):
        parse_order_or_auto("automatic")
