"""Outputs that take their time over a command are in order; outputs that are stuck are not."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermoctl.regulator import Limits
from thermoctl.regulator.overdrawn import IN_ORDER
from thermoctl.regulator.supervisor import Supervisor
from thermoctl.signals import Measurement, State

LIMITS = Limits(60.0, 0.0, 0.0, 60.0)
BOTH = {"power_min": -1.0}


class Line:
    """A supervisor that is told, sample by sample, what an output gave for a command."""

    def __init__(self, period_s=1.0, **limits):
        self.events = []
        self.period_s = period_s
        self.subject = Supervisor(
            replace(LIMITS, period_s=period_s, **limits),
            lambda name, **fields: self.events.append((name, fields)),
        )
        self.t_s = 0.0

    def tell(self, commanded, applied):
        """Return whether the output is in order, as far as anybody knows."""
        self.subject.judge(Measurement(self.t_s, 20.0), self.t_s, self.period_s)
        self.subject.rule(self.t_s, 0.0)
        self.subject.check_applied(commanded, applied, self.t_s)
        self.t_s += self.period_s
        return self.subject.state is State.RUN

    def seconds_to_fault(self, commanded, applied, at_most_s=600):
        """Return after how many seconds of `applied` the fault is told; nothing for never."""
        begin_s = self.t_s
        while self.t_s < begin_s + at_most_s:
            if not self.tell(commanded, applied):
                return self.t_s - begin_s
        return None

    def told(self, name):
        return [fields for told, fields in self.events if told == name]


def latched(commands, window):
    """Return the power of an output that takes the command of every `window`-th sample."""
    return [commands[n - n % window] for n in range(len(commands))]


def pulses(commands, least):
    """Return the reports of a relay, on or off for at least so long, right in the mean."""
    on, since, owed, given_ = False, least, 0.0, []
    for command in commands:
        if since >= least and (owed + command >= 0.5) is not on:
            on, since = not on, 0
        owed += command - on
        since += 1
        given_.append(float(on))
    return given_


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    window=st.integers(2, 12),
    phase=st.integers(0, 11),
    powers=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12),
)
def test_an_output_that_takes_its_power_once_in_its_window_is_in_order(window, phase, powers):
    commands = [power for power in powers for _ in range(2 * window)]
    line = Line(window_s=float(window))
    applied = latched([0.0] * (phase % window) + commands, window)[phase % window :]
    assert all(map(line.tell, commands, applied))


@settings(max_examples=100, deadline=None, derandomize=True)
@given(least=st.integers(2, 20), first=st.floats(0.0, 1.0), second=st.floats(0.0, 1.0))
def test_a_relay_that_stays_on_for_its_least_time_is_in_order(least, first, second):
    commands = [first] * 200 + [second] * 200
    line = Line(window_s=float(least))
    assert all(map(line.tell, commands, pulses(commands, least)))


@pytest.mark.parametrize(("commanded", "applied"), [(0.0, 1.0), (0.0, 0.2), (0.2, 0.9)])
def test_without_a_window_two_reports_are_a_fault_whatever_was_commanded_before(commanded, applied):
    line = Line()
    for _ in range(30):
        assert line.tell(applied, applied)
    assert line.seconds_to_fault(commanded, applied) == 2.0


@pytest.mark.parametrize(("applied", "seconds"), [(1.0, 13.0), (0.6, 21.0), (0.4, 35.0)])
def test_an_output_that_is_stuck_has_ten_seconds_of_full_power_and_no_more(applied, seconds):
    line = Line(window_s=10.0)
    for _ in range(30):
        assert line.tell(applied, applied)
    assert line.seconds_to_fault(0.0, applied) == seconds


def test_an_output_that_sticks_most_of_the_time_is_found_as_well():
    line = Line(window_s=10.0)
    reports = ([1.0] * 9 + [0.0]) * 10
    in_order = [line.tell(0.0, applied) for applied in reports]
    assert in_order.index(False) < 20


def test_a_slow_loop_counts_in_seconds_and_not_in_reports():
    line = Line(period_s=5.0, window_s=10.0)
    line.tell(1.0, 1.0)
    assert line.seconds_to_fault(0.0, 1.0) == 20.0  # three reports: ten seconds between them


@pytest.mark.parametrize("taken", [math.nan, math.inf])
def test_an_output_that_does_not_say_what_it_took_has_no_window(taken):
    assert Line(window_s=600.0).seconds_to_fault(0.5, taken) == 2.0


def test_heater_and_cooler_have_a_window_each():
    slow, quick = {"window_s": 10.0}, {"cooler_window_s": 10.0}
    assert Line(**BOTH, **slow).seconds_to_fault(0.0, -1.0) == 2.0
    assert Line(**BOTH, **slow).seconds_to_fault(0.0, 1.0) == 13.0
    assert Line(**BOTH, **quick).seconds_to_fault(0.0, -1.0) == 13.0
    assert Line(**BOTH, **quick).seconds_to_fault(0.0, 1.0) == 2.0


def test_a_short_window_does_not_excuse_a_small_power_for_ever():
    line = Line(window_s=2.0)
    assert line.seconds_to_fault(0.0, 0.15) == pytest.approx(2.0 / 0.05 + 1.0, abs=1.0)


def test_an_output_that_comes_back_says_for_how_long_it_was_off():
    line = Line()
    for applied in (0.2, *[1.0] * 7, 0.0, 0.0):
        line.tell(0.2, applied)
    assert line.told("output.in_order") == [{"after_s": 7.0}]


def test_nothing_is_told_of_an_output_that_is_late_within_its_window():
    line = Line(window_s=10.0)
    for applied in (0.2, *[1.0] * 7, 0.0, 0.0):
        line.tell(0.2, applied)
    assert line.events == []


def test_the_text_of_the_fault_has_the_window():
    line = Line(window_s=10.0)
    line.seconds_to_fault(0.0, 1.0)
    (fields,) = line.told("output.readback")
    assert fields["text"] == (
        "expected at most 0.000 of full power, the output reports 1.000, and its window of 10 s "
        "is over"
    )


@given(
    reports=st.lists(st.floats(-1.0, 1.0) | st.just(math.inf), max_size=60),
    window_s=st.floats(0.0, 600.0),
)
@settings(max_examples=100, deadline=None, derandomize=True)
def test_what_is_owed_lies_between_nothing_and_the_window(reports, window_s):
    account = IN_ORDER
    for beyond in reports:
        account = account.after(beyond, 1.0, window_s)
        assert 0.0 <= account.heat_s <= window_s
    for _ in range(math.ceil(window_s) + 1):
        account = account.after(0.0, 1.0, window_s)
    assert account.settled


@pytest.mark.parametrize("key", ["window_s", "cooler_window_s"])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_a_window_that_makes_no_sense_is_refused_by_name(key, value):
    with pytest.raises(ValueError, match=key):
        replace(LIMITS, **{key: value})
