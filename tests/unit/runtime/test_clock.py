"""Time that is simulated keeps the laws of time."""

import pytest

from thermoctl.runtime.clock import MonotonicClock, PacedClock, SimulatedClock


def test_simulated_time_moves_only_when_somebody_sleeps_and_never_back():
    clock = SimulatedClock(5.0)
    clock.sleep_until(9.0)
    clock.sleep_until(7.0)
    assert clock.now_s() == 9.0
    clock.advance(1.0)
    assert clock.now_s() == 10.0
    with pytest.raises(ValueError, match="forward"):
        clock.advance(-1.0)


def test_an_interrupted_clock_lets_every_sleep_end():
    clock = MonotonicClock()
    clock.interrupt()
    due_s = clock.now_s() + 1e9
    clock.sleep_until(due_s)
    assert clock.now_s() < due_s


def test_at_infinite_speed_nobody_waits():
    clock = PacedClock(float("inf"))
    clock.idle = lambda seconds: pytest.fail("waited")
    clock.sleep_until(1e9)
    assert clock.now_s() == 1e9


def test_while_it_waits_something_else_is_done_until_it_is_interrupted():
    clock = PacedClock(1e-6)
    turns = []

    def idle(seconds):
        turns.append(seconds)
        if len(turns) == 3:
            clock.interrupt()

    clock.idle = idle
    clock.sleep_until(1e9)
    assert len(turns) == 3


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan")])
def test_a_speed_that_is_none_is_refused(speed):
    with pytest.raises(ValueError, match="speed"):
        PacedClock(speed)
