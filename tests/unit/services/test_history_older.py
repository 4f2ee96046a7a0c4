"""A history that an older thermoctl began: read as it is, gone on with, its rows kept."""

from __future__ import annotations

import csv
import io
import math
import sqlite3
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from thermoctl.services.history import HistoryWriter, RunInfo, export, open_history, read_history
from thermoctl.services.history.schema import SCHEMA_VERSION
from thermoctl.signals import Beliefs

pytestmark = pytest.mark.usefixtures("histories_closed")

FIRST_SCHEMA = """
CREATE TABLE runs (
    id INTEGER PRIMARY KEY,
    started_utc_s REAL NOT NULL,
    version TEXT NOT NULL,
    configuration TEXT NOT NULL
);
CREATE TABLE cycles (
    id INTEGER PRIMARY KEY,
    run INTEGER NOT NULL REFERENCES runs (id),
    wall_utc_s REAL NOT NULL,
    loop TEXT, t_s REAL, mode TEXT, state TEXT, temperature_c REAL, quality TEXT, setpoint_c REAL,
    power REAL, accepted_power REAL, reason TEXT, controller TEXT, innovation_k REAL,
    innovation_var_k2 REAL, inflation REAL, rejected INTEGER, gain_k_per_s REAL,
    gain_sd_k_per_s REAL, a REAL, a_sd REAL, holding_power REAL, tick_us REAL, late_s REAL,
    missed INTEGER, alarms TEXT, true_temperature_c REAL, other_truth TEXT
);
CREATE INDEX cycles_by_wall ON cycles (wall_utc_s);
CREATE TABLE events (
    id INTEGER PRIMARY KEY,
    run INTEGER NOT NULL REFERENCES runs (id),
    wall_utc_s REAL NOT NULL,
    loop TEXT,
    t_s REAL NOT NULL,
    name TEXT NOT NULL,
    fields TEXT NOT NULL
);
CREATE TABLE clock_steps (
    id INTEGER PRIMARY KEY,
    run INTEGER NOT NULL REFERENCES runs (id),
    wall_utc_s REAL NOT NULL,
    t_s REAL NOT NULL,
    step_s REAL NOT NULL
);
INSERT INTO runs VALUES (1, 1.7e9, '0.1.0', '{}');
INSERT INTO cycles (run, wall_utc_s, loop, t_s, controller, power)
    VALUES (1, 1.7e9, 'tank', 1.0, 'on-off', 0.25), (1, 1700000001.0, 'tank', 2.0, 'on-off', 0.5);
PRAGMA application_id = 0x7468726d;
PRAGMA user_version = 1;
"""


@pytest.fixture
def older(tmp_path):
    """Two cycles as the first schema kept them."""
    path = tmp_path / "history.sqlite"
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(FIRST_SCHEMA)
    return path


def shadowed(cycle):
    """Return `cycle` with a controller in shadow, and a lag that is known."""
    beliefs = Beliefs(gain=0.04, lag_s=18.5)
    return replace(
        cycle, step=replace(cycle.step, shadow="on-off", shadow_power=0.75, beliefs=beliefs)
    )


def test_an_older_file_is_read_as_it_is_with_nothing_in_the_columns_it_lacks(older):
    before = older.read_bytes()
    columns = read_history(older).columns
    assert columns["power"].tolist() == [0.25, 0.5]
    assert columns["shadow"].tolist() == [None, None]
    assert np.isnan(columns["shadow_power"]).all()
    assert np.isnan(columns["lag_s"]).all()
    assert np.isnan(columns["reference_c"]).all()
    assert older.read_bytes() == before


def test_an_older_file_is_gone_on_with_and_keeps_its_rows(older, cycle_at, wall_clock):
    told = []
    run = RunInfo("0.2.0", "{}")
    writer = HistoryWriter(older, run, wall_clock=wall_clock, report=told.append)
    wall_clock.utc_s = 1.7e9 + 2.0
    writer.publish(shadowed(cycle_at(3.0)))
    assert writer.store_waiting()
    writer.close()
    assert told == []
    columns = read_history(older).columns
    assert columns["t_s"].tolist() == [1.0, 2.0, 3.0]
    assert columns["power"].tolist() == [0.25, 0.5, 0.25]
    assert columns["shadow"].tolist() == [None, None, "on-off"]
    assert columns["shadow_power"].tolist()[2] == 0.75
    assert [math.isnan(lag_s) for lag_s in columns["lag_s"]] == [True, True, False]
    assert list(older.parent.glob("*-set-aside-*")) == []


SECOND = ("lag_s REAL", "shadow TEXT", "shadow_power REAL")
"""What the second schema has that the first lacks."""


def test_a_file_of_the_second_schema_gets_what_that_lacks_and_nothing_twice(older, cycle_at):
    with closing(sqlite3.connect(older)) as connection:
        for column in SECOND:
            connection.execute(f"ALTER TABLE cycles ADD COLUMN {column}")
        connection.execute("UPDATE cycles SET shadow = 'pid'")
        connection.execute("PRAGMA user_version = 2")
        connection.commit()
    assert read_history(older).columns["shadow"].tolist() == ["pid", "pid"]
    writer = HistoryWriter(older, RunInfo("0.3.0"))
    cycle = cycle_at(3.0)
    writer.publish(replace(cycle, step=replace(cycle.step, reference_c=39.5)))
    assert writer.store_waiting()
    writer.close()
    columns = read_history(older).columns
    assert columns["shadow"].tolist() == ["pid", "pid", None]
    assert columns["reference_c"].tolist()[2] == 39.5


def test_a_file_is_brought_up_to_date_once_and_opens_again(older):
    for _ in range(2):
        with closing(open_history(older).connection) as connection:
            assert connection.execute("PRAGMA user_version").fetchone() == (SCHEMA_VERSION,)
            assert connection.execute("SELECT count(*) FROM cycles").fetchone() == (2,)


@pytest.mark.slow
def test_a_file_that_cannot_be_brought_up_to_date_now_stays_as_it_was(older):
    with closing(sqlite3.connect(older)) as other:
        other.execute("PRAGMA journal_mode = WAL")
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(sqlite3.OperationalError, match="locked"):
            open_history(older)
    assert read_history(older).columns["t_s"].tolist() == [1.0, 2.0]


def test_an_export_shows_the_shadow_and_the_lag(tmp_path, cycle_at, wall_clock):
    path, out = tmp_path / "history.sqlite", io.StringIO()
    writer = HistoryWriter(path, RunInfo("0.2.0"), wall_clock=wall_clock)
    writer.publish(shadowed(cycle_at(3.0)))
    writer.publish(cycle_at(4.0))
    writer.close()
    export(path, out)
    first, second = csv.DictReader(io.StringIO(out.getvalue()))
    assert (first["shadow"], first["shadow_power"], first["lag_s"]) == ("on-off", "0.75", "18.5")
    assert (second["shadow"], second["shadow_power"], second["lag_s"]) == ("", "", "")
