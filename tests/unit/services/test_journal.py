"""The journal: an event becomes one line or one message, and nobody waits for the sink."""

from __future__ import annotations

import io
import json
import math
import os
import pty
import re
import socket
import struct
import threading

import numpy as np
import pytest
import structlog
from hypothesis import example, given, settings
from hypothesis import strategies as st

from thermoctl.services.events import PRIORITIES
from thermoctl.services.journal import Journal, human_sink, json_sink, native, native_sink, sink_for
from thermoctl.signals import Event

OPEN = Event(12.5, "sensor.open", {"counts": 1023.0, "limit": 1020})


def lines_of(sink_of, *events, wall_clock=lambda: 1.7e9, loop="tank"):
    """Return what a journal writes through `sink_of(descriptor)` for `events`."""
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as pipe:
        journal = Journal(sink_of(writing), wall_clock=wall_clock)
        for event in events:
            journal.emit(event, loop)
        journal.write_waiting()
        os.close(writing)
        return pipe.read().decode().splitlines()


def parsed(message: bytes) -> dict[str, str]:
    """Read journald's native protocol as journald does."""
    fields, stream = {}, io.BytesIO(message)
    while line := stream.readline():
        name, equals, value = line[:-1].partition(b"=")
        if not equals:
            (length,) = struct.unpack("<Q", stream.read(8))
            value = stream.read(length)
            assert stream.read(1) == b"\n"
        fields[name.decode()] = value.decode()
    return fields


def test_an_event_is_one_json_object_a_line():
    (line,) = lines_of(json_sink, OPEN)
    assert json.loads(line) == {
        "timestamp": "2023-11-14T22:13:20.000+00:00",
        "level": "error",
        "event": "sensor.open",
        "loop": "tank",
        "counts": 1023.0,
        "limit": 1020,
        "t_s": 12.5,
    }
    assert list(json.loads(line))[:4] == ["timestamp", "level", "event", "loop"]


def test_an_event_is_one_line_for_people():
    (line,) = lines_of(lambda fd: human_sink(fd, colors=False), OPEN)
    assert re.search(r"error\s+. sensor.open\s+counts=1023 limit=1020 t_s=12.5 loop=tank", line)


def test_colours_come_and_go():
    (plain,) = lines_of(lambda fd: human_sink(fd, colors=False), OPEN)
    (coloured,) = lines_of(lambda fd: human_sink(fd, colors=True), OPEN)
    assert "\x1b[" in coloured
    assert "\x1b[" not in plain


values = st.one_of(
    st.floats(),
    st.integers(),
    st.text(st.characters(exclude_categories=())),
    st.binary(),
    st.none(),
    st.floats(width=32).map(np.float32),
    st.lists(st.floats()).map(np.array),
    st.dictionaries(st.text(), st.floats()),
)


@given(fields=st.dictionaries(st.text(st.characters(exclude_categories=())), values, max_size=4))
@example(fields={"\ud800": "\ud800", "\x1b": "\x1b[2J", "x": np.array([math.nan])})
@settings(max_examples=150, deadline=None)
@pytest.mark.parametrize("sink_of", [json_sink, lambda fd: human_sink(fd, colors=False)])
def test_whatever_the_fields_hold_an_event_is_one_line(sink_of, fields):
    assert len(lines_of(sink_of, Event(1.0, "loop.started", fields))) == 1


@given(fields=st.dictionaries(st.text(st.characters(exclude_categories=())), values, max_size=4))
@example(fields={"\ud800": "\ud800", "\x1b": "\x1b[2J", "x": np.array([math.nan])})
@settings(max_examples=150, deadline=None)
def test_whatever_the_fields_hold_a_native_message_can_be_parsed(fields):
    record = {**fields, "timestamp": "t", "level": "error", "event": "loop.started"}
    message = parsed(native(record))
    assert message["THERMOCTL_EVENT"] == "loop.started"
    assert message["PRIORITY"] == "3"
    assert all(re.fullmatch(r"[A-Z][A-Z0-9_]{0,63}", name) for name in message)


def test_journald_receives_native_fields(tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as journald:
        journald.bind(str(tmp_path / "socket"))
        journald.settimeout(10.0)
        journal = Journal(native_sink(str(tmp_path / "socket")))
        journal.emit(Event(12.5, "sensor.open", {"text": "one\ntwo"}), "tank")
        journal.write_waiting()
        assert parsed(journald.recv(65536)) == {
            "MESSAGE": r"tank: sensor.open text=one\ntwo t_s=12.5",
            "PRIORITY": "3",
            "SYSLOG_IDENTIFIER": "thermoctl",
            "THERMOCTL_EVENT": "sensor.open",
            "THERMOCTL_LOOP": "tank",
            "THERMOCTL_TEXT": "one\ntwo",
            "THERMOCTL_T_S": "12.5",
        }


def test_journald_may_go_away_and_come_back(tmp_path):
    place = tmp_path / "socket"
    journal = Journal(native_sink(str(place)))
    journal.emit(OPEN)
    journal.write_waiting()
    assert journal.dropped == 1
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as journald:
        journald.bind(str(place))
        journald.settimeout(10.0)
        journal.emit(OPEN)
        journal.write_waiting()
        messages = [parsed(journald.recv(65536)) for _ in range(2)]
    assert [message["THERMOCTL_EVENT"] for message in messages] == ["journal.drops", "sensor.open"]
    assert messages[0]["THERMOCTL_TOTAL"] == "1"


@pytest.mark.parametrize(
    ("inode_off_by", "socket_name", "to_journald"),
    [(0, "socket", True), (1, "socket", False), (0, "none", False)],
)
def test_native_fields_go_to_journald_only_where_it_reads_our_stderr(
    tmp_path, inode_off_by, socket_name, to_journald
):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as journald:
        journald.bind(str(tmp_path / "socket"))
        journald.settimeout(10.0)
        with (tmp_path / "log").open("wb") as stream:
            status = os.fstat(stream.fileno())
            environ = {"JOURNAL_STREAM": f"{status.st_dev}:{status.st_ino + inode_off_by}"}
            journal = Journal(sink_for(stream.fileno(), environ, str(tmp_path / socket_name)))
            journal.emit(OPEN)
            journal.write_waiting()
        if to_journald:
            assert parsed(journald.recv(65536))["THERMOCTL_EVENT"] == "sensor.open"
    assert ((tmp_path / "log").stat().st_size == 0) is to_journald


@pytest.mark.parametrize(("environ", "coloured"), [({}, True), ({"NO_COLOR": "1"}, False)])
def test_a_terminal_gets_lines_for_people(environ, coloured):
    master, slave = pty.openpty()
    sink_for(slave, environ)({"timestamp": "t", "level": "info", "event": "loop.started"})
    line = os.read(master, 4096)
    os.close(slave)
    os.close(master)
    assert b"loop.started" in line
    assert (b"\x1b[" in line) is coloured


def test_every_event_is_written_or_counted_while_the_target_is_blocked():
    reading, writing = os.pipe()
    journal = Journal(json_sink(writing), feed_size=50)
    journal.start()
    for number in range(3000):  # a pipe holds 64 KiB, so a loop that waited would hang here
        journal.emit(Event(float(number), "state.changed", {"why": "x" * 1000}))
    assert not journal.close(timeout_s=0.01)
    lines: list[bytes] = []
    with os.fdopen(reading, "rb") as pipe:
        reader = threading.Thread(target=lambda: lines.extend(pipe))
        reader.start()
        assert journal.close(timeout_s=60.0)
        os.close(writing)
        reader.join()
    names = [json.loads(line)["event"] for line in lines]
    assert journal.dropped > 0
    assert names.count("state.changed") + journal.dropped == 3000
    assert "journal.drops" in names


def test_a_target_that_is_gone_costs_lines_only():
    reading, writing = os.pipe()
    os.close(reading)
    journal = Journal(json_sink(writing))
    journal.emit(OPEN)
    journal.write_waiting()
    os.close(writing)
    assert journal.dropped == 1


def test_structlog_loggers_end_in_the_same_journal():
    written = []
    journal = Journal(written.append, wall_clock=lambda: 0.0)
    journal.configure()
    try:
        structlog.get_logger().warning("history.drops", dropped=3, loop="tank")
    finally:
        structlog.reset_defaults()
    journal.write_waiting()
    assert written == [
        {
            "timestamp": "1970-01-01T00:00:00.000+00:00",
            "level": "warning",
            "event": "history.drops",
            "loop": "tank",
            "dropped": 3,
        }
    ]


def test_a_wall_clock_out_of_all_bounds_costs_the_line_only():
    written = []
    times = iter([math.inf, 1e30])
    journal = Journal(written.append, wall_clock=lambda: next(times, 1.0))
    for _ in range(3):
        journal.emit(OPEN)
    journal.write_waiting()
    assert [record["event"] for record in written if record["event"] == "sensor.open"]
    assert journal.dropped == 2


def test_every_level_has_a_syslog_priority_in_order_of_gravity():
    assert list(PRIORITIES.values()) == sorted(PRIORITIES.values())
