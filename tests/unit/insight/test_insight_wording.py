"""Numbers in the words that are told of a plant."""

from __future__ import annotations

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


def test_the_same_holds_without_an_error():
    assert [plain(-0.2), plain(-1234.4), plain(float("inf"))] == ["0", "−1,234", "–"]
