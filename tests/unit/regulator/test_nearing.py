"""The farthest that power holds, and whether it is on its way to the set point."""

import numpy as np
import pytest

from thermoctl.quantities import Uncertain
from thermoctl.regulator.balance.foretold import Nearing

COOLS = -1.0


def told(limits, every_s=10.0):
    """Return what is told of a set point of 5 degC after each of the lowest temperatures."""
    nearing, said = Nearing(), []
    for stretch, limit in enumerate(limits):
        nearing.seen(limit, COOLS, every_s * stretch)
        said.append(nearing.arrives(5.0))
    return said


def test_one_that_falls_by_a_kelvin_an_hour_comes_to_the_set_point():
    said = told([Uncertain(15.0 - stretch / 360.0, 0.1) for stretch in range(360)])
    assert not any(said[:30])
    assert all(said[120:])


@pytest.mark.parametrize("slope_k", [0.0, -1e-4])
def test_one_that_stands_or_goes_too_slowly_does_not(slope_k):
    assert not any(told([Uncertain(15.0 + slope_k * stretch, 0.1) for stretch in range(2000)]))


@pytest.mark.parametrize("off_sds", [-1.0, 0.0, 1.0])
def test_one_that_is_only_known_better_and_better_does_not(off_sds):
    sds = np.geomspace(10.0, 0.1, 1000)
    assert not any(told([Uncertain(15.0 + off_sds * sd, sd) for sd in sds]))


def test_one_that_only_comes_back_to_where_it_was_does_not():
    there, fall_c = [12.0] * 200, np.linspace(15.0, 12.5, 200)
    assert not any(told([Uncertain(limit_c, 0.1) for limit_c in (*there, *[15.0] * 100, *fall_c)]))


def test_nothing_is_told_of_one_that_nobody_knows():
    assert not any(told([Uncertain()] * 50))


def test_a_plant_whose_power_turns_out_to_warm_begins_anew():
    nearing = Nearing()
    for stretch in range(200):
        nearing.seen(Uncertain(15.0 - stretch / 360.0, 0.1), COOLS, 10.0 * stretch)
    assert nearing.arrives(5.0)
    nearing.seen(Uncertain(30.0, 0.1), -COOLS, 2000.0)
    assert not nearing.arrives(45.0)
