"""The history: what goes in comes out, whatever the feed, the clock and the file look like."""

from __future__ import annotations

import csv
import errno
import io
import json
import math
import os
import re
import threading
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from thermoctl.errors import Unavailable
from thermoctl.services.history import (
    COLUMNS,
    HistoryWriter,
    RunInfo,
    export,
    open_history,
    read_history,
)
from thermoctl.services.history.schema import SCHEMA_VERSION, row_of
from thermoctl.signals import Alarm, Event

pytestmark = pytest.mark.usefixtures("histories_closed")

RUN = RunInfo("1.2.3", '{"loops": {"tank": {"setpoint_c": 41.0}}}', started_utc_s=1.7e9)
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
START = datetime.fromtimestamp(1.7e9, UTC)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "state" / "history.sqlite"


@pytest.fixture
def recorded(path, cycle_at, wall_clock):
    """Sixty seconds of two loops, the second half of ``tank`` without a reading."""
    writer = HistoryWriter(path, RUN, wall_clock=wall_clock)
    for t_s in range(60):
        wall_clock.utc_s = 1.7e9 + t_s
        temperature_c = 40.0 + t_s if t_s < 30 else math.nan
        writer.publish(cycle_at(float(t_s), temperature_c=temperature_c))
        writer.publish(cycle_at(float(t_s), loop="mash", true_temperature_c=66.0, lid=1.0))
    assert writer.store_waiting()
    return path


def test_a_cycle_survives_the_round_trip(recorded):
    tank = read_history(recorded, loop="tank")
    assert tank.columns["t_s"].tolist() == list(range(60))
    assert tank.columns["temperature_c"][:30].tolist() == [40.0 + t for t in range(30)]
    assert set(tank.columns["mode"]) == {"auto"}
    assert set(tank.columns["quality"][30:]) == {"missing"}
    assert set(tank.columns["accepted_power"]) == {0.24}
    assert set(tank.columns["innovation_var_k2"]) == {0.5}
    assert tank.configuration == json.loads(RUN.configuration)
    assert list(tank.runs.values()) == [RUN]


def test_not_a_number_is_kept_as_nothing(recorded):
    tank = read_history(recorded, loop="tank").columns
    assert np.isnan(tank["temperature_c"][30:]).all()
    assert np.isnan(tank["a_sd"]).all()
    assert np.isnan(tank["true_temperature_c"]).all()


def test_the_truth_of_a_simulation_is_kept_whole(recorded):
    mash = read_history(recorded, loop="mash").columns
    assert set(mash["true_temperature_c"]) == {66.0}
    assert set(mash["other_truth"]) == {'{"lid": 1.0}'}


def test_active_alarms_are_named_in_their_row(path, cycle_at):
    alarms = (
        Alarm("sensor.open", 1, 1, 5.0, "text"),
        Alarm("sensor.spike", 6, 3, 2.0, "text", active=False),
        Alarm("trip.over_temperature", 9, 1, 5.0, "text", active=False, latched=True),
    )
    writer = HistoryWriter(path, RUN)
    writer.publish(cycle_at(5.0, alarms=alarms))
    writer.store_waiting()
    assert read_history(path).columns["alarms"][0] == "sensor.open trip.over_temperature"


def test_since_is_inclusive_and_until_is_not(recorded):
    half = read_history(
        recorded, "tank", START + timedelta(seconds=10), START + timedelta(seconds=20)
    )
    assert half.columns["t_s"].tolist() == list(range(10, 20))


@given(
    walls=st.lists(st.integers(0, 20), min_size=1, max_size=20),
    since=st.none() | st.integers(-1, 21),
    until=st.none() | st.integers(-1, 21),
)
@settings(max_examples=60, deadline=None)
def test_a_range_holds_its_cycles_in_order_however_the_wall_clock_moved(
    walls, since, until, cycle_at, tmp_path_factory
):
    path = tmp_path_factory.mktemp("range") / "h.sqlite"
    times = iter(walls)
    writer = HistoryWriter(path, RUN, wall_clock=lambda: float(next(times, 0)))
    for t_s in range(len(walls)):
        writer.publish(cycle_at(float(t_s)))
    writer.close()
    low, high = (-1 if since is None else since), (99 if until is None else until)
    expected = [t_s for t_s, wall in enumerate(walls) if low <= wall < high]
    bounds = [None if s is None else EPOCH + timedelta(seconds=s) for s in (since, until)]
    if expected:
        assert read_history(path, None, *bounds).columns["t_s"].tolist() == expected
    else:
        with pytest.raises(Unavailable, match="should hold cycles"):
            read_history(path, None, *bounds)


def test_only_the_columns_asked_for_are_read(recorded):
    assert list(read_history(recorded, columns=("power",)).columns) == ["power"]
    with pytest.raises(ValueError, match="temperatur'"):
        read_history(recorded, columns=("temperatur",))


@pytest.mark.parametrize("reader", [read_history, lambda *a: export(a[0], io.StringIO(), *a[2:])])
def test_a_time_without_a_zone_is_refused(recorded, reader):
    with pytest.raises(ValueError, match="time zone"):
        reader(recorded, None, START.replace(tzinfo=None))


def test_the_csv_carries_utc_with_an_offset_and_units(recorded):
    out = io.StringIO()
    assert export(recorded, out, loop="tank") == 60
    rows = list(csv.DictReader(io.StringIO(out.getvalue())))
    assert "\r" not in out.getvalue()
    assert rows[1]["time_utc"] == "2023-11-14T22:13:21.000+00:00"
    assert rows[1]["temperature_c"] == "41.0"
    assert rows[59]["temperature_c"] == ""
    assert set(rows[0]) == {"time_utc", *(column.name for column in COLUMNS)}


def test_the_csv_and_the_arrays_tell_the_same(recorded, tmp_path):
    out = tmp_path / "x.csv"
    count = export(recorded, out)
    with out.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    columns = read_history(recorded).columns
    assert count == len(rows) == 120
    for name in ("t_s", "temperature_c", "power", "gain_k_per_s"):
        written = [float(row[name] or "nan") for row in rows]
        np.testing.assert_array_equal(written, columns[name])


def test_a_failed_export_leaves_no_file(recorded, tmp_path):
    out = tmp_path / "x.csv"
    with pytest.raises(Unavailable, match=r"'kettle', but it holds 120 of .*mash.* from 2023-11"):
        export(recorded, out, loop="kettle")
    assert [entry.name for entry in tmp_path.iterdir()] == ["state"]


def test_an_export_follows_a_link_and_leaves_it_one(recorded, tmp_path):
    (tmp_path / "there").mkdir()
    link, final = tmp_path / "x.csv", tmp_path / "there" / "y.csv"
    link.symlink_to(final)
    for _ in range(2):
        assert export(recorded, link, loop="tank") == 60
        assert link.is_symlink()
        assert len(final.read_text().splitlines()) == 61
    assert [entry.name for entry in final.parent.iterdir()] == ["y.csv"]


def test_an_export_into_a_pipe_leaves_it_a_pipe(recorded, tmp_path):
    pipe, lines = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: lines.extend(pipe.read_text().splitlines()))
    reader.start()
    export(recorded, pipe, loop="tank")
    reader.join()
    assert len(lines) == 61
    assert pipe.is_fifo()


@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="needs a device that is full")
def test_an_export_into_a_full_device_fails_by_its_name_and_leaves_it_a_device(recorded, tmp_path):
    link = tmp_path / "x.csv"  # a rename would hit the link, not the device of this machine
    link.symlink_to("/dev/full")
    with pytest.raises(OSError, match=re.escape(str(link))) as caught:
        export(recorded, link)
    assert caught.value.errno == errno.ENOSPC
    assert link.is_char_device()


def test_an_export_into_a_folder_that_is_not_there_names_it(recorded, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"there is no folder .*no: '.*x\.csv'"):
        export(recorded, tmp_path / "no" / "x.csv")


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "no history at"), (b"", "should be a thermoctl history"), (b"x" * 5000, "readable")],
)
def test_what_is_no_history_is_said_in_one_sentence(tmp_path, content, message):
    path = tmp_path / "h.sqlite"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(Unavailable, match=message):
        read_history(path)


def test_a_history_without_cycles_says_so(path):
    open_history(path).connection.close()
    with pytest.raises(Unavailable, match="holds no cycle at all"):
        read_history(path)


def test_a_newer_schema_is_not_read(path):
    connection = open_history(path).connection
    connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION + 1}")
    connection.close()
    with pytest.raises(Unavailable, match="newer thermoctl"):
        read_history(path)


def test_a_full_feed_drops_the_oldest_and_counts_each(path, cycle_at):
    writer = HistoryWriter(path, RUN, feed_size=10)
    for t_s in range(25):
        writer.publish(cycle_at(float(t_s)))
    writer.store_waiting()
    assert read_history(path).columns["t_s"].tolist() == list(range(15, 25))
    assert writer.health().counters["dropped"] == 15
    assert writer.health().counters["written"] == 10


@settings(max_examples=30, deadline=None)
@given(bursts=st.lists(st.integers(0, 25), min_size=1, max_size=6))
def test_every_cycle_is_either_written_or_counted_as_dropped(bursts, cycle_at, tmp_path_factory):
    path = tmp_path_factory.mktemp("bursts") / "h.sqlite"
    writer = HistoryWriter(path, RUN, feed_size=10)
    for burst in bursts:
        for t_s in range(burst):
            writer.publish(cycle_at(float(t_s)))
        writer.store_waiting()
    counters = writer.health().counters
    assert counters["written"] + counters["dropped"] == sum(bursts)
    assert counters["dropped"] == sum(max(0, burst - 10) for burst in bursts)


@pytest.mark.parametrize("step_s", [3600.0, -3600.0, 31_536_000.0, -1.7e9])
def test_a_step_of_the_wall_clock_is_marked_once(path, cycle_at, wall_clock, step_s):
    told: list[Event] = []
    writer = HistoryWriter(path, RUN, wall_clock=wall_clock, report=told.append)
    for t_s in range(10):
        wall_clock.utc_s += 1.0 + step_s * (t_s == 5)
        writer.publish(cycle_at(float(t_s)))
    writer.store_waiting()
    recording = read_history(path)
    assert recording.clock_steps.tolist() == [[1.7e9 + 6.0 + step_s, step_s]]
    assert recording.columns["t_s"].tolist() == list(range(10))
    assert [(event.name, event.t_s) for event in told] == [("clock.stepped", 5.0)]


def test_a_wall_clock_that_is_slewed_is_not_marked(path, cycle_at, wall_clock):
    writer = HistoryWriter(path, RUN, wall_clock=wall_clock)
    for t_s in range(3000):
        wall_clock.utc_s += 1.0005  # 500 ppm, the fastest an NTP client slews
        writer.publish(cycle_at(float(t_s)))
    writer.store_waiting()
    assert len(read_history(path).clock_steps) == 0


def test_the_oldest_cycles_go_when_the_file_is_full_by_its_own_limit(path, cycle_at, wall_clock):
    writer = HistoryWriter(path, RUN, wall_clock=wall_clock, max_cycles=100)
    for t_s in range(250):
        wall_clock.utc_s -= 1000.0  # the limit must not look at the wall clock
        writer.publish(cycle_at(float(t_s)))
    writer.store_waiting()
    assert read_history(path).columns["t_s"].tolist() == list(range(150, 250))


def test_events_are_kept_with_their_fields(path, cycle_at, wall_clock):
    event = Event(3.0, "sensor.open", {"counts": 1023.0, "limit": math.inf, "who": Path("/x")})
    writer = HistoryWriter(path, RUN, wall_clock=wall_clock)
    writer.publish(cycle_at(3.0, events=(event,)))
    writer.store_waiting()
    connection = open_history(path).connection
    row = connection.execute("SELECT loop, t_s, name, fields FROM events").fetchone()
    connection.close()
    assert row == (
        "tank", 3.0, "sensor.open", '{"counts": 1023.0, "limit": null, "who": "/x"}'
    )  # fmt: skip


def test_an_event_outside_of_any_cycle_is_kept_too(path, wall_clock):
    writer = HistoryWriter(path, RUN, wall_clock=wall_clock)
    writer.publish_event(Event(4.0, "board.lost", {"board": "daq"}))
    writer.close()
    connection = open_history(path).connection
    row = connection.execute("SELECT wall_utc_s, loop, t_s, name, fields FROM events").fetchone()
    connection.close()
    assert row == (1.7e9, None, 4.0, "board.lost", '{"board": "daq"}')


def test_each_start_is_a_run_of_its_own(path, cycle_at):
    for version in ("1.0", "2.0"):
        writer = HistoryWriter(path, RunInfo(version, '{"v": 1}'), wall_clock=lambda: 1.7e9)
        writer.publish(cycle_at(0.0))
        assert writer.store_waiting()
    recording = read_history(path)
    assert [run.version for run in recording.runs.values()] == ["1.0", "2.0"]
    assert recording.columns["run"].tolist() == [1.0, 2.0]


@given(
    value=st.one_of(st.floats(), st.integers(-(2**40), 2**40).map(np.int64)),
    loop=st.text(st.characters(exclude_categories=())),
)
@example(value=math.inf, loop="\ud800")
@settings(max_examples=200)
def test_every_cycle_becomes_plain_values(cycle_at, value, loop):
    row = row_of(cycle_at(1.0, loop=loop, temperature_c=float(value), true_temperature_c=value))
    assert all(type(item) in (float, int, str, type(None)) for item in row)
    assert all(math.isfinite(item) for item in row if isinstance(item, float))
    row[0].encode()


def test_the_thread_stores_what_was_published_before_it_closes(path, cycle_at):
    writer = HistoryWriter(path, RUN, commit_every_s=3600.0)
    writer.start()
    for t_s in range(500):
        writer.publish(cycle_at(float(t_s)))
    assert writer.close(timeout_s=30.0)
    assert read_history(path).columns["t_s"].tolist() == list(range(500))
    assert writer.health().status == "down"


@pytest.mark.parametrize("text", ["", "setpoint_c = 41", "[1]"])
def test_a_configuration_that_is_no_json_object_is_refused(text):
    with pytest.raises(ValueError):
        RunInfo("1.0", text)


@pytest.mark.parametrize(
    "wrong", [{"feed_size": 0}, {"max_cycles": 0}, {"commit_every_s": math.nan}]
)
def test_a_limit_that_makes_no_sense_is_refused(path, wrong):
    with pytest.raises(ValueError, match=next(iter(wrong)).removeprefix("feed_")):
        HistoryWriter(path, RUN, **wrong)
