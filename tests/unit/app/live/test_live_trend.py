import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.app.live import trend
from thermoctl.app.live.trend import TrendRecorder

UNKNOWN = (math.nan,) * 7


def record(recorder: TrendRecorder, t_s: float, temperature_c: float, power: float = 0.0) -> None:
    recorder.add(t_s, (temperature_c, 0.0, power), UNKNOWN)


@settings(max_examples=50)
@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=100), st.integers(1, 40))
def test_no_extreme_and_no_power_is_lost_however_long_the_run(
    values: list[float], count: int
) -> None:
    recorder = TrendRecorder(period_s=1.0, capacity=8)
    for k, value in enumerate(values):
        record(recorder, float(k), value, value / 100.0)
    now_s = float(len(values) - 1)
    table = recorder.trend().columns(now_s, (now_s + 2.0) / count + 8.0, 2 * count)
    assert np.nanmax(table[trend.TEMPERATURE_HIGH]) == max(values)
    assert np.nanmin(table[trend.TEMPERATURE_LOW]) == min(values)
    whole = recorder.trend().table
    assert whole[trend.POWER_SUM].sum() == pytest.approx(sum(values) / 100.0)
    assert whole[trend.POWER_COUNT].sum() == len(values)
    assert whole.shape[1] <= 8


def test_a_short_run_is_shown_sample_by_sample() -> None:
    recorder = TrendRecorder(period_s=1.0)
    for k in range(10):
        record(recorder, float(k), 20.0 + k)
    table = recorder.trend().columns(9.0, 1.0, 20)
    shown = table[trend.TEMPERATURE_HIGH]
    assert shown[~np.isnan(shown)].tolist() == [20.0 + k for k in range(10)]


def test_a_gap_in_time_stays_a_gap() -> None:
    recorder = TrendRecorder(period_s=1.0)
    for t_s in (0.0, 1.0, 5.0, 6.0):
        record(recorder, t_s, 20.0)
    row = recorder.trend().table[trend.TEMPERATURE_LOW]
    assert np.isnan(row).tolist() == [False, False, True, True, True, False, False]


def test_samples_that_jitter_leave_no_hole() -> None:
    recorder = TrendRecorder(period_s=1.0)
    for k in range(50):
        record(recorder, k + (0.3 if k % 2 else -0.15 * (k > 0)), 20.0)
    assert not np.isnan(recorder.trend().table[trend.TEMPERATURE_LOW]).any()


def test_a_trend_does_not_change_when_more_is_recorded() -> None:
    recorder = TrendRecorder(period_s=1.0)
    record(recorder, 0.0, 20.0)
    before = recorder.trend()
    record(recorder, 0.2, 99.0)
    record(recorder, 7.0, 99.0)
    assert before.table[trend.TEMPERATURE_HIGH].tolist() == [20.0]


def test_columns_stand_still_in_time_while_the_run_goes_on() -> None:
    recorder = TrendRecorder(period_s=1.0)
    shown = {}
    for k in range(200):
        record(recorder, float(k), math.sin(k))
        now = recorder.trend()
        first = now.first_column(float(k), 3.0, 20)
        assert first % 2 == 0
        table = now.columns(float(k), 3.0, 20)[trend.TEMPERATURE_HIGH]
        for column, value in zip(range(first, first + 17), table[:17], strict=True):
            if not math.isnan(value):
                assert shown.setdefault(column, value) == value


def test_time_that_runs_backwards_or_is_no_number_is_not_taken() -> None:
    recorder = TrendRecorder(period_s=1.0)
    record(recorder, 5.0, 20.0)
    record(recorder, 6.0, 20.0)
    for t_s in (2.0, math.nan, math.inf):
        record(recorder, t_s, 99.0)
    assert np.nanmax(recorder.trend().table[trend.TEMPERATURE_HIGH]) == 20.0


@pytest.mark.parametrize("period_s", [0.0, -1.0, math.nan])
def test_a_period_that_is_not_positive_is_refused(period_s: float) -> None:
    with pytest.raises(ValueError, match="period_s"):
        TrendRecorder(period_s)
