import builtins
import errno
import math
import os
import re

import numpy as np
import pytest

from thermoctl.errors import Unavailable
from thermoctl.model.arx import Arx
from thermoctl.studies import figure as house
from thermoctl.studies.experiment import Run, measure
from thermoctl.studies.experiment_figure import draw_experiment
from thermoctl.studies.laws import parse_law
from thermoctl.studies.record import Columns, Record
from thermoctl.studies.replay import replay
from thermoctl.studies.replay_figure import draw_replay

pytestmark = pytest.mark.slow  # together more than the quick subset can afford

PNG = b"\x89PNG\r\n"


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Fewer dots: these tests do not look at the picture."""
    monkeypatch.setitem(house._STYLE, "savefig.dpi", 40.0)


def made_record(samples=300, u=None):
    rng = np.random.default_rng(4)
    u = rng.choice((0.0, 1.0), samples) if u is None else u
    y = np.zeros(samples)
    for t in range(1, samples):
        y[t] = 0.95 * y[t - 1] + u[t - 1] + 0.1 * rng.standard_normal()
    return Record("made", np.arange(float(samples)), u, y, Columns("y", "u", "t"))


def made_run(samples=700, a=0.999, a_sd=1e-4):
    t_s = np.arange(float(samples))
    true_c = np.minimum(25.0 + 0.036 * t_s, 37.5 + 0.3 * np.sin(t_s / 10.0))
    same = np.ones(samples)
    return Run(t_s, true_c, true_c, 0.5 * same, 37.5 * same, a * same, a_sd * same)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_replay_is_drawn_as_png_and_svg(tmp_path, count):
    laws = [parse_law(text) for text in ("ckf", "nkf", "rls:0.98", "vff", "rls")[:count]]
    result = replay(made_record(), Arx(1, 2, 1), laws)
    paths = [tmp_path / "new" / "r.png", tmp_path / "new" / "r.svg"]
    assert draw_replay(result, paths) == paths
    assert paths[0].read_bytes().startswith(PNG)
    assert b"<svg" in paths[1].read_bytes()


def test_a_replay_with_an_input_that_stands_still_can_be_drawn(tmp_path):
    result = replay(made_record(u=np.ones(300)), Arx(1, 1, 1), [parse_law("ckf")])
    draw_replay(result, [tmp_path / "r.png"])
    assert (tmp_path / "r.png").read_bytes().startswith(PNG)


@pytest.mark.parametrize("law", ["vff:1,forgetting_min=0.01", "vff:1,forgetting_min=0.5"])
@pytest.mark.parametrize("second", [False, True])
def test_a_replay_of_a_law_that_ran_away_can_be_drawn(tmp_path, law, second):
    u = np.where(np.arange(3000) < 100, np.arange(3000) % 2, 1.0)
    laws = [parse_law("nkf"), parse_law(law)]
    laws = laws if second else laws[::-1]
    result = replay(made_record(3000, u), Arx(2, 3, 1), laws)
    assert not result.scores[second].r2 > 0.0
    draw_replay(result, [tmp_path / "r.png"])


@pytest.fixture
def panels(monkeypatch):
    """Every figure that is saved, with its words as words."""
    drawn = []

    def keep(figure, path):
        drawn.append(figure)
        return path

    monkeypatch.setattr(house, "save", keep)
    return drawn


def words(panel):
    titles = [panel.get_title(loc=place) for place in ("left", "center", "right")]
    return " ".join([*titles, *(text.get_text() for text in panel.texts)])


def test_a_law_that_gave_up_is_drawn_up_to_there_and_says_so(tmp_path, panels):
    u = np.where(np.arange(3000) < 100, np.arange(3000) % 2, 1.0)
    laws = [parse_law("vff:1,forgetting_min=0.5"), parse_law("nkf")]
    result = replay(made_record(3000, u), Arx(2, 3, 1), laws)
    draw_replay(result, [tmp_path / "r.png"])
    (figure,) = panels
    for panel in figure.axes[2:8]:
        assert "gave up here" in words(panel)
        assert max(map(abs, panel.get_ylim())) < 100.0
        end = result.traces[0].gave_up / house.time_unit(3000.0)[0]
        lines = [line for line in panel.lines if line.get_color() == house.BELIEF]
        assert all(np.nanmax(line.get_xdata()) <= end for line in lines)
    assert "gave up here" not in words(figure.axes[8])


def test_a_band_wider_than_the_panel_leaves_the_estimate_visible_and_is_told(tmp_path, panels):
    rng = np.random.default_rng(8)
    u = np.where(np.arange(3000) < 1500, 0.0, rng.choice((0.0, 1.0), 3000))
    result = replay(made_record(3000, u), Arx(1, 2, 1), [parse_law("nkf")])
    draw_replay(result, [tmp_path / "r.png"])
    panel, trace = panels[0].axes[4], result.traces[0]
    low, high = panel.get_ylim()
    late = trace.index >= result.conditions.scored_from
    moved = np.ptp(trace.theta[late, 2])
    assert moved < high - low < 10.0 * moved < np.median(trace.theta_sd[:, 2])
    told = re.search(r"band leaves the panel for (\d+) % of the record", words(panel))
    assert int(told[1]) == pytest.approx(50, abs=5)


def test_a_run_too_short_to_judge_says_so_in_its_figure(tmp_path, panels):
    run = made_run(samples=3)
    draw_experiment(run, measure(run), "title", [tmp_path / "e.png"])
    assert "too short: set point not reached" in words(panels[0].axes[0])
    assert "too short to judge regulation" in words(panels[0].axes[1])


def test_an_experiment_is_drawn_as_png_and_svg(tmp_path):
    run = made_run()
    paths = [tmp_path / "e.png", tmp_path / "e.svg"]
    draw_experiment(run, measure(run), "title", paths)
    assert paths[0].read_bytes().startswith(PNG)
    assert b"<svg" in paths[1].read_bytes()


@pytest.mark.parametrize(
    "run",
    [
        made_run(a=math.nan, a_sd=math.nan),
        made_run(samples=3),
        made_run(a_sd=0.0),
        Run(*[np.arange(5.0)] * 2, np.full(5, math.nan), *[np.arange(5.0) / 5] * 4),
    ],
    ids=["no estimate", "three cycles", "no spread", "no truth"],
)
def test_an_experiment_that_shows_little_can_still_be_drawn(tmp_path, run):
    draw_experiment(run, measure(run), "title", [tmp_path / "e.png"])
    assert (tmp_path / "e.png").read_bytes().startswith(PNG)


def test_the_same_run_gives_the_same_file(tmp_path):
    run = made_run()
    for name in ("one", "two"):
        draw_experiment(run, measure(run), "title", [tmp_path / f"{name}.svg"])
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()


def test_drawing_leaves_the_style_of_others_alone(tmp_path, monkeypatch):
    import matplotlib

    monkeypatch.setitem(matplotlib.rcParams, "font.size", 11.0)
    run = made_run()
    draw_experiment(run, measure(run), "title", [tmp_path / "e.png"])
    assert matplotlib.rcParams["font.size"] == 11.0


def test_a_missing_extra_says_what_to_install(monkeypatch):
    real = builtins.__import__

    def without_matplotlib(name, *rest, **named):
        if name.partition(".")[0] == "matplotlib":
            raise ImportError(name)
        return real(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", without_matplotlib)
    with pytest.raises(Unavailable, match=r"pip install thermoctl\[plot\]"):
        house.require_matplotlib()


def test_only_png_and_svg_are_written(tmp_path):
    run = made_run()
    with pytest.raises(ValueError, match=r"\.png or \.svg, got 'e\.pdf'"):
        draw_experiment(run, measure(run), "title", [tmp_path / "e.pdf"])


def test_a_disk_that_fills_up_is_told_with_the_file_and_leaves_no_half_of_it(tmp_path):
    class Torn:
        def savefig(self, path, **keys):
            path.write_bytes(b"\x89PNG")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "e.png"
    with pytest.raises(OSError, match="No space left") as told:
        house.save(Torn(), path)
    assert told.value.filename == str(path)
    assert not path.exists()


def test_a_thinned_line_keeps_its_peaks_and_its_holes():
    x = np.arange(100_000.0)
    y = np.sin(x / 500.0)
    y[31_415], y[27_182] = 9.0, -9.0
    y[50_000:50_400] = math.nan
    thin_x, thin_y = house.envelope(x, y)
    assert len(thin_x) <= house.POINTS_PER_PANEL + 3
    assert np.all(np.diff(thin_x) > 0)
    assert (np.nanmax(thin_y), np.nanmin(thin_y)) == (9.0, -9.0)
    inside = (thin_x >= 50_000) & (thin_x < 50_400)
    assert np.isnan(thin_y[inside]).any()


def test_a_short_line_is_drawn_as_it_is():
    x, y = np.arange(10.0), np.arange(10.0)
    assert house.envelope(x, y) == (x, y)


def test_a_line_is_broken_where_time_leaps():
    x, y = house.broken(np.array([0.0, 1.0, 5.0, 6.0]), np.arange(4.0), 1.5)
    np.testing.assert_equal(x, [0.0, 1.0, math.nan, 5.0, 6.0])
    np.testing.assert_equal(y, [0.0, 1.0, math.nan, 2.0, 3.0])


def test_labels_are_moved_apart_in_their_order():
    places = [1.0, 0.0, 1.05, 1.1]
    moved = house.spread_out(places, 0.5)
    assert np.argsort(moved).tolist() == np.argsort(places).tolist()
    assert np.diff(np.sort(moved)).min() >= 0.5 - 1e-12


def test_labels_that_crowd_at_the_foot_of_a_panel_stay_above_it():
    assert house.spread_out([0.04] * 4, 0.12, low=0.0) == pytest.approx([0.0, 0.12, 0.24, 0.36])
    assert house.spread_out([0.9, 0.8], 0.01, low=0.0) == [0.9, 0.8]


@pytest.mark.parametrize(
    ("duration_s", "unit"),
    [(100, (1.0, "s")), (1800, (60.0, "min")), (36_000, (3600.0, "h")), (2e6, (86400.0, "d"))],
)
def test_a_time_axis_is_counted_in_the_unit_that_reads_best(duration_s, unit):
    assert house.time_unit(duration_s) == unit
