"""The simulation study of O21: its table, its figures, and that batches do not show."""

import json
import math

import numpy as np
import pytest

from thermoctl.estimation import run_batch
from thermoctl.studies import figure as house
from thermoctl.studies.papers import ozbek2021_figure
from thermoctl.studies.papers.ozbek2021 import Ozbek2021, scores_of
from thermoctl.studies.papers.ozbek2021_methods import METHODS, POLE, outputs
from thermoctl.studies.papers.study import generator

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

KEYS = [
    "method",
    "mse",
    "mse_1_100",
    "mse_101_200",
    "mse_201_400",
    "final_P_median",
    "residual_variance",
]

# As an independent program found them with 1,000 replications.
EXPECTED = {
    "RLS 1": (0.668, 0.0019, 2.15, 0.259, 3.9e-4, 4.55),
    "RLS 0.99": (0.554, 0.0019, 1.48, 0.367, 2.0e-3, 3.78),
    "RLS 0.9": (0.115, 0.0101, 0.213, 0.118, 2.5e-2, 1.66),
    "RLS 0.8": (0.0854, 0.0320, 0.132, 0.0888, 5.8e-2, 1.56),
    "variable forgetting, Sigma0 10": (0.0708, 0.0109, 0.126, 0.0731, 2.8e-2, 1.50),
    "NKF": (0.668, 0.0019, 2.15, 0.259, 3.9e-4, 4.55),
    "CKF": (0.0742, 0.0064, 0.139, 0.0759, 1.5e-2, 1.50),
}
HALF_A_DIGIT = (0.0005, 0.00005, 0.005, 0.0005)


def noise(replications, seed):
    return [generator(seed, r).normal(size=400) for r in range(replications)]


def last(study):
    *_, outcome = study.run()
    return outcome


@pytest.fixture(scope="module")
def outcome():
    """What 200 replications of seed 5 find."""
    return last(Ozbek2021(200, seed=5))


@pytest.fixture(scope="module")
def single():
    """What one replication finds, and the outputs y(0) to y(400) it came from."""
    return last(Ozbek2021(1, seed=5)), outputs(noise(1, 5))[:, 0]


def test_the_table_has_the_seven_methods_and_the_keys_that_programs_expect(outcome):
    assert [list(row) for row in outcome.table] == [KEYS] * 7
    assert [row["method"] for row in outcome.table] == list(EXPECTED)
    assert [column.key for column in Ozbek2021.columns] == KEYS


@pytest.mark.parametrize("place", range(7), ids=list(EXPECTED))
def test_the_table_is_that_of_an_independent_program_within_monte_carlo_error(outcome, place):
    row, method = outcome.table[place], METHODS[place]
    *errors, last_P, residual_variance = EXPECTED[method.name]
    y = outputs(noise(200, 5))
    spread = scores_of(run_batch(method.law, y[1:], y[:-1, :, None])).std(axis=0)
    # 200 runs here and 1,000 there.
    error = 3.5 * spread * math.sqrt(1 / 200 + 1 / 1000)
    for key, expected, own, digit in zip(KEYS[1:], errors, error, HALF_A_DIGIT, strict=False):
        assert row[key] == pytest.approx(expected, abs=own + digit), key
    assert row["final_P_median"] == pytest.approx(last_P, rel=0.25)
    assert row["residual_variance"] == pytest.approx(residual_variance, abs=error[-1] + 0.005)


def test_the_normal_filter_is_least_squares_that_forgets_nothing(outcome):
    rows = {row["method"]: dict(row) for row in outcome.table}
    ours, theirs = rows["NKF"], rows["RLS 1"]
    assert {**ours, "method": ""} == {**theirs, "method": ""}
    for ours, theirs in (("14", "1"), ("15", "2"), ("17", "3")):
        assert outcome.figures[ours]["values"] == outcome.figures[theirs]["values"]


def test_fewer_replications_are_the_beginning_of_more():
    parts = list(Ozbek2021(7, seed=3, batch=3).run())
    assert [part.replications for part in parts] == [3, 6, 7]
    fewer = last(Ozbek2021(6, seed=3, batch=3))
    assert fewer.table == parts[1].table
    assert fewer.table != parts[2].table
    assert fewer.figures == parts[2].figures


def test_the_size_of_a_batch_changes_no_digit():
    whole = last(Ozbek2021(5, seed=3, batch=5))
    for batch in (1, 2, 3):
        other = last(Ozbek2021(5, seed=3, batch=batch))
        assert other.table == whole.table
        assert other.figures == whole.figures


def test_another_seed_is_another_run():
    first, second = last(Ozbek2021(1, seed=3)), last(Ozbek2021(1, seed=4))
    assert first.table != second.table


def test_every_figure_of_the_paper_is_there_with_all_its_samples(outcome):
    assert list(outcome.figures) == [str(number) for number in range(1, 19)]
    for figure in outcome.figures.values():
        assert figure["t"] == list(range(1, 401))
        assert all(len(figure[key]) == 400 for key in set(figure) - {"title"})
    with_truth = [number for number, figure in outcome.figures.items() if "true" in figure]
    assert with_truth == ["1", "4", "7", "10", "13", "14"]
    assert all(outcome.figures[number]["true"] == POLE.tolist() for number in with_truth)
    json.dumps(outcome.figures, allow_nan=False)


def test_the_titles_say_what_each_figure_of_the_paper_shows(outcome):
    shown = {number: figure["title"] for number, figure in outcome.figures.items()}
    assert shown["2"] == "P, RLS 1"
    assert shown["6"] == "Residuals, RLS 0.99"
    assert shown["13"] == "Estimate of a, CKF"
    assert [shown[n] for n in ("14", "15", "17")] == [
        "Estimate of a, NKF",
        "P, NKF",
        "Residuals, NKF",
    ]


@pytest.mark.parametrize("method", [m for m in METHODS if m.figures], ids=lambda m: m.name)
def test_figures_and_table_of_one_run_are_the_same_numbers(single, method):
    outcome, y = single
    row = next(row for row in outcome.table if row["method"] == method.name)
    a, P, e = (np.array(outcome.figures[str(n)]["values"]) for n in method.figures)
    square = (a - POLE) ** 2
    assert row["mse"] == pytest.approx(square.mean())
    assert row["mse_1_100"] == pytest.approx(square[:100].mean())
    assert row["mse_101_200"] == pytest.approx(square[100:200].mean())
    assert row["mse_201_400"] == pytest.approx(square[200:].mean())
    assert row["final_P_median"] == P[-1]
    assert row["residual_variance"] == pytest.approx((e**2).mean())
    before = np.concatenate(((0.0,), a[:-1]))
    np.testing.assert_allclose(e, y[1:] - before * y[:-1], atol=1e-12)  # before the update


@pytest.mark.parametrize("method", [m for m in METHODS if m.figures], ids=lambda m: m.name)
def test_the_bands_are_what_the_law_itself_says(single, method):
    outcome, y = single
    estimate, variance, residuals = (outcome.figures[str(n)] for n in method.figures)
    np.testing.assert_allclose(np.square(estimate["sd"]), variance["values"])
    P = np.concatenate(((1.0,), variance["values"][:-1]))
    noise_variance = getattr(method.law, "forgetting", 1.0)
    np.testing.assert_allclose(np.square(residuals["sd"]), noise_variance + y[:-1] ** 2 * P)


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        ({"replications": 0}, "replications"),
        ({"replications": 2.0}, "replications"),
        ({"batch": 0}, "batch"),
        ({"seed": -1}, "seed"),
    ],
)
def test_a_setting_that_makes_no_sense_is_refused_by_name(settings, name):
    with pytest.raises(ValueError, match=f"^{name} must be"):
        Ozbek2021(**settings)


# -- the page --------------------------------------------------------------------------------------


@pytest.fixture
def page(outcome, tmp_path, monkeypatch):
    """The figure that is saved."""
    drawn = []

    def keep(figure, path):
        drawn.append(figure)
        return path

    monkeypatch.setattr(house, "save", keep)
    Ozbek2021(200, seed=5).draw(outcome, [tmp_path / "o.png"])
    return drawn[0]


def texts(figure):
    from matplotlib.text import Text

    return [each for each in figure.findobj(Text) if each.get_text() and each.get_visible()]


def test_the_page_has_the_numbers_of_the_paper_a_row_for_each_method(page):
    numbers = [int(panel.get_title(loc="left")) for panel in page.axes[:18]]
    assert numbers == [*range(1, 13), 13, 16, 18, 14, 15, 17]
    assert all(panel.get_title(loc="right") for panel in page.axes[:18])
    assert all(panel.get_xlabel() for panel in page.axes[15:18])
    assert all(panel.get_ylabel() for panel in page.axes[:18])


def test_every_method_is_drawn_on_the_same_scales(page):
    for column in range(3):
        panels = page.axes[column:18:3]
        assert len({panel.get_ylim() for panel in panels}) == 1
        assert {panel.get_xlim() for panel in panels} == {(0.0, 400.0)}
    assert page.axes[0].get_ylim() == (-1.5, 1.5)
    assert page.axes[1].get_yscale() == "log"


def test_the_page_shows_the_table_as_it_is_printed(page):
    shown = [text.get_text() for text in page.axes[18].texts]
    assert "Mean over 200 runs" in shown
    assert shown[-7] == "CKF"
    assert len([text for text in shown if text in EXPECTED]) == 7


def test_no_word_on_the_page_is_tiny_or_cut(page):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    renderer = FigureCanvasAgg(page).get_renderer()
    page.draw_without_rendering()  # puts the names of the axes in their places
    edge = page.bbox
    for text in texts(page):
        place = text.get_window_extent(renderer)
        assert text.get_fontsize() >= 7.5, text
        assert edge.x0 <= place.x0 < place.x1 <= edge.x1, text
        assert edge.y0 <= place.y0 < place.y1 <= edge.y1, text


def test_a_residual_beyond_the_usual_scale_is_on_the_page(outcome, monkeypatch):
    figures = {number: dict(figure) for number, figure in outcome.figures.items()}
    figures["17"]["values"] = [12.3, *figures["17"]["values"][1:]]
    drawn = []
    monkeypatch.setattr(house, "save", lambda figure, path: drawn.append(figure))
    strange = type(outcome)(outcome.replications, outcome.table, figures)
    ozbek2021_figure.draw_ozbek2021(strange, Ozbek2021.columns, 5, ["o.png"])
    assert drawn[0].axes[2].get_ylim() == drawn[0].axes[17].get_ylim() == (-15.0, 15.0)
