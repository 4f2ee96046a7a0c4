"""Numbers in the words that are told of a plant."""

from __future__ import annotations

import math

import pytest

from thermoctl.insight.wording import number, plain


@pytest.mark.parametrize(
    ("value", "sd", "text"),
    [
        (-0.003, 0.09, "0.00 ± 0.18"),
        (-0.03, 0.09, "−0.03 ± 0.18"),
        (0.003, 0.09, "0.00 ± 0.18"),
        (-12.4, 4.0, "−12.4 ± 8.0"),
        (float("nan"), 1.0, "–"),
    ],
)
def test_a_number_has_a_true_minus_and_none_before_a_rounded_zero(value, sd, text):
    assert number(value, sd) == text


@pytest.mark.parametrize(
    ("value", "sd", "words"),
    [
        (-0.46410, 0.0657, "−0.46 ± 0.13"),
        (0.999764, 0.00003, "0.999764 ± 0.000060"),
        (41.26, 6.0, "41 ± 12"),
        (2.0, 0.0, "2 ± 0"),
        (-1e140, 1e130, "−1e+140 ± 2e+130"),
        (math.nan, 1.0, "–"),
        (1.0, math.inf, "–"),
    ],
)
def test_a_value_has_the_decimals_its_error_deserves(value, sd, words):
    assert number(value, sd) == words


def test_the_same_holds_without_an_error():
    assert [plain(-0.2), plain(-1234.4), plain(float("inf"))] == ["0", "−1,234", "–"]
