import math

import pytest

from thermoctl.studies.words import counted, duration, probability


@pytest.mark.parametrize(
    ("p", "words"),
    [(1e-20, "< 0.001"), (0.0123, "0.012"), (0.4567, "0.46"), (1.0, "1.00"), (math.nan, "–")],
)
def test_a_probability_is_not_written_finer_than_it_is_known(p, words):
    assert probability(p) == words


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0.25, "0.25 s"),
        (60.0, "1 min"),
        (61.0, "1 min 1 s"),
        (8995.0, "2 h 29 min"),
        (7200.0, "2 h"),
        (2_000_000.0, "23 d 3 h"),
    ],
)
def test_a_duration_is_told_in_its_two_largest_units(seconds, words):
    assert duration(seconds) == words


def test_one_of_a_thing_takes_no_s():
    assert [counted(n, "input") for n in (0, 1, 2000)] == ["0 inputs", "1 input", "2,000 inputs"]
