import numpy as np
import pytest

from thermoctl.studies import record as record_module
from thermoctl.studies.csv_record import LONGEST_LINE, read_csv
from thermoctl.studies.record import Columns, RecordError

NAMED = Columns(output="y", input="u", time="t")


def rows(count, start=0):
    return "".join(f"{k},{k % 3},{20 + 0.1 * k}\n" for k in range(start, start + count))


@pytest.fixture
def write(tmp_path):
    def write(content):
        path = tmp_path / "run.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def test_sound_rows_are_read_as_they_stand(write):
    record = read_csv(write("t,u,y\n" + rows(5)), NAMED)
    assert record.t_s.tolist() == [0, 1, 2, 3, 4]
    assert record.u.tolist() == [0, 1, 2, 0, 1]
    np.testing.assert_allclose(record.y, [20.0, 20.1, 20.2, 20.3, 20.4])
    assert (record.skipped, record.notes) == (0, ())


@pytest.mark.parametrize(
    "bad",
    [
        *("5,1,nan", "5,1,inf", "5,,21", "5,1", "x,1,21", "5,1,--", "4,1,21", "-7,1,21", "5,1,2\0"),
        *("5,1,1e300", "5,-1e300,21", "1e300,1,21"),
    ],
)
def test_a_row_that_is_not_sound_is_left_out_and_named_with_its_line(write, bad):
    record = read_csv(write("t,u,y\n" + rows(5) + bad + "\n" + rows(5, start=6)), NAMED)
    assert record.t_s.tolist() == [0, 1, 2, 3, 4, 6, 7, 8, 9, 10]
    assert record.skipped == 1
    assert any("1 row left out" in note and "line 7" in note for note in record.notes)


def test_only_the_first_of_many_bad_rows_is_named(write):
    content = "t,u,y\n" + rows(3) + "bad\n" * 40 + rows(3, start=3)
    record = read_csv(write(content), NAMED)
    assert record.skipped == 40
    note = next(note for note in record.notes if "left out" in note)
    assert "line 5" in note
    assert "line 6" not in note


def test_a_time_since_1970_that_goes_back_is_told_to_the_second(write):
    since_1970 = "".join(f"{t},1,20\n" for t in (1795342968, 1795342970, 1795342969, 1795342971))
    record = read_csv(write("t,u,y\n" + since_1970), NAMED)
    assert any("1795342969 s does not lie after 1795342970 s" in note for note in record.notes)


def test_a_hole_where_rows_were_left_out_begins_a_new_stretch(write):
    record = read_csv(write("t,u,y\n" + rows(4) + "4,1,nan\n" + rows(4, start=5)), NAMED)
    assert record.stretch_start.tolist() == [0, 0, 0, 0, 4, 4, 4, 4]
    assert any("1 gap" in note for note in record.notes)


def test_rows_left_out_of_a_file_without_time_leave_a_hole_as_well(write):
    content = "u,y\n" + "1,20\n2,21\n3,22\n4,nan\n5,24\n6,25\n"
    record = read_csv(write(content), Columns(output="y", input="u"))
    assert record.names.time is None
    assert record.stretch_start.tolist() == [0, 0, 0, 3, 3]
    assert any("evenly spaced" in note for note in record.notes)


def test_an_obvious_time_column_is_taken_and_said(write):
    record = read_csv(write("time_s,u,y\n0,1,20\n2,1,21\n4,1,22\n"), Columns("y", "u"))
    assert record.period_s == 2.0
    assert "time taken from column 'time_s'" in record.notes


@pytest.mark.parametrize("header", ["temperature_c,power", "power,temperature_c,accepted_power"])
def test_the_columns_this_program_writes_itself_need_not_be_named(write, header):
    row = ",".join(["0.5"] * header.count(",")) + ",0.5\n"
    record = read_csv(write(f"{header}\n{row}{row}"), Columns())
    assert record.names.output == "temperature_c"
    assert record.names.input == header.split(",")[-1]


def test_a_header_is_told_short_and_without_what_would_steer_a_terminal(write):
    header = ",".join(["\x1b[2J", "x" * 500, *(f"c{k}" for k in range(5000))])
    with pytest.raises(RecordError, match=r"x1b.*, c0, .* and 4990 more$") as told:
        read_csv(write(header + "\n"), Columns())
    assert str(told.value).isprintable()
    assert len(str(told.value)) < 300


def test_uneven_sampling_is_noticed_and_even_sampling_is_not(write):
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.7, 1.3, 200))
    lines = "".join(f"{value},0,{value}\n" for value in t)
    assert any("not uniform" in note for note in read_csv(write("t,u,y\n" + lines), NAMED).notes)
    assert not read_csv(write("t,u,y\n" + rows(200)), NAMED).notes


@pytest.mark.parametrize(
    "content",
    [
        "t;u;y\n0;1,5;20,25\n1;2;21\n",
        "t\tu\ty\n0\t1.5\t20.25\n1\t2\t21\n",
        "\ufefft,u,y\r\n0,1.5,20.25\r\n1,2,21\r\n",
        '# a remark\n\n"t","u","y"\n"0","1.5","20.25"\n# another\n\n1,2,21\n',
        " t , u , y \n0, 1.5, 20.25\n1, 2, 21",
    ],
)
def test_dialects_of_csv_give_the_same_record(write, content):
    record = read_csv(write(content), NAMED)
    assert (record.t_s.tolist(), record.u.tolist(), record.y.tolist()) == (
        [0, 1],
        [1.5, 2],
        [20.25, 21],
    )


def test_dates_become_seconds_whatever_their_offset(write):
    content = (
        "t,u,y\n2026-03-01T12:00:00+00:00,0,20\n2026-03-01T14:00:05+02:00,0,21\n"
        "2026-03-01T12:00:10Z,0,22\nyesterday,0,23\n"
    )
    record = read_csv(write(content), NAMED)
    assert record.t_s.tolist() == [0, 5, 10]
    assert any("'yesterday', neither seconds nor ISO 8601" in note for note in record.notes)


def test_a_date_without_an_offset_is_utc(write):
    content = "t,u,y\n2026-03-01T12:00:00,0,20\n2026-03-01T13:00:05+01:00,0,21\n"
    assert read_csv(write(content), NAMED).t_s.tolist() == [0, 5]


@pytest.mark.parametrize("role", ["output", "input", "time"])
def test_a_missing_column_is_answered_with_those_that_are_there(write, role):
    wanted = Columns(**{"output": "y", "input": "u", "time": "t", role: "nope"})
    with pytest.raises(RecordError, match=r"'nope' for the .*has t, u, y"):
        read_csv(write("t,u,y\n" + rows(5)), wanted)


def test_output_and_input_are_never_guessed_from_unknown_names(write):
    path = write("t,u,y\n" + rows(5))
    with pytest.raises(RecordError, match="name of the output column"):
        read_csv(path, Columns())
    with pytest.raises(RecordError, match="name of the input column"):
        read_csv(path, Columns(output="y"))


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ("", "empty file"),
        ("\n\n# only a remark\n", "empty file"),
        (b"\x7fELF\x02\x01\x01\0\0", "binary"),
        ("1,2,3\n4,5,6\n", "column names, got '1,2,3'"),
        ("t,u,y\n", "0 of 0 rows are sound"),
        ("t,u,y\n0,1,20\n", "1 of 1 rows are sound"),
        ("t,u,y\n" + "0,nan,nan\n" * 9, "0 of 9 rows are sound; first problem in line 2: u is"),
    ],
)
def test_a_file_without_a_record_is_refused_with_the_reason(write, content, why):
    with pytest.raises(RecordError, match=why):
        read_csv(write(content), NAMED)


def test_an_endless_line_does_not_fill_the_memory(write):
    content = "t,u,y\n" + rows(3) + "9" * (3 * LONGEST_LINE) + "\n" + rows(3, start=3)
    record = read_csv(write(content), NAMED)
    assert record.t_s.tolist() == [0, 1, 2, 3, 4, 5]


def test_a_quote_that_never_closes_ends_the_reading_and_is_said(write):
    content = "t,u,y\n" + rows(5) + '5,1,"' + rows(20_000)
    record = read_csv(write(content), NAMED)
    assert len(record.t_s) == 5
    assert any("reading ended in line 7" in note for note in record.notes)


def test_reading_ends_at_the_limit_and_says_so(write, monkeypatch):
    monkeypatch.setattr(record_module, "MAX_ROWS", 10)
    record = read_csv(write("t,u,y\n" + rows(50)), NAMED)
    assert len(record.t_s) == 10
    assert any("reading ended in line 12" in note for note in record.notes)


def test_bytes_that_are_no_utf_8_spoil_only_their_field(write):
    content = b"t,u,y,\xb0C\n0,1,20,x\n1,1,\xff,x\n2,1,21,x\n"
    record = read_csv(write(content), NAMED)
    assert record.t_s.tolist() == [0, 2]


def test_time_begins_at_zero_wherever_the_clock_stood(write):
    record = read_csv(write("t,u,y\n1700000000.5,1,20\n1700000001.5,1,21\n"), NAMED)
    assert record.t_s.tolist() == [0, 1]
