"""Faults 41 to 45: whatever happens to the history's file, the loop goes on and so does it."""

from __future__ import annotations

import json
import math
import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from thermoctl.services.history import HistoryWriter, RunInfo, open_history, read_history
from thermoctl.services.history.schema import SCHEMA_VERSION
from thermoctl.signals import (
    Command,
    Cycle,
    Estimate,
    Event,
    Measurement,
    Mode,
    State,
    Step,
)

pytestmark = pytest.mark.usefixtures("histories_closed")

RUN = RunInfo("1.0", '{"loops": {}}')
BELIEF = Estimate(np.zeros(2), np.eye(2))


def cycle_at(t_s: float) -> Cycle:
    command = Command(0.5, t_s + 3.0, "control")
    step = Step(
        t_s, Measurement(t_s, 40.0), Mode.AUTO, State.RUN, 41.0, command, "self-tuning-mv", BELIEF
    )
    return Cycle("tank", step, 0.5)


def record(path: Path, first: int, count: int, told: list[Event] | None = None) -> HistoryWriter:
    """Store `count` cycles from `first` on, one a second, and return the writer."""
    report = None if told is None else told.append
    writer = HistoryWriter(path, RUN, report=report)
    for t_s in range(first, first + count):
        writer.publish(cycle_at(float(t_s)))
    writer.store_waiting()
    return writer


def stored_times(path: Path) -> list[float]:
    times: list[float] = read_history(path).columns["t_s"].tolist()
    return times


def closed_history(path: Path, cycles: int) -> None:
    """Leave a whole history of `cycles` behind, all of it in the one file."""
    record(path, 0, cycles)
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()


def foreign(path: Path) -> None:
    connection = sqlite3.connect(path)
    connection.execute("CREATE TABLE recipes (name TEXT)")
    connection.commit()
    connection.close()


def newer(path: Path) -> None:
    connection = open_history(path).connection
    connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION + 1}")
    connection.close()


def truncated(path: Path) -> None:
    closed_history(path, 500)
    with path.open("r+b") as stream:
        stream.truncate(path.stat().st_size // 2)


def zeroed_inside(path: Path) -> None:
    closed_history(path, 500)
    with path.open("r+b") as stream:
        stream.seek(path.stat().st_size // 2)
        stream.write(b"\0" * 8192)


DAMAGE = {
    "garbage": lambda path: path.write_bytes(b"not a database at all" * 300),
    "truncated": truncated,
    "zeroed inside": zeroed_inside,
    "another program's": foreign,
    "newer schema": newer,
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_file_of_no_use_is_set_aside_whole_and_a_new_one_begun(tmp_path, damage):
    path = tmp_path / "history.sqlite"
    damage(path)
    before = path.read_bytes()
    told: list[Event] = []
    writer = record(path, 0, 10, told)
    assert stored_times(path) == list(range(10))
    (aside,) = tmp_path.glob("history-set-aside-*Z.sqlite")
    assert aside.read_bytes() == before
    (event,) = told
    assert event.name == "history.set_aside"
    assert event.fields["path"] == str(aside)
    assert event.fields["why"]
    assert writer.health().counters["set_aside"] == 1
    assert writer.health().counters["dropped"] == 0


def test_two_files_set_aside_in_one_second_are_both_kept(tmp_path):
    path = tmp_path / "history.sqlite"
    for content in (b"first" * 300, b"second" * 300):
        path.write_bytes(content)
        open_history(path, wall_clock=lambda: 0.0).connection.close()
    assert {aside.read_bytes()[:5] for aside in tmp_path.glob("*-set-aside-*")} == {
        b"first",
        b"secon",
    }


def test_an_empty_file_becomes_a_history(tmp_path):
    path = tmp_path / "history.sqlite"
    path.write_bytes(b"")
    record(path, 0, 3)
    assert stored_times(path) == [0, 1, 2]
    assert list(tmp_path.glob("*-set-aside-*")) == []


def overwrite(path: Path) -> None:
    with path.open("r+b") as stream:
        stream.write(b"\xff" * path.stat().st_size)


@pytest.mark.parametrize(
    "damage",
    [overwrite, lambda path: os.truncate(path, 0), lambda path: os.truncate(path, 9000)],
    ids=["overwritten", "emptied", "truncated"],
)
def test_a_file_damaged_while_it_is_written_is_set_aside_within_a_minute(tmp_path, damage):
    path = tmp_path / "history.sqlite"
    closed_history(path, 500)
    told: list[Event] = []
    writer = record(path, 500, 10, told)
    assert writer.store_waiting()
    damage(path)
    for t_s in range(510, 571):
        writer.publish(cycle_at(float(t_s)))
        assert writer.store_waiting()
    writer.close()
    assert stored_times(path)[-1] == 570.0
    assert [event.name for event in told] == ["history.set_aside"]
    assert len(list(tmp_path.glob("*-set-aside-*Z.sqlite"))) == 1


def test_a_file_removed_while_it_is_written_is_begun_anew(tmp_path):
    path = tmp_path / "history.sqlite"
    writer = record(path, 0, 5)
    for file in list(tmp_path.iterdir()):
        file.unlink()
    writer.publish(cycle_at(5.0))
    assert writer.store_waiting()
    assert stored_times(path) == [5.0]
    assert next(iter(read_history(path).runs.values())).version == "1.0"


def test_a_folder_in_its_place_is_waited_for(tmp_path):
    path = tmp_path / "history.sqlite"
    path.mkdir()
    told: list[Event] = []
    writer = record(path, 0, 3, told)
    assert writer.health().counters["waiting"] == 4  # three cycles and the event of the failure
    path.rmdir()
    assert writer.store_waiting()
    assert stored_times(path) == [0, 1, 2]
    assert [event.name for event in told] == ["history.failed", "history.recovered"]


def test_a_locked_file_costs_the_publisher_nothing_and_loses_no_cycle(tmp_path):
    path = tmp_path / "history.sqlite"
    writer = record(path, 0, 1)
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    writer.start()
    for t_s in range(1, 1001):  # were publishing to wait for the lock, this would never end
        writer.publish(cycle_at(float(t_s)))
    assert not writer.close(timeout_s=0.0)
    other.execute("COMMIT")
    other.close()
    writer.close(timeout_s=30.0)
    writer.store_waiting()  # had the last attempt met the lock, this is the one after it
    assert stored_times(path) == list(range(1001))
    assert writer.health().counters["dropped"] == 0


@pytest.mark.slow
def test_a_lock_held_for_long_drops_the_oldest_counts_and_says_so_once(tmp_path):
    path = tmp_path / "history.sqlite"
    record(path, 0, 1)
    told: list[Event] = []
    writer = HistoryWriter(path, RUN, report=told.append, feed_size=10)
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    for t_s in range(100, 140):
        writer.publish(cycle_at(float(t_s)))
    writer.store_waiting()
    health = writer.health()
    assert health.counters["dropped"] == 30
    assert "locked" in str(health.last_error)
    other.execute("COMMIT")
    other.close()
    assert writer.store_waiting()
    assert writer.health().last_error is None
    assert stored_times(path) == [0.0, *range(130, 140)]
    assert [event.name for event in told] == [
        "history.failed",
        "history.drops",
        "history.recovered",
    ]


KILLED = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from test_storage_history import HistoryWriter, RUN, cycle_at
writer = HistoryWriter(Path(sys.argv[1]), RUN)
for t_s in range(10**9):
    writer.publish(cycle_at(float(t_s)))
    if t_s % 7 == 6:
        writer.store_waiting()
        print(t_s, flush=True)
"""


@pytest.mark.parametrize("commits", [1, 2, 40])
def test_a_killed_writer_leaves_every_committed_cycle(tmp_path, commits):
    path = tmp_path / "history.sqlite"
    command = [sys.executable, "-c", KILLED, str(path), str(Path(__file__).parent)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = [int(process.stdout.readline()) for _ in range(commits)]
        process.kill()
    times = stored_times(path)
    assert times == list(range(len(times)))
    assert len(times) > said[-1]
    assert open_history(path).set_aside is None


# A small file system of its own, full, freed, read-only and writable again: in a process that has
# its own mount table, so nothing outside of it is touched.
SMALL_DISK = """
import json, subprocess, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from test_storage_history import HistoryWriter, RUN, cycle_at, read_history, stored_times
from thermoctl.services.store import Latch, LatchStore
disk = Path(sys.argv[1])
def mount(*options):
    subprocess.run(["mount", *options, str(disk)], check=True)
mount("-t", "tmpfs", "-o", "size=512k", "tmpfs")
path, told, seen, t_s = disk / "history.sqlite", [], [], 0
writer = HistoryWriter(path, RUN, report=lambda event: told.append(event.name), feed_size=200)
latches = LatchStore(disk, disk.parent / "run")
def go(count):
    global t_s
    for _ in range(count):
        writer.publish(cycle_at(float(t_s)))
        t_s += 1
    writer.store_waiting()
    health = writer.health()
    seen.append({"error": health.last_error, **health.counters, "published": t_s})
go(50)
with (disk / "ballast").open("wb", buffering=0) as ballast:
    try:
        while True:
            ballast.write(b"x" * 1024)
    except OSError:
        pass
for _ in range(20):
    go(150)
(disk / "ballast").unlink()
go(10)
writer.close()  # a file that is open for writing keeps the disk writable
mount("-o", "remount,ro")
writer = HistoryWriter(path, RUN, report=lambda event: told.append(event.name), feed_size=200)
go(10)
held = latches.save("tank", Latch("sensor.open", "text"))
found = latches.load("tank") is not None
mount("-o", "remount,rw")
go(10)
print(json.dumps({"told": told, "seen": seen, "held": held, "found": found,
                  "times": stored_times(path), "runs": len(read_history(path).runs)}))
"""


@pytest.fixture(scope="module")
def small_disk(tmp_path_factory):
    """Return what happened on a disk that was filled, freed and made read-only for a while."""
    folder = tmp_path_factory.mktemp("disk")
    (folder / "small").mkdir()
    script = [sys.executable, "-c", SMALL_DISK, str(folder / "small"), str(Path(__file__).parent)]
    try:
        probe = subprocess.run(
            ["unshare", "-rm", "mount", "-t", "tmpfs", "tmpfs", str(folder)], capture_output=True
        )
    except FileNotFoundError:
        pytest.skip("unshare is not installed, so there is no small disk to fill")
    if probe.returncode:
        pytest.skip(f"no file system may be mounted here: {probe.stderr.decode().strip()}")
    done = subprocess.run(["unshare", "-rm", *script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_on_a_full_disk_cycles_are_counted_and_recording_recovers_by_itself(small_disk):
    before, *full = small_disk["seen"][:21]
    assert before["error"] is None
    assert "full" in full[-1]["error"]
    assert full[-1]["dropped"] > 0
    assert full[-1]["waiting"] <= 400
    freed = small_disk["seen"][21]
    assert freed["error"] is None
    assert freed["waiting"] <= 1  # the event that says so
    assert small_disk["told"][:3] == ["history.failed", "history.drops", "history.recovered"]


def test_a_run_stays_one_run_through_every_failure(small_disk):
    assert small_disk["runs"] == 2  # one before the writer was closed, one after


def test_on_a_read_only_disk_cycles_wait_and_none_is_lost(small_disk):
    _, read_only, writable = small_disk["seen"][21:]
    assert read_only["error"] is not None
    assert read_only["waiting"] >= 10
    assert writable["error"] is None
    assert writable["dropped"] == 0
    last = small_disk["times"][-30:]
    assert last == list(range(writable["published"] - 30, writable["published"]))


def test_on_a_read_only_disk_the_spare_folder_holds_the_latch(small_disk):
    assert small_disk["held"] is False
    assert small_disk["found"] is True


def test_a_broken_truth_costs_its_cycle_only(tmp_path):
    broken = cycle_at(1.0)
    object.__setattr__(broken, "truth", {"true_temperature_c": "warm"})
    writer = HistoryWriter(tmp_path / "h.sqlite", RUN)
    for cycle in (cycle_at(0.0), broken, cycle_at(2.0)):
        writer.publish(cycle)
    assert writer.store_waiting()
    assert stored_times(tmp_path / "h.sqlite") == [0.0, 2.0]
    assert writer.health().counters["dropped"] == 1
    assert not math.isnan(writer.health().last_good_s or math.nan)
