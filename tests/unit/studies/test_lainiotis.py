"""The selection study: how decisions are counted, laws of averaging, figures it must meet."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.estimation import Order
from thermoctl.studies import figure as house
from thermoctl.studies.papers import lainiotis
from thermoctl.studies.papers.lainiotis import SAMPLES, SPREAD, Lainiotis, Plant, cases, finding
from thermoctl.studies.papers.study import generator

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

RUNS = 8


@pytest.fixture(scope="module")
def outcomes():
    """Eight replications of every case, and an outcome after each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lainiotis, "BATCH", 1)
        return list(Lainiotis(RUNS).run())


@pytest.fixture(scope="module")
def rows(outcomes):
    return {row["case"]: row for row in outcomes[-1].table}


@pytest.fixture(scope="module")
def spread(outcomes):
    return {row["case"]: row for row in outcomes[-1].figures[SPREAD]["rows"]}


def test_every_case_holds_the_truth_among_its_hypotheses_and_has_a_name_of_its_own():
    assert all(case.plant.order in case.bank.candidates for case in cases())
    assert len({case.name for case in cases()}) == len(cases()) == 7
    for case in cases():
        assert case.bank.candidates[case.truth] == case.plant.order


@pytest.mark.parametrize(
    ("true", "rival", "expected"),
    [
        ([0.5, 0.94, 0.95, 0.2, 0.96], [0.5, 0.06, 0.05, 0.8, 0.04], (3, False, True)),
        ([0.5, 0.04, 0.95, 0.20], [0.5, 0.96, 0.05, 0.8], (3, True, False)),
        ([0.5, 0.6], [0.5, 0.4], (math.inf, False, True)),
        ([0.5, 0.03], [0.5, 0.97], (math.inf, True, False)),
        ([0.95], [0.05], (1, False, True)),
    ],
)
def test_a_run_decides_where_the_truth_first_has_95_percent(true, rival, expected):
    columns = np.array([rival, true]).T
    assert finding(columns, 1) == expected
    assert finding(columns[:, ::-1], 0) == expected


def test_a_plant_is_its_difference_equation_from_rest():
    rng = np.random.default_rng(4)
    u, v = rng.normal(size=(2, 50))
    y = Plant(Order(2, 1, 3), (-1.2, 0.5, 0.8), 0.3).outputs(u, v)
    past_y, past_u = [0.0, 0.0], [0.0, 0.0]
    for t in range(50):  # u[t] is u(t-1), so that u(t-3) is two before it
        past_u.append(u[t])
        expected = 1.2 * past_y[-1] - 0.5 * past_y[-2] + 0.8 * past_u[-3] + 0.3 * v[t]
        assert y[t] == pytest.approx(expected, rel=1e-12, abs=1e-12)
        past_y.append(expected)


def test_fewer_replications_are_the_beginning_of_more_in_batches_of_any_size(outcomes):
    assert [outcome.replications for outcome in outcomes] == list(range(1, RUNS + 1))
    *_, three = Lainiotis(3).run()
    assert three.replications == 3
    assert three.table == outcomes[2].table
    assert three.figures == outcomes[2].figures


def test_batches_grow_with_what_is_finished(monkeypatch):
    tiny = [replace(cases()[0], plant=replace(cases()[0].plant, order=Order(1, 0)))]
    monkeypatch.setattr(lainiotis, "cases", lambda: tiny)
    monkeypatch.setattr(lainiotis.Case, "posteriors", lambda self, rng: np.full((SAMPLES, 4), 0.25))
    finished = [outcome.replications for outcome in Lainiotis(1203).run()]
    steps = np.diff(finished)
    assert finished[:3] == [5, 10, 15]
    assert finished[-1] == 1203
    assert (steps[:-1] >= np.maximum(5, np.array(finished[:-2]) // 50)).all()
    assert steps.max() < 30


def test_a_case_does_not_depend_on_the_cases_beside_it(outcomes, monkeypatch):
    monkeypatch.setattr(lainiotis, "cases", lambda: cases()[4:5])
    *_, alone = Lainiotis(2).run()
    assert list(alone.table) == [outcomes[1].table[4]]


def test_rows_and_figures_have_their_keys_and_can_be_written_as_json(outcomes):
    for outcome in (outcomes[0], outcomes[-1]):
        assert [set(row) for row in outcome.table] == [
            {"case", "samples_to_95_median", "right"}
        ] * 7
        assert list(outcome.figures) == [*(row["case"] for row in outcome.table), SPREAD]
        for part in (outcome.table, outcome.figures):
            assert json.loads(json.dumps(part, allow_nan=False)) == part


def test_probabilities_are_means_over_the_runs_and_quartiles_of_the_truth(outcomes):
    case = cases()[-1]
    runs = np.array([case.posteriors(generator(1, replication)) for replication in range(RUNS)])
    figure = outcomes[-1].figures[case.name]
    values = np.array(list(figure["values"].values()))
    assert list(figure["values"]).index(figure["true"]) == case.truth
    assert figure["true"] == "2,1,3"
    np.testing.assert_allclose(values.T, runs.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(values.sum(axis=0), 1.0, rtol=1e-12)
    ordered = np.sort(runs[:, :, case.truth], axis=0)
    # Of eight runs the quartiles lie three quarters of the way from the second to the third, and
    # as far from the seventh to the sixth.
    lower, upper = (0.25 * ordered[i] + 0.75 * ordered[j] for i, j in ((1, 2), (6, 5)))
    np.testing.assert_allclose(figure["true_lower_quartile"], lower, rtol=1e-12)
    np.testing.assert_allclose(figure["true_upper_quartile"], upper, rtol=1e-12)


def test_the_median_is_that_of_the_runs_and_none_where_half_never_decide(rows, spread):
    for case, row in rows.items():
        samples = [math.inf if each is None else each for each in spread[case]["samples"]]
        assert len(samples) == RUNS
        assert spread[case]["never"] == pytest.approx(samples.count(math.inf) / RUNS)
        median = sorted(samples)[RUNS // 2 - 1 : RUNS // 2 + 1]
        expected = sum(median) / 2
        assert row["samples_to_95_median"] == (expected if math.isfinite(expected) else None)


def test_a_bank_told_the_noise_finds_order_and_delay_within_tens_of_samples(rows):
    assert 16 <= rows["AR(2), order 1 to 4"]["samples_to_95_median"] <= 40
    assert 5 <= rows["ARX, delay 1 to 6, noise 0.3"]["samples_to_95_median"] <= 12
    assert 14 <= rows["ARX, delay 1 to 6, noise 1"]["samples_to_95_median"] <= 30
    assert 25 <= rows["ARX, n, m and delay, noise 0.3"]["samples_to_95_median"] <= 70
    for case, row in rows.items():
        assert row["right"] >= 0.85 or case == "AR(2), R ten times too small"


def test_too_large_a_noise_costs_time_and_too_small_a_one_the_answer(rows, spread):
    plain, slow, wrong = list(rows)[:3]
    assert rows[slow]["samples_to_95_median"] > 3.0 * rows[plain]["samples_to_95_median"]
    assert rows[slow]["right"] == 1.0
    assert rows[wrong]["right"] < 0.7
    assert spread[wrong]["misled"] > 0.3 > spread[slow]["misled"]


def test_a_narrow_prior_knows_the_order_and_never_says_so(rows, spread):
    assert rows["AR(2), P0 = 1"]["samples_to_95_median"] is None
    assert rows["AR(2), P0 = 1"]["right"] >= 0.85
    assert spread["AR(2), P0 = 1"]["never"] > 0.85


def test_95_percent_ten_samples_running_are_worth_more_than_the_first():
    case = cases()[0]
    first, tenth = [], []
    for replication in range(100):
        reached = case.posteriors(generator(1, replication)) >= 0.95
        kept = np.array([reached[t : t + 10].all(axis=0) for t in range(SAMPLES - 9)])
        for found, above in ((first, reached), (tenth, kept)):
            found.append(int(above[above.any(axis=1).argmax()].argmax()))
    assert first.count(0) + first.count(case.truth) == 100  # order 1 or 2, none of them larger
    assert first.count(0) >= 10
    assert tenth.count(case.truth) >= 98


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("replications", value) for value in (0, -1, 2.0, True, "10", None)),
        *(("seed", value) for value in (-1, 0.5, False, None)),
    ],
)
def test_the_study_names_the_setting_it_refuses(name, value):
    with pytest.raises(ValueError, match=f"^{name} must be an integer of at least"):
        Lainiotis(**{name: value})


@pytest.mark.parametrize("count", [1, RUNS])
def test_the_page_is_drawn_from_any_number_of_runs(outcomes, count, tmp_path, monkeypatch):
    monkeypatch.setitem(house._STYLE, "savefig.dpi", 40.0)
    files = [tmp_path / "page.png", tmp_path / "page.svg"]
    assert Lainiotis(count).draw(outcomes[count - 1], files) == files
    assert files[0].read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in files[1].read_bytes()


def test_the_page_shows_every_case_and_says_what_became_of_it(outcomes, monkeypatch):
    drawn = []
    monkeypatch.setattr(house, "save", lambda figure, path: drawn.append(figure) or path)
    Lainiotis(RUNS).draw(outcomes[-1], ["page.png"])
    *panels, last = drawn[0].axes
    assert [row["case"] for row in outcomes[-1].table] == [
        next(text.get_text() for text in panel.texts if "AR" in text.get_text()) for panel in panels
    ]
    for row, panel in zip(outcomes[-1].table, panels, strict=True):
        figure, right = outcomes[-1].figures[row["case"]], f"right in {100 * row['right']:.0f} %"
        assert panel.get_title(loc="right").endswith(right)
        assert figure["true"] in {text.get_text() for text in panel.texts}
        lines = [list(line.get_ydata()) for line in panel.lines]
        assert all(values in lines for values in figure["values"].values())
    assert [tick.get_text() for tick in last.get_yticklabels()] == list("abcdefg")
    assert "100 % never" in {text.get_text() for text in last.texts}
