"""A loop that switches lets its vessel coast for minutes: that is no heater that is stuck on.

The power is off for longer than the lag the watch believes in, and the reading still rises. On
these two vessels of some 150 l that was once enough to latch a healthy heater.
"""

import pytest

from thermoctl.app.commands.compare import contender
from thermoctl.app.settings import load
from thermoctl.app.sim import profile
from thermoctl.studies.compare.plants import plant
from thermoctl.studies.compare.play import play
from thermoctl.studies.compare.scenarios import SCENARIOS

pytestmark = pytest.mark.slow  # they take hours to warm up


@pytest.mark.parametrize("seed", [9, 13])
def test_a_vessel_that_coasts_under_a_switching_law_is_left_alone(seed):
    _, table = load(profile("aquarium")).loop()
    where = plant("sizes", seed)
    trace = play(contender("on-off", table).plan_for(where), where, SCENARIOS["regulation"])
    assert trace.failure is None
