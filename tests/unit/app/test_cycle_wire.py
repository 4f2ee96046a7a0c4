"""A cycle through the socket and out of it again: what is drawn of it is the same."""

import json
import tomllib
from dataclasses import asdict
from datetime import datetime

import pytest

from thermoctl.app.cycle_record import cycle_record
from thermoctl.app.cycle_wire import cycle_from, details_of
from thermoctl.app.live import Colour, Facts, LiveModel, Look, render
from thermoctl.app.settings import load
from thermoctl.app.sim import bench_settings, default_profile, simulate
from thermoctl.errors import Unavailable
from thermoctl.services.control_protocol import told

ZERO = datetime(2026, 3, 1, 14, 0)


def sent(cycle):
    """Return `cycle` as it arrives at the other end."""
    line = json.loads(told(1, cycle_record(cycle), details_of(cycle)))
    return cycle_from(line["cycle"], line["details"])


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


def test_what_is_believed_of_the_plant_arrives(run):
    last = run[-1].step
    assert asdict(sent(run[-1]).step.plant) == asdict(last.plant)
    assert sent(run[-1]).step.shadow_score == last.shadow_score
    assert sent(run[-1]).step.feasible == last.feasible
    assert last.feasible.holding_power > 0.1


def test_keys_of_a_newer_daemon_are_passed_over(run):
    record, details = cycle_record(run[-1]), details_of(run[-1])
    details["plant"]["colour"], record["colour"], details["colour"] = "blue", 1, None
    assert cycle_from(record, details).step.plant == run[-1].step.plant


@pytest.mark.parametrize("spoil", [{"mode": "lazy"}, {"setpoint_c": "warm"}, {"t_s": None}])
def test_a_daemon_that_is_not_understood_is_told_of_as_such(run, spoil):
    record = cycle_record(run[-1]) | spoil
    with pytest.raises(Unavailable, match="same version"):
        cycle_from(record, details_of(run[-1]))


def test_a_daemon_without_details_is_told_of_as_such(run):
    with pytest.raises(Unavailable, match="same version"):
        cycle_from(cycle_record(run[-1]), {})
