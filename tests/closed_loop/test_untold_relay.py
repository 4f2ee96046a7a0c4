"""The rig behind a relay of which nobody is told: it looks as if the loop were swinging."""

import pytest

from thermoctl.app.compose import loop_for
from thermoctl.app.settings import load
from thermoctl.app.sim import default_profile
from thermoctl.insight import Insights
from thermoctl.insight.values import Limit
from thermoctl.testing import ManualClock

pytestmark = pytest.mark.slow

SECONDS = 6000


class Relay:
    """On or off, for so long at least, and right in the mean; it reports what it was told."""

    def __init__(self, take, least_s):
        self.take, self.least_s = take, least_s
        self.on, self.since, self.owed = False, least_s, 0.0

    def __call__(self, outputs, *how_long):
        power = outputs["heater"] ** 2  # the power stage of the rig
        if self.since >= self.least_s and (self.owed + power >= 0.5) is not self.on:
            self.on, self.since = not self.on, 0
        self.owed += power - self.on
        self.since += 1
        self.take({"heater": float(self.on)}, *how_long)
        return outputs


@pytest.mark.parametrize("least_s", [None, 15, 20])
def test_a_relay_nobody_is_told_of_is_what_the_swing_is_laid_on(least_s):
    cycles, clock, insights = [], ManualClock(), Insights()
    loop = loop_for(load(default_profile()), clock, cycles.append, beside=False)
    board = None
    for _ in range(SECONDS):
        clock.advance(1.0)
        loop.cycle(clock.now_s())
        insights.after(cycles[-1].step, cycles[-1].accepted_power)
        if least_s is not None and board is not loop.boards[0].board:
            board = loop.boards[0].board
            board.write = Relay(board.write, least_s)
    performance = insights.now.performance
    print(performance.verdict)
    assert (performance.limit is Limit.ELSEWHERE) is (least_s is not None)
