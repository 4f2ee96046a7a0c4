import math
from datetime import datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermoctl.app.live import numbers


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        (numbers.temperature(37.489), "37.49\u00a0°C"),
        (numbers.temperature(-0.001), "0.00\u00a0°C"),
        (numbers.difference(-0.009), "−9\u00a0mK"),
        (numbers.difference(0.1), "+100\u00a0mK"),
        (numbers.difference(0.101), "+0.10\u00a0K"),
        (numbers.difference(-12.5), "−12.50\u00a0K"),
        (numbers.difference(0.0), "0\u00a0mK"),
        (numbers.power(0.2314), "23.1\u00a0%"),
        (numbers.number(1234.5, 1), "1,234.5"),
        (numbers.age(0.42), "0.4\u00a0s"),
        (numbers.age(1e4), "167\u00a0min"),
        (numbers.age(1e6), "278\u00a0h"),
        (numbers.span(3600.0), "60\u00a0min"),
        (numbers.span(7200.0), "2\u00a0h"),
        (numbers.span(7 * 86_400.0), "7\u00a0d"),
        (numbers.quantity("limit_c", 65), "65.00\u00a0°C"),
        (numbers.quantity("late_s", 0.2), "0\u00a0s"),
        (numbers.quantity("count", 12), "12"),
        (numbers.quantity("why", "no reply"), "no reply"),
        (numbers.quantity("on", True), "True"),
    ],
)
def test_numbers_are_written_as_an_operator_reads_them(written: str, expected: str) -> None:
    assert written == expected


@pytest.mark.parametrize("value", [None, math.nan, math.inf, -math.inf, 1e300])
def test_what_is_no_number_is_a_dash_without_a_unit(value: float | None) -> None:
    for write in (numbers.temperature, numbers.difference, numbers.power, numbers.seconds):
        assert write(value) == numbers.UNKNOWN


@given(st.floats(-999.0, 999.0), st.integers(0, 4))
def test_decimals_never_change_with_the_value(value: float, decimals: int) -> None:
    written = numbers.number(value, decimals)
    assert len(written.partition(".")[2]) == decimals
    assert float(written.replace("−", "-")) == pytest.approx(value, abs=0.51 * 10.0**-decimals)


def test_wall_time_counts_from_the_zero_of_the_loop() -> None:
    zero = datetime(2026, 3, 1, 23, 59, 58)
    assert numbers.wall_time(zero, 3.0) == "00:00:01"
    assert numbers.wall_time(zero, math.nan) == numbers.UNKNOWN
    assert numbers.wall_time(zero, 1e300) == numbers.UNKNOWN


def test_words_of_a_log_wear_the_signs_of_the_screen() -> None:
    words = "expected at most 41.2 +-0.3 degC, got 50 degC"
    assert numbers.plain(numbers.sentence(words)) == ("expected at most 41.2 ± 0.3 °C, got 50 °C")
