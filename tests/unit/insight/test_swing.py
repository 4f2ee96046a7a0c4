"""Whether the power can have made a reading swing, and what is said of a loop that never rests."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.insight.harris import harris
from thermoctl.insight.performance import reason
from thermoctl.insight.restless import Restless
from thermoctl.insight.samples import Samples
from thermoctl.insight.swing import swing_of
from thermoctl.insight.values import Limit

GAIN, LAG_S, SAMPLES = 0.04, 18.0, 3600
TIMES = np.arange(SAMPLES, dtype=float)


def wave(turn_s, amplitude=1.0):
    return amplitude * np.sin(2.0 * np.pi * TIMES / turn_s)


def noise(sd, seed=1):
    return sd * np.random.default_rng(seed).normal(size=SAMPLES)


def moved_by(power, lag_s, loss_per_s):
    """Return the reading of a plant with a lag that this power moves, about its mean."""
    felt, water, seen = 0.0, 0.0, []
    for each in (power - power.mean()).tolist():
        felt += (each - felt) / lag_s
        water += GAIN * felt - loss_per_s * water
        seen.append(water)
    return np.array(seen)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    turn_s=st.floats(40.0, 240.0),
    lag_s=st.floats(3.0, 30.0),
    loss_per_s=st.floats(0.0, 0.01),
    seed=st.integers(0, 5),
)
def test_a_swing_that_the_power_makes_is_never_laid_on_something_else(
    turn_s, lag_s, loss_per_s, seed
):
    power = 0.3 + wave(turn_s, 0.2)
    error = moved_by(power, lag_s, loss_per_s) + noise(0.02, seed)
    swing = swing_of(error, power, 1.0, lag_s, GAIN)
    assert swing is None or not swing.elsewhere


@pytest.mark.parametrize("turn_s", [37.0, 54.0, 105.0])
def test_a_swing_that_is_too_large_for_the_power_is(turn_s):
    swing = swing_of(wave(turn_s, 0.1) + noise(0.02), wave(turn_s, 0.02), 1.0, LAG_S, GAIN)
    assert swing.turn_s == pytest.approx(turn_s, abs=2.0)
    assert swing.made == pytest.approx(GAIN * 0.02 * turn_s / (2.0 * np.pi) / 0.1, rel=0.1)
    assert swing.elsewhere
    assert "pulses" in swing.words


def test_nothing_is_laid_on_anything_where_nobody_knows_the_gain():
    swing = swing_of(wave(54.0), np.zeros(SAMPLES), 1.0, LAG_S, np.nan)
    assert not swing.elsewhere
    assert swing.words == "a cycle of 54 s"


def test_something_else_is_named_before_a_power_that_is_at_its_limit():
    error, power = wave(54.0) + noise(0.1), np.zeros(SAMPLES)
    for gain, limit in ((GAIN, Limit.ELSEWHERE), (np.nan, Limit.POWER)):
        swing = swing_of(error, power, 1.0, LAG_S, gain)
        assert reason(error, harris(error, 4), swing, 1.0, LAG_S, 0.0, 0.0, True)[0] is limit


# -- never at rest ---------------------------------------------------------------------------------


def told(readings_c, near=lambda _: True, begin_again_s=None):
    """Return what is said of a loop held at 40 degC, with the time of each saying."""
    restless, samples, said = Restless(), Samples(2.0), []
    for n, reading_c in enumerate(readings_c):
        t_s = 2.0 * n
        if t_s == begin_again_s:
            restless.begin()
        samples.take(t_s, reading_c, 0.2, LAG_S)
        performance = restless.after(t_s, samples, 40.0, LAG_S, GAIN, near=near(t_s))
        if performance is not None:
            said.append((t_s, performance))
    return said


def test_a_loop_that_swings_for_an_hour_is_told_so_once_a_minute():
    said = told(40.3 + 0.5 * np.sin(2.0 * np.pi * TIMES * 2.0 / 110.0), lambda t_s: t_s > 300.0)
    assert [t_s for t_s, _ in said[:3]] == [3902.0, 3962.0, 4022.0]
    performance = said[0][1]
    assert performance.limit is Limit.ELSEWHERE
    assert performance.deviation_k == pytest.approx(0.35, abs=0.01)
    assert performance.verdict.startswith(
        "never at rest: a deviation of 0.35 K, 0.31 K too warm, a cycle of 110 s"
    )


def test_a_loop_that_only_wanders_has_no_cycle():
    wandering = np.cumsum(noise(0.02))
    (_, performance), *_ = told(40.0 + wandering)
    assert performance.limit is Limit.UNTOLD
    assert "cycle" not in performance.verdict


def test_a_loop_on_its_way_is_not_restless():
    assert told(20.0 + 0.005 * TIMES, lambda _: False) == []


def test_who_moves_a_loop_gives_it_another_hour():
    first = told(40.0 + wave(55.0), begin_again_s=2000.0)[0][0]
    assert first == 2000.0 + 3600.0
