"""Full power that has never been less is cut for some minutes, and what is sound answers."""

from collections import deque

import numpy as np
import pytest

from thermoctl.regulator.heater.blocks import NEARLY_FULL, Block
from thermoctl.regulator.heater.question import LONGEST_SDS, ROUTINE_S
from thermoctl.regulator.heater.response import LAGS_S, Gain, Seen
from thermoctl.regulator.heater.unbroken import AGAIN_S, LONGER, UNBROKEN_S, Unbroken
from thermoctl.regulator.heater.verdicts import LATELY_S
from thermoctl.signals import State

BLOCK_S, NOISE_K = 4.0, 0.01
KNOWN = Gain(1e-3, 1e-4, 2)


def seen(t_s, reading_c=20.0):
    """Return a reading after so long at full power."""
    return Seen(t_s, reading_c, (t_s,) * len(LAGS_S))


def asked_s(seconds, gain=KNOWN, power=lambda t_s: 1.0, proven=lambda t_s: False):
    """Return when what has had so much power is asked."""
    unbroken, at_s, t_s = Unbroken(), [], 0.0
    while t_s < seconds:
        block = Block(BLOCK_S, power(t_s), 20.0, NOISE_K)
        unbroken.add(block, seen(t_s), proven=proven(t_s))
        t_s += BLOCK_S
        if unbroken.question(gain, seen(t_s), NOISE_K) is not None:
            at_s.append(t_s)
    return at_s


def test_it_is_asked_after_two_hours_and_then_ever_more_rarely():
    asked = asked_s(8.0 * UNBROKEN_S)
    first, second, third = UNBROKEN_S, (1.0 + LONGER) * UNBROKEN_S, 7.0 * UNBROKEN_S
    assert asked == pytest.approx([first, second, third], abs=4.0 * BLOCK_S)


def test_after_a_bad_answer_it_is_asked_soon_and_then_as_rarely_as_before():
    unbroken, at_s = Unbroken(), []
    unbroken.distrust()
    for t_s in np.arange(0.0, 2.5 * UNBROKEN_S, BLOCK_S):
        unbroken.add(Block(BLOCK_S, 1.0, 20.0, NOISE_K), seen(t_s), proven=False)
        if unbroken.question(KNOWN, seen(t_s + BLOCK_S), NOISE_K) is not None:
            at_s.append(t_s)
    assert at_s == pytest.approx([AGAIN_S, AGAIN_S + UNBROKEN_S], abs=4.0 * BLOCK_S)


@pytest.mark.parametrize(
    "sound",
    [
        {"power": lambda t_s: 0.99 * NEARLY_FULL if t_s == 3600.0 else 1.0},  # it has been less
        {"proven": lambda t_s: t_s >= 3600.0},  # it was seen to obey less
        {"gain": Gain(0.99 * LONGEST_SDS * NOISE_K / ROUTINE_S, 1e-6, 2)},  # no cut would tell
    ],
    ids=lambda keys: next(iter(keys)),
)
def test_nothing_is_asked_that_is_known_or_would_stay_open(sound):
    assert asked_s(1.4 * UNBROKEN_S, **sound) == []


def test_nothing_is_in_doubt_when_it_is_asked():
    unbroken = Unbroken()
    unbroken.add(Block(BLOCK_S, 1.0, 20.0, NOISE_K), seen(0.0), proven=False)
    cut = unbroken.question(KNOWN, seen(UNBROKEN_S, 27.2), NOISE_K)
    assert cut.rose == pytest.approx(1e-3)
    assert "120 min and +7.2 K" in cut.why
    assert cut.began_s is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gain", "cools_per_s", "lag_s"), [(1e-3, 0.0, 20.0), (3e-3, 5e-5, 60.0), (4e-4, 1e-5, 10.0)]
)
def test_a_vessel_that_warms_for_hours_answers(vessel_with, gain, cools_per_s, lag_s):
    vessel = vessel_with(gain, cools_per_s, lag_s).run(5 * 3600)
    names = vessel.names()
    assert names.count("heater.questioned") == names.count("heater.answered") > 0
    assert set(names) == {"heater.questioned", "heater.answered"}
    assert vessel.supervisor.state is State.RUN


@pytest.mark.slow
@pytest.mark.parametrize("wall_s", [200.0, 400.0])
def test_a_wall_that_gives_off_its_heat_for_longer_than_any_lag_is_no_fault(vessel_with, wall_s):
    vessel, wall_c = vessel_with(3e-3, 1e-5, 10.0, first_heat_s=1800.0), deque([20.0], maxlen=1)

    def shows(water_c):
        wall_c.append(wall_c[0] + (water_c - wall_c[0]) / wall_s)
        return wall_c[0]

    vessel.shows = shows
    vessel.run(4 * 3600)
    assert set(vessel.names()) == {"heater.questioned", "heater.answered"}
    assert vessel.supervisor.state is State.RUN


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_air_that_warms_for_ever_as_a_heater_would_is_told(vessel_with, seed):
    """In step with full power from the second hour on, it is a known heater by then."""
    vessel = vessel_with(seed=seed, lag_s=20.0)
    vessel.shows = lambda water_c: (
        22.0 + ((water_c - 20.0) / 20.0 if vessel.t_s < 600.0 else 1e-3 * vessel.t_s)
    )
    vessel.run(4 * 3600)
    assert vessel.supervisor.state is State.LATCHED
    assert vessel.given_s < UNBROKEN_S + LATELY_S
