"""The compartment study: figures of the paper's table, laws of averaging, and the page."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from thermoctl.studies import figure as house
from thermoctl.studies.papers import bicer2017
from thermoctl.studies.papers.bicer2017 import Bicer2017, exact_model, table_1
from thermoctl.studies.papers.study import generator

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

HKT = {
    "Kalman filter": 384.4,
    "Filter 1": 80.9,
    "Filter 2, as printed": 25.92,
    "Filter 2, default settings": 26.40,
    "Filter 2, factors from 0.2": 25.79,
    "Filter 2, factors from 0.5": 22.37,
}


def last(study):
    *_, outcome = study.run()
    return outcome


@pytest.fixture(scope="module")
def three():
    """Three replications, of which an outcome is yielded after every one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bicer2017, "BATCH", 1)
        return list(Bicer2017(3).run())


def test_the_table_has_the_sums_of_squared_errors_that_the_theory_gives(three):
    assert [set(row) for row in three[-1].table] == [{"method", "hkt"}] * len(HKT)
    found = {row["method"]: row["hkt"] for row in three[-1].table}
    assert list(found) == list(HKT)
    assert found == pytest.approx(HKT, rel=1e-3)


def test_fewer_replications_are_the_beginning_of_more_in_batches_of_any_size(three):
    assert [outcome.replications for outcome in three] == [1, 2, 3]
    two = last(Bicer2017(2))
    assert two.table == three[1].table
    assert two.figures == three[1].figures


def test_another_seed_gives_other_noise(three):
    assert last(Bicer2017(1, seed=2)).table != three[0].table


def test_the_figures_are_those_of_the_paper_and_can_be_written_as_json(three):
    for outcome in three:
        assert list(outcome.figures) == ["1", "2", "3", "4", "5", "exact model"]
        figures = json.loads(json.dumps(outcome.figures, allow_nan=False))
        assert figures == outcome.figures
        for number in "12345":
            assert outcome.figures[number]["k"] == list(range(1, 101))
            assert {len(line) for line in outcome.figures[number]["values"].values()} == {100}


def test_the_running_sums_end_at_the_table_and_never_fall(three):
    sums = three[-1].figures["5"]["values"]
    for row in three[-1].table:
        assert sums[row["method"]][-1] == pytest.approx(row["hkt"], rel=1e-12)
        assert all(late >= early for early, late in pairwise(sums[row["method"]]))


def test_the_first_sum_is_that_of_the_two_errors_of_a_single_run(three):
    first = three[0].figures
    for name, line in first["1"]["values"].items():
        squares = line[0] ** 2 + first["2"]["values"][name][0] ** 2
        assert first["5"]["values"][name][0] == pytest.approx(squares, rel=1e-12)


def test_errors_and_factors_are_means_over_the_runs(three):
    runs = [table_1().replicate(generator(1, replication)) for replication in range(2)]
    error = np.mean([run["Filter 1"].error for run in runs], axis=0)
    fading = np.mean([run["Filter 1"].fading for run in runs], axis=0)
    figures = three[1].figures
    for column, number in enumerate("12"):
        values = figures[number]["values"]["Filter 1"]
        np.testing.assert_allclose(values, error[:, column], rtol=1e-12)
    np.testing.assert_allclose(figures["3"]["values"]["s2"], fading[:, 1], rtol=1e-12)


def test_an_error_is_the_state_less_its_estimate(three):
    assert all(line[0] > 0.0 for line in three[0].figures["1"]["values"].values())  # 10, not 7


def test_filter_1_adapts_the_observed_compartment_alone_and_filter_2_the_other_one_too(three):
    of_filter_1, of_filter_2 = (three[-1].figures[number]["values"] for number in "34")
    assert set(of_filter_1["s1"]) == {1.0}
    assert max(of_filter_1["s2"]) > 2.0
    assert of_filter_2["s1"][:2] == pytest.approx([0.13, 0.37], abs=0.01)
    assert of_filter_2["s1"][2:] == pytest.approx([1.0] * 98, abs=2e-4)


def test_the_rates_change_where_the_figures_say(three):
    quiet = replace(table_1(), Q=0.0, R=0.0)
    states, seen = quiet.simulate(np.random.default_rng(0))
    jump = three[0].figures["1"]["jump_after"]
    assert jump == 38
    lost = 1.0 - states[1:, 0] / states[:-1, 0]  # what the gut gives away in a step
    np.testing.assert_allclose(lost[: jump - 1], 0.09, rtol=1e-9)
    np.testing.assert_allclose(lost[jump - 1 :], 0.06, rtol=1e-9)
    assert np.array_equal(seen, states[:, 1])


def test_what_leaves_the_gut_arrives_in_the_blood():
    scenario = replace(table_1(), Q=0.0, transitions=np.array([bicer2017.transition(0.8, 0.0)] * 9))
    states, _ = scenario.simulate(np.random.default_rng(0))
    np.testing.assert_allclose(states.sum(axis=1), 20.0, rtol=1e-12)


def test_no_law_is_better_than_the_kalman_filter_that_knows_the_model():
    totals = dict.fromkeys(exact_model().laws, 0.0)
    for replication in range(12):
        tracks = exact_model().replicate(np.random.default_rng(replication))
        for name, track in tracks.items():
            totals[name] += float((track.error**2).sum())
    best = totals.pop("Kalman filter")
    assert all(total > best for total in totals.values())
    assert totals["Filter 2, default settings"] > 1.2 * best


def test_one_run_has_no_standard_error_and_more_have_that_of_their_mean(three):
    assert {row["standard_error"] for row in three[0].figures["exact model"]["rows"]} == {None}
    one, two = (
        {row["method"]: row for row in outcome.figures["exact model"]["rows"]}
        for outcome in three[:2]
    )
    for name, row in two.items():
        half = abs(row["mse"] - one[name]["mse"])  # of two runs: half their difference
        assert row["standard_error"] == pytest.approx(half, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("replications", value) for value in (0, -1, 2.0, True, "10", None)),
        *(("seed", value) for value in (-1, 0.5, False, None)),
    ],
)
def test_the_study_names_the_setting_it_refuses(name, value):
    with pytest.raises(ValueError, match=f"^{name} must be an integer of at least"):
        Bicer2017(**{name: value})


@pytest.mark.parametrize("count", [1, 3])
def test_the_page_is_drawn_from_any_number_of_runs(three, count, tmp_path, monkeypatch):
    monkeypatch.setitem(house._STYLE, "savefig.dpi", 40.0)
    files = [tmp_path / "page.png", tmp_path / "page.svg"]
    assert Bicer2017(count).draw(three[count - 1], files) == files
    assert files[0].read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in files[1].read_bytes()


@pytest.fixture
def page(three, monkeypatch):
    """The page as matplotlib holds it."""
    drawn = []
    monkeypatch.setattr(house, "save", lambda figure, path: drawn.append(figure) or path)
    Bicer2017(3).draw(three[-1], ["page.png"])
    return drawn[0]


def test_the_page_shows_what_the_figures_hold(three, page):
    for number, panel in zip("12345", page.axes, strict=False):
        assert panel.get_title(loc="left") == f"Figure {number}"
        assert panel.get_xlabel()
        assert panel.get_ylabel()
        lines = [list(line.get_ydata()) for line in panel.lines]
        for name, values in three[-1].figures[number]["values"].items():
            in_paper = name not in HKT or list(HKT).index(name) < 3
            assert (values in lines) == in_paper
    words = {text.get_text() for text in page.axes[4].texts}
    assert {f"{row['hkt']:.2f}" for row in three[-1].table} <= words


def test_factors_of_both_filters_are_drawn_to_one_scale(page):
    assert page.axes[2].get_ylim() == page.axes[3].get_ylim()
