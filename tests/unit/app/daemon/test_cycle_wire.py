"""A cycle through the socket and out of it again: what is drawn of it is the same."""

import json
import tomllib
from dataclasses import replace
from datetime import datetime

import pytest

from thermoctl.app.cycle_record import cycle_record
from thermoctl.app.daemon.cycle_wire import cycle_from, details_of, insight_from
from thermoctl.app.live import Colour, Facts, LiveModel, Look, render
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, default_profile, simulate
from thermoctl.errors import Unavailable
from thermoctl.insight import Change, Drift, Insight, Insights
from thermoctl.services.control_protocol import told

ZERO = datetime(2026, 3, 1, 14, 0)


def sent(cycle, insight=None):
    """Return `cycle` as it arrives at the other end, and its insight where one is sent."""
    line = json.loads(told(1, cycle_record(cycle), details_of(cycle, insight)))
    arrived = cycle_from(line["cycle"], line["details"])
    return arrived if insight is None else (arrived, insight_from(line["details"]))


@pytest.fixture(scope="module")
def run():
    """Ten minutes of the aquarium."""
    return list(simulate(bench_settings(seed=4), 600.0))


@pytest.fixture(scope="module")
def latched():
    """Twenty seconds of an aquarium that is too hot when it begins."""
    tables = tomllib.loads(default_profile().read_text())
    tables["boards"]["daq"]["initial_c"] = 70.0
    return list(simulate(load(tables), 20.0, seed=4))


def picture(cycles, width=140, height=40):
    model = LiveModel(Facts("tank", 1.0, 5.0, 55.0, ZERO, simulated=False))
    for cycle in cycles:
        model.feed(cycle)
    rows = render(model.view(cycles[-1].step.t_s + 0.5), width, height, Look(Colour.NONE))
    return [row.plain for row in rows if "Tick" not in row.plain]  # it travels rounded


def test_a_view_of_cycles_that_travelled_is_the_view_of_those_that_did_not(run):
    assert picture([sent(each) for each in run]) == picture(run)


def test_a_latch_and_its_events_travel_too(latched):
    arrived = [sent(each) for each in latched]
    assert arrived[-1].step.alarms == latched[-1].step.alarms
    assert any(alarm.latched for alarm in arrived[-1].step.alarms)
    names = [event.name for each in latched for event in each.step.events]
    assert [event.name for each in arrived for event in each.step.events] == names != []
    assert picture(arrived) == picture(latched)


def test_what_is_told_of_the_plant_arrives_whole(run):
    watch = Insights(1.0, 1500.0)
    for each in run:
        watch.after(each.step, each.accepted_power)
    drift = Drift("water.low", 3.0, "less water", 1.0, 2.0, 5.0)
    change = Change(5.0, "step.loss", -3.1, 0.2, "K", "cold water", None)
    for insight in (replace(watch.now, drifts=(drift,), changes=(change,)), Insight(0.0)):
        assert sent(run[-1], insight)[1] == insight
    assert watch.now.rows
    assert insight_from(details_of(run[-1])) is None


def test_scores_and_expectations_arrive(run):
    last = run[-1].step
    assert sent(run[-1]).step.shadow_score == last.shadow_score
    assert repr(sent(run[-1]).step.feasible) == repr(last.feasible)  # NaN equals nothing
    assert last.feasible.holding_power > 0.1


def test_keys_of_a_newer_daemon_are_passed_over(run):
    record, details = cycle_record(run[-1]), details_of(run[-1])
    record["shadow_score"] = {**record["shadow_score"], "colour": "blue"}
    record["colour"], details["colour"] = 1, None
    assert cycle_from(record, details).step.shadow_score == run[-1].step.shadow_score


@pytest.mark.parametrize("spoil", [{"mode": "lazy"}, {"setpoint_c": "warm"}, {"t_s": None}])
def test_a_daemon_that_is_not_understood_is_told_of_as_such(run, spoil):
    record = cycle_record(run[-1]) | spoil
    with pytest.raises(Unavailable, match="same version"):
        cycle_from(record, details_of(run[-1]))


def test_a_daemon_without_details_is_told_of_as_such(run):
    with pytest.raises(Unavailable, match="same version"):
        cycle_from(cycle_record(run[-1]), {})
