import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermoctl.app.live.scale import RANGES_S, Scale, next_step, range_for, tick_for

temperatures = st.lists(st.floats(-40.0, 400.0), min_size=1, max_size=30)


@given(temperatures)
def test_an_axis_only_grows_and_holds_all_it_was_given(values: list[float]) -> None:
    scale = Scale()
    for value in values:
        before = scale.copy()
        scale.grow(value)
        assert scale.low <= before.low
        assert scale.high >= before.high
        assert scale.low - 1e-6 <= value <= scale.high + 1e-6


@given(temperatures)
def test_an_axis_has_a_step_of_the_series_1_2_5_and_few_labels(values: list[float]) -> None:
    scale = Scale()
    for value in values:
        scale.grow(value)
    mantissa = scale.step / 10.0 ** math.floor(math.log10(scale.step) + 1e-9)
    assert round(mantissa, 9) in (1.0, 2.0, 5.0)
    labels = scale.labels()
    assert len(labels) <= 6
    assert all(float(text.replace("−", "-")) == pytest.approx(at) for at, text in labels)
    assert all(scale.low - 1e-6 <= at <= scale.high + 1e-6 for at, _ in labels)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e9, -400.0])
def test_what_is_no_temperature_leaves_the_axis_alone(value: float) -> None:
    scale = Scale()
    scale.grow(value)
    assert not scale.known
    assert scale.labels() == []


def test_steps_follow_the_series() -> None:
    steps = [0.1]
    while steps[-1] < 100.0:
        steps.append(next_step(steps[-1]))
    assert steps == pytest.approx([0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100])


def test_the_range_is_the_shortest_that_holds_the_run() -> None:
    assert range_for(math.nan) == RANGES_S[0]
    assert [range_for(t_s) / 60.0 for t_s in (0, 120, 121, 3000, 3601)] == [2, 2, 5, 60, 120]
    assert range_for(1e12) == RANGES_S[-1]


def test_time_marks_are_never_more_than_asked_for() -> None:
    for range_s in RANGES_S:
        assert range_s / tick_for(range_s, 8) <= 8
