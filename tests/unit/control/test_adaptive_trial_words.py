"""How a trial of a stored model is told: in odds that people use."""

import math

import pytest

from thermoctl.control.adaptive.trial import _words


@pytest.mark.parametrize(
    ("odds", "words"),
    [
        (0.0, "the stored model foresees as well as one that knew nothing, after"),
        (-0.3, "the stored model foresees no better than one that knew nothing, after"),
        (math.log(20.0), "20 to 1 for the stored model after"),
        (-3.0, "20 to 1 against the stored model after"),
        (50.0, "more than 1,000 to 1 for the stored model after"),
        (math.inf, "more than 1,000 to 1 for the stored model after"),
    ],
)
def test_odds_are_told_as_people_tell_them(odds, words):
    assert _words(odds, 61.0) == f"{words} 61 s of changing power"
