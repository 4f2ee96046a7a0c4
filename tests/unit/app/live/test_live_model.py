import math
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from thermoctl.app.live.model import FEWEST, Facts, LiveModel, whiteness
from thermoctl.signals import Cycle, Event, Mode, Quality

MakeCycle = Callable[..., Cycle]


def test_white_noise_is_called_white_and_the_limit_is_two_sigma() -> None:
    noise = np.random.default_rng(5).normal(size=(400, 300))
    judged = [whiteness(row) for row in noise]
    white = sum(each is not None and each.verdict == "white" for each in judged)
    assert 0.93 <= white / 400 <= 0.98  # 95.4 % lie within two standard deviations
    assert judged[0] is not None
    assert judged[0].limit == pytest.approx(2.0 / math.sqrt(299))


@pytest.mark.parametrize("lean", [0.6, -0.6])
def test_correlated_innovations_are_not_white(lean: float) -> None:
    e = np.random.default_rng(6).normal(size=300)
    for k in range(1, e.size):
        e[k] += lean * e[k - 1]
    judged = whiteness(e)
    assert judged is not None
    assert judged.verdict == "not white"
    assert judged.autocorrelation == pytest.approx(lean, abs=0.15)


def test_innovations_that_keep_their_sign_are_not_white() -> None:
    judged = whiteness(1.0 + 0.1 * np.random.default_rng(7).normal(size=300))
    assert judged is not None
    assert judged.verdict == "not white"


def test_a_gap_breaks_a_pair_and_too_few_pairs_are_not_judged() -> None:
    e = np.ones(2 * FEWEST)
    e[::2] = math.nan
    assert whiteness(e) is None
    assert whiteness(np.ones(FEWEST)) is None
    assert whiteness(np.zeros(300)) is None
    assert whiteness(np.array([])) is None


def test_data_are_stale_after_three_periods_without_a_good_sample(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    model.feed(make_cycle(10.0))
    for t_s in (11.0, 12.0, 13.0):
        model.feed(make_cycle(t_s, quality=Quality.MISSING))
    assert not model.view(13.0).stale
    assert math.isnan(model.view(13.0).temperature_c)
    assert model.view(13.1).stale
    model.feed(make_cycle(14.0))
    assert not model.view(14.0).stale


def test_a_loop_that_never_had_a_good_sample_is_stale(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    assert not model.view(0.0).stale
    model.feed(make_cycle(0.0, quality=Quality.OPEN))
    assert model.view(0.0).stale
    assert math.isnan(model.view(0.0).age_s)


def test_an_old_value_is_not_shown_as_the_value_now(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    model.feed(make_cycle(0.0, 37.0, quality=Quality.STALE))
    assert math.isnan(model.view(0.0).temperature_c)


def test_cycles_of_another_loop_are_passed_over(model: LiveModel, make_cycle: MakeCycle) -> None:
    model.feed(replace(make_cycle(0.0), loop="another"))
    assert model.view(0.0).step is None


def test_a_view_does_not_change_when_the_run_goes_on(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    model.feed(make_cycle(0.0, events=(Event(0.0, "loop.started"),)))
    before = model.view(0.0)
    model.feed(make_cycle(1.0, 80.0, events=(Event(1.0, "sensor.spike"),)))
    assert len(before.events) == 1
    assert before.scale.high < 40.0
    assert before.trend.table.shape[1] == 1


def test_the_range_grows_in_steps_and_never_shrinks(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    model.feed(make_cycle(0.0))
    ranges = [model.view(t_s).range_s for t_s in (0.0, 119.0, 121.0, 100.0, 4000.0)]
    assert ranges == [120.0, 120.0, 300.0, 300.0, 7200.0]


def test_the_deviation_is_the_standard_deviation_from_the_set_point(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    for k in range(100):
        model.feed(make_cycle(float(k), 37.5 + (0.02 if k % 2 else -0.02)))
    recent = model.view(99.0).recent
    assert recent.deviation_sd_k == pytest.approx(0.02)
    assert recent.deviation_max_k == pytest.approx(0.02)


def test_memory_is_bounded_however_many_events_come(
    model: LiveModel, make_cycle: MakeCycle
) -> None:
    for k in range(1000):
        model.feed(make_cycle(float(k), events=(Event(float(k), "cycle.late"),)))
    assert len(model.view(999.0).events) == 200


@pytest.mark.parametrize(
    ("period_s", "low_c", "high_c", "named"),
    [(0.0, 5.0, 60.0, "period_s"), (math.nan, 5.0, 60.0, "period_s"), (1.0, 60.0, 5.0, "low")],
)
def test_facts_that_make_no_sense_are_refused(
    period_s: float, low_c: float, high_c: float, named: str
) -> None:
    with pytest.raises(ValueError, match=named):
        Facts("tank", period_s, low_c, high_c, datetime(2026, 3, 1))


@pytest.mark.parametrize("mode", [Mode.OFF, Mode.MANUAL])
def test_innovations_of_a_law_that_does_not_steer_are_not_judged(
    model: LiveModel, make_cycle: MakeCycle, mode: Mode
) -> None:
    for k in range(100):
        model.feed(make_cycle(float(k), mode=mode))
    recent = model.view(99.0).recent
    assert recent.whiteness is None
    assert np.isfinite(recent.innovations).all()


def test_thirty_steps_of_the_set_point_leave_the_other_events_on_the_screen(
    model: LiveModel,
) -> None:
    model.note(Event(0.0, "loop.started", {}))
    for k in range(30):
        fields = {"before_c": 37.0 + k, "after_c": 38.0 + k}
        model.note(Event(1.0 + k, "setpoint.changed", fields))
    names = [each.name for each in model.view(40.0).events]
    assert names == ["loop.started", "setpoint.changed"]
