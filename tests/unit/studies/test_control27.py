"""The closed loop of O21 (27): the same as the controller's own, and figures that must come out."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from thermoctl.app.commands.reproduce import reproduce
from thermoctl.control.minimum_variance import SelfTuningMinimumVariance
from thermoctl.estimation import Identifier
from thermoctl.model.arx import KnownGain
from thermoctl.ports import Situation
from thermoctl.studies import figure as house
from thermoctl.studies.papers.control27 import SCORED_FROM, Control27, scores_of
from thermoctl.studies.papers.control27_loop import METHODS, NOISE_K, SCENARIOS, Loop, close_loop
from thermoctl.studies.papers.study import generator

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

KEYS = ["scenario", "method", "mse", "bias", "input_travel", "largest", "mse_a"]
LAWS = {method.name: method.law for method in METHODS}


def last(study):
    *_, outcome = study.run()
    return outcome


@pytest.fixture(scope="module")
def outcome():
    """What 60 replications of seed 5 find."""
    return last(Control27(60, seed=5))


@pytest.fixture(scope="module")
def rows(outcome):
    return {(row["scenario"], row["method"]): row for row in outcome.table}


def test_the_table_has_every_method_in_every_scenario_under_the_same_keys(outcome):
    assert [list(row) for row in outcome.table] == [KEYS] * len(SCENARIOS) * len(METHODS)
    assert [column.key for column in Control27.columns] == KEYS
    assert json.loads(json.dumps(outcome.table, allow_nan=False)) == list(outcome.table)


@pytest.mark.parametrize("method", [m for m in METHODS if m.law is not None], ids=lambda m: m.name)
@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda s: s.name)
def test_many_replications_at_once_are_the_controller_of_the_daemon_in_each(scenario, method):
    noise = NOISE_K * np.stack([generator(3, r).normal(size=400) for r in range(2)], axis=1)
    loop = close_loop(method.law, scenario, noise)
    identifier = Identifier(KnownGain(1.0), method.law)
    law = SelfTuningMinimumVariance(identifier.structure)
    belief, y, u = identifier.start(), scenario.first, np.nan
    for t in range(60):
        belief = identifier.update(belief, y, u)
        past = (belief.estimate, belief.y_past_c, belief.u_past)
        here = Situation(float(t), 1.0, y, scenario.setpoint[t], u, *past)
        u = law.decide(law.start(), here)[1]
        y = scenario.pole[t] * y + u + noise[t, 1]
        assert (loop.input[t, 1], loop.output[t, 1]) == pytest.approx((u, y), rel=1e-9)


def test_who_knows_a_is_left_with_the_noise(rows):
    for scenario in SCENARIOS:
        row = rows[scenario.name, "a known"]
        assert row["mse"] == pytest.approx(0.01, rel=0.03)
        assert row["mse_a"] is None


@pytest.mark.parametrize("scenario", ["sine", "drift"])
def test_while_a_moves_slowly_the_corrected_filter_stays_near_the_noise(rows, scenario):
    assert 0.0135 < rows[scenario, "CKF"]["mse"] < 0.02
    assert 0.4 < rows[scenario, "NKF, R1 = 0"]["mse"] < 0.96
    assert rows[scenario, "NKF, R1 = 1e-6"]["mse"] < rows[scenario, "CKF"]["mse"]


def test_a_filter_that_expects_drift_is_as_good_as_the_corrected_one_at_jumps(rows):
    drifting, corrected = (rows["steps", name]["mse"] for name in ("NKF, R1 = 1e-6", "CKF"))
    assert drifting == pytest.approx(corrected, rel=0.1)
    jumps = 2 * (0.06 * 37.5) ** 2 / (401 - SCORED_FROM)  # what no estimator can foresee
    assert corrected > jumps + 0.01


def test_while_a_stays_whoever_corrects_or_forgets_pays_a_little(rows):
    plain = rows["constant", "NKF, R1 = 0"]["mse"]
    for name in ("CKF", "NKF, R1 = 1e-6", "RLS 0.9", "variable forgetting, Sigma0 0.1"):
        assert plain < rows["constant", name]["mse"] < 1.25 * plain


def test_without_excitation_the_corrected_filter_forgets_and_a_new_set_point_shows_it(rows):
    corrected, plain = rows["rest", "CKF"], rows["rest", "NKF, R1 = 0"]
    assert corrected["mse_a"] > 100 * plain["mse_a"]
    assert corrected["largest"] > 1.0
    assert plain["largest"] < 0.5
    assert corrected["largest"] < rows["rest", "RLS 0.9"]["largest"]


def test_at_rest_the_variance_of_the_corrected_filter_grows_until_the_noise_teaches_it():
    (rest,) = (scenario for scenario in SCENARIOS if scenario.name == "rest")
    noise = NOISE_K * np.stack([generator(7, r).normal(size=400) for r in range(100)], axis=1)
    corrected, plain = (
        np.median(close_loop(LAWS[name], rest, noise).P, axis=1) for name in ("CKF", "NKF, R1 = 0")
    )
    assert corrected[19] < 1e-3
    assert 0.02 < corrected[299] < 0.2
    assert plain[299] < plain[19] < 1e-4
    assert corrected[310] < 1e-3  # the step of the set point is excitation


def test_fewer_replications_are_the_beginning_of_more_in_batches_of_any_size():
    outcomes = list(Control27(5, seed=2, batch=2).run())
    assert [each.replications for each in outcomes] == [2, 4, 5]
    assert outcomes[0].table == last(Control27(2, seed=2)).table
    assert outcomes[-1].table == last(Control27(5, seed=2)).table
    assert outcomes[-1].figures == outcomes[0].figures
    assert outcomes[-1].table != last(Control27(5, seed=3)).table


def test_every_scenario_has_its_three_figures_of_one_length(outcome):
    kinds = ("parameter", "output", "input")
    assert list(outcome.figures) == [f"{each.name}, {kind}" for each in SCENARIOS for kind in kinds]
    for drawn in outcome.figures.values():
        lines = [drawn["t"], *drawn["values"].values(), *drawn.get("sd", {}).values()]
        lines += [drawn[key] for key in ("true", "reference") if key in drawn]
        assert {len(line) for line in lines} == {381}
    json.dumps(outcome.figures, allow_nan=False)


def test_scores_are_means_over_the_samples_that_count():
    scenario, samples = SCENARIOS[0], len(SCENARIOS[0].pole)
    off = np.where(np.arange(1, samples + 1) < SCORED_FROM, 1e3, 2.0)
    loop = Loop(
        (scenario.setpoint + off)[:, None],
        scenario.setpoint,
        np.where(np.arange(samples) % 2, -0.5, 0.5)[:, None],
        (scenario.pole + 0.1 * off)[:, None],
        np.zeros((samples, 1)),
    )
    assert scores_of(loop, scenario)[0] == pytest.approx([4.0, 2.0, 1.0, 2.0, 0.04])


def test_figures_and_table_of_one_run_are_the_same_numbers():
    single = last(Control27(1, seed=4))
    rows = {(row["scenario"], row["method"]): row for row in single.table}
    for scenario in SCENARIOS:
        drawn = single.figures[f"{scenario.name}, output"]
        deviation = np.array(drawn["values"]["CKF"]) - np.array(drawn["reference"])
        row = rows[scenario.name, "CKF"]
        assert np.mean(deviation**2) == pytest.approx(row["mse"], rel=1e-12)
        assert np.abs(deviation).max() == row["largest"]
        u = single.figures[f"{scenario.name}, input"]["values"]["CKF"]
        assert np.abs(np.diff(u)).mean() == pytest.approx(row["input_travel"], rel=1e-12)
        parameter = single.figures[f"{scenario.name}, parameter"]
        error = np.array(parameter["values"]["CKF"]) - np.array(parameter["true"])
        assert np.mean(error**2) == pytest.approx(row["mse_a"], rel=1e-12)


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        ({"replications": 0}, "replications"),
        ({"batch": 0}, "batch"),
        ({"seed": -1}, "seed"),
        ({"replications": 1.5}, "replications"),
    ],
)
def test_a_setting_that_makes_no_sense_is_refused_by_name(settings, name):
    with pytest.raises(ValueError, match=name):
        Control27(**settings)


@pytest.fixture
def page(outcome, tmp_path, monkeypatch):
    """The figure that is saved."""
    drawn = []

    def keep(figure, path):
        drawn.append(figure)
        return path

    monkeypatch.setattr(house, "save", keep)
    Control27(60, seed=5).draw(outcome, [tmp_path / "page.png"])
    return drawn[0]


def test_the_page_shows_every_scenario_on_one_scale_and_all_deviations(outcome, page):
    panels = page.axes[: 3 * len(SCENARIOS)]
    assert {panel.get_ylim() for panel in panels[1::3]} == {(-3.0, 3.0)}
    assert all(panel.get_ylabel() and panel.get_title(loc="right") for panel in panels)
    shown = [text.get_text() for text in page.axes[-1].texts]
    assert [text for text in shown if text in LAWS] == [method.name for method in METHODS]
    for row in outcome.table:
        assert f"{row['mse']:.4f}" in shown
    assert any("seed 5" in text.get_text() for text in page.texts)


def test_no_word_on_the_page_is_tiny_or_beyond_its_edge(page):
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    renderer = FigureCanvasAgg(page).get_renderer()
    page.draw_without_rendering()  # puts the names of the axes in their places
    for text in page.findobj(Text):
        if text.get_text() and text.get_visible():
            place = text.get_window_extent(renderer)
            assert text.get_fontsize() >= 7.5, text
            assert page.bbox.x0 <= place.x0 < place.x1 <= page.bbox.x1, text
            assert page.bbox.y0 <= place.y0 < place.y1 <= page.bbox.y1, text


def test_the_command_of_the_paper_runs_it_when_asked_for_the_loop(tmp_path):
    arguments = ["ozbek2021", "--control", "--replications", "2", "--json", "--out", str(tmp_path)]
    result = CliRunner().invoke(reproduce, arguments)
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)
    assert content["table"] == last(Control27(2, seed=1)).table
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".png", ".svg"]
