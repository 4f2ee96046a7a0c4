import math

import numpy as np
import pytest

from thermoctl.errors import Unavailable
from thermoctl.services.history import HistoryWriter, RunInfo
from thermoctl.signals import Command, Cycle, Estimate, Measurement, Mode, State, Step
from thermoctl.studies.history_record import is_history, read_history_record
from thermoctl.studies.record import Columns, RecordError

pytestmark = pytest.mark.usefixtures("histories_closed")


def cycle(t_s, loop="tank", temperature_c=None, accepted=None):
    temperature_c = 25.0 + 0.01 * t_s if temperature_c is None else temperature_c
    step = Step(
        t_s=t_s,
        measurement=Measurement(t_s, temperature_c),
        mode=Mode.AUTO,
        state=State.RUN,
        setpoint_c=37.5,
        command=Command(0.9, t_s + 2.0, "control"),
        controller="self-tuning-mv",
        estimate=Estimate(np.zeros(1), np.eye(1)),
    )
    return Cycle(loop, step, accepted_power=t_s % 2 / 2 if accepted is None else accepted)


@pytest.fixture
def write(tmp_path):
    def write(*runs):
        """Write runs, each a wall clock at its beginning and its cycles."""
        path = tmp_path / "history.sqlite"
        for begin_s, cycles in runs:
            now = [begin_s]
            writer = HistoryWriter(path, RunInfo("1.0"), wall_clock=lambda now=now: now[0])
            for one in cycles:
                now[0] = begin_s + one.step.t_s
                writer.publish(one)
            assert writer.store_waiting()
        return path

    return write


def test_a_history_is_read_without_naming_a_column(write):
    path = write((1e9, [cycle(float(k)) for k in range(5)]))
    assert is_history(path)
    record = read_history_record(path, Columns())
    assert record.t_s.tolist() == [0, 1, 2, 3, 4]
    assert record.u.tolist() == [0, 0.5, 0, 0.5, 0]
    np.testing.assert_allclose(record.y, [25.0, 25.01, 25.02, 25.03, 25.04])
    assert record.names == Columns("temperature_c", "accepted_power", "t_s")


def test_other_columns_of_numbers_may_be_replayed(write):
    path = write((1e9, [cycle(float(k)) for k in range(5)]))
    record = read_history_record(path, Columns(output="setpoint_c", input="power"))
    assert set(record.y) == {37.5}
    assert set(record.u) == {0.9}


def test_a_column_of_words_cannot_be_replayed(write):
    path = write((1e9, [cycle(0.0), cycle(1.0)]))
    with pytest.raises(RecordError, match=r"'mode' for the output.*temperature_c"):
        read_history_record(path, Columns(output="mode"))


def test_cycles_without_a_reading_or_an_accepted_power_are_left_out(write):
    cycles = [cycle(float(k)) for k in range(10)]
    cycles[3] = cycle(3.0, temperature_c=math.nan)
    cycles[6] = cycle(6.0, accepted=math.nan)
    record = read_history_record(write((1e9, cycles)), Columns())
    assert record.t_s.tolist() == [0, 1, 2, 4, 5, 7, 8, 9]
    assert record.skipped == 2
    assert any("cycle 4: temperature_c is not known" in note for note in record.notes)


def test_several_loops_must_be_told_apart(write):
    cycles = [cycle(float(k), loop=loop) for k in range(4) for loop in ("tank", "mash")]
    path = write((1e9, cycles))
    with pytest.raises(RecordError, match="--loop, one of mash, tank"):
        read_history_record(path, Columns())
    assert len(read_history_record(path, Columns(), loop="mash").t_s) == 4
    with pytest.raises(Unavailable, match="oven"):
        read_history_record(path, Columns(), loop="oven")


def test_a_restart_is_a_gap_as_long_as_the_wall_clock_says(write):
    first = [cycle(float(k)) for k in range(100, 105)]
    path = write((1e9, first), (1e9 + 4000.0, [cycle(float(k)) for k in range(5)]))
    record = read_history_record(path, Columns())
    assert record.t_s.tolist() == [0, 1, 2, 3, 4, 3900, 3901, 3902, 3903, 3904]
    assert record.stretch_start.tolist() == [0] * 5 + [5] * 5


def test_a_run_that_began_before_the_last_one_ended_is_put_behind_it_whole(write):
    # a bench test makes an hour in a minute of the wall clock, and the next one follows at once
    first, second = ([cycle(float(k)) for k in range(5)] for _ in range(2))
    record = read_history_record(write((1e9, first), (1e9 + 2.0, second)), Columns())
    assert record.t_s.tolist() == [0, 1, 2, 3, 4, 14, 15, 16, 17, 18]
    assert record.stretch_start.tolist() == [0] * 5 + [5] * 5
    assert record.skipped == 0
    assert any("overlap by the wall clock: 1" in note for note in record.notes)


def test_two_runs_that_wrote_in_turns_are_told_apart(tmp_path):
    writers = [
        HistoryWriter(tmp_path / "h.sqlite", RunInfo(version), wall_clock=lambda: 1e9)
        for version in ("1.0", "1.1")
    ]
    for k in range(4):
        for number, writer in enumerate(writers):
            writer.publish(cycle(float(k), temperature_c=20.0 + number))
            assert writer.store_waiting()
    record = read_history_record(tmp_path / "h.sqlite", Columns())
    assert record.y.tolist() == [20.0] * 4 + [21.0] * 4
    assert record.stretch_start.tolist() == [0] * 4 + [4] * 4


def test_a_wall_clock_that_is_set_does_not_tear_a_run(tmp_path):
    now = [1e9]
    writer = HistoryWriter(tmp_path / "h.sqlite", RunInfo("1.0"), wall_clock=lambda: now[0])
    for k in range(6):
        now[0] += 1.0 if k != 3 else 7200.0
        writer.publish(cycle(float(k)))
    assert writer.store_waiting()
    record = read_history_record(tmp_path / "h.sqlite", Columns())
    assert record.t_s.tolist() == [0, 1, 2, 3, 4, 5]


def test_text_is_no_history(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t,u,y\n")
    assert not is_history(path)
