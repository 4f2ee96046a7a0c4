"""The thermodaq driver against exchanges written down byte by byte."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from thermoctl.errors import (
    BoardConfigError,
    FaultError,
    LinkError,
    TransientError,
    WrongDevice,
)
from thermoctl.testing import ManualClock, Transcript, Turn
from thermoctl_drivers import thermodaq_frames as frames
from thermoctl_drivers.thermodaq import ThermoDaq, ThermoDaqSettings

DEADLINE_S = 0.2
LINE_S = 10 / 115_200
CONFIGURATION = "0 50 10 2500 10000"


def asks(sequence: int, letter: str, *arguments: int) -> bytes:
    return frames.request(sequence, letter, *arguments)


def says(body: str) -> bytes:
    return frames.frame(b"<", body.encode("ascii"))


def opening(hello: str = "thermodaq 1 1.0.0 7 1 03") -> list[Turn]:
    return [
        Turn(asks(1, "W", 0, 1), says("01 W 0 1 03")),
        Turn(asks(2, "H"), says(f"02 H {hello}")),
        Turn(asks(3, "C", 0, 50, 10, 2500, 10_000), says(f"03 C {CONFIGURATION}")),
    ]


def rig(*turns: Turn, **settings: object) -> tuple[ThermoDaq, Transcript, ManualClock]:
    """Return a driver that has been opened, and goes on with `turns`."""
    clock = ManualClock(100.0)
    line = Transcript(clock, [*opening(), *turns])
    chosen = ThermoDaqSettings.model_validate({"port": "transcript", **settings})
    board = ThermoDaq(chosen, line, clock)
    board.open(clock.now_s() + 5.0)
    return board, line, clock


def read(board: ThermoDaq, clock: ManualClock) -> float:
    """Return the counts of one read."""
    return board.read(clock.now_s() + DEADLINE_S)["temperature"].counts


def write(board: ThermoDaq, clock: ManualClock, power: float, valid_for_s: float = 2.5) -> float:
    return board.write({"heater": power}, valid_for_s, clock.now_s() + DEADLINE_S)["heater"]


def test_the_first_thing_written_is_power_zero() -> None:
    board, line, _ = rig()
    assert line.finished
    assert board.health().status == "ok"


def test_opening_goes_on_asking_while_the_boot_loader_is_silent() -> None:
    clock = ManualClock()
    silence = [Turn(asks(number, "W", 0, 1)) for number in range(1, 7)]
    awake = [
        Turn(asks(7, "W", 0, 1), says("07 W 0 1 03")),
        Turn(asks(8, "H"), says("08 H thermodaq 1 1.0.0 7 0 03")),
        Turn(asks(9, "C", 0, 50, 10, 2500, 10_000), says(f"09 C {CONFIGURATION}")),
    ]
    line = Transcript(clock, [*silence, *awake])
    identity = ThermoDaq(ThermoDaqSettings(port="p"), line, clock).open(5.0)
    assert (identity.kind, identity.name, identity.version) == ("thermodaq", "p unit 7", "1.0.0")
    assert 1.5 <= clock.now_s() <= 1.7


@pytest.mark.parametrize(
    ("hello", "unit"),
    [
        ("thermocouple 1 1.0.0 7 1 03", None),
        ("thermodaq 2 1.0.0 7 1 03", None),
        ("thermodaq 1 1.0.0 7 1 03", 8),
    ],
)
def test_another_product_protocol_or_unit_is_the_wrong_device(hello: str, unit: int | None) -> None:
    clock = ManualClock()
    line = Transcript(clock, opening(hello))
    board = ThermoDaq(ThermoDaqSettings(port="p", unit=unit), line, clock)
    with pytest.raises(WrongDevice, match="expected"):
        board.open(5.0)
    board.close()
    assert line.closed


def test_the_sample_is_dated_by_its_age_and_the_time_on_the_line() -> None:
    reply = says("04 R 203200 320 9 131 0 3 00")
    board, _, clock = rig(Turn(asks(4, "R"), reply, delay_s=0.006))
    sample = board.read(clock.now_s() + DEADLINE_S)["temperature"]
    assert sample.t_s == pytest.approx(clock.now_s() - 0.131 - len(reply) * LINE_S, abs=1e-9)
    assert (sample.counts, sample.full_scale, sample.sequence) == (203_200.0, 327_680.0, 9)


def test_an_unfinished_first_burst_is_an_input_that_did_not_answer() -> None:
    board, _, clock = rig(Turn(asks(4, "R"), says("04 R 0 0 0 0 0 3 00")))
    assert board.read(clock.now_s() + DEADLINE_S) == {}


def test_a_garbled_reply_is_asked_for_once_more() -> None:
    damaged = says("04 R 203200 320 9 131 0 3 00").replace(b"203200", b"203201")
    good = says("05 R 5 320 10 1 0 3 00")
    board, line, clock = rig(Turn(asks(4, "R"), damaged), Turn(asks(5, "R"), good))
    assert read(board, clock) == 5.0
    assert line.finished
    assert board.health().counters["garbled"] == 1


def test_two_garbled_replies_are_a_passing_error() -> None:
    board, line, clock = rig(
        Turn(asks(4, "R"), b"<04 R 1 32*0000\n"), Turn(asks(5, "R"), b"nonsense\n")
    )
    with pytest.raises(TransientError, match="nonsense"):
        read(board, clock)
    assert line.finished


def test_a_late_reply_is_dropped_and_not_taken_for_the_next() -> None:
    late = says("04 R 1 32 1 1 0 3 00")
    good = says("06 R 5 32 3 1 0 3 00")
    board, _, clock = rig(
        Turn(asks(4, "R"), late, delay_s=0.2),
        Turn(asks(5, "R")),  # silence: both attempts of this cycle are used up
        Turn(asks(6, "R"), good, delay_s=0.05),
    )
    with pytest.raises(TransientError):
        read(board, clock)
    assert read(board, clock) == 5.0  # the late one came first, while we waited for this one
    assert board.health().counters["dropped"] == 1


def test_a_doubled_reply_is_dropped_by_its_number() -> None:
    first = says("04 R 1 32 1 1 0 3 00")
    second = says("05 R 2 32 2 1 0 3 00")
    board, _, clock = rig(Turn(asks(4, "R"), first + first), Turn(asks(5, "R"), second))
    assert [read(board, clock), read(board, clock)] == [1.0, 2.0]
    assert board.health().counters["dropped"] == 1


def test_a_line_that_the_board_got_damaged_is_sent_again() -> None:
    board, line, clock = rig(
        Turn(asks(4, "W", 5000, 2500), says("-- E 3")),
        Turn(asks(5, "W", 5000, 2500), says("05 W 5000 2500 10")),
    )
    assert write(board, clock, 0.5) == 0.5
    assert line.finished


def test_a_refused_write_is_tried_three_times_and_then_a_fault() -> None:
    turns = [Turn(asks(n, "W", 5000, 2500), says(f"{n:02X} E 6")) for n in (4, 5, 6)]
    board, line, clock = rig(*turns)
    with pytest.raises(FaultError, match="6 range"):
        write(board, clock, 0.5)
    assert line.finished
    assert board.health().counters["refused"] == 3


def test_three_silences_are_a_passing_error_within_the_deadline() -> None:
    board, _, clock = rig(*[Turn(asks(n, "W", 5000, 2500)) for n in (4, 5, 6)])
    began_s = clock.now_s()
    with pytest.raises(TransientError):
        write(board, clock, 0.5)
    assert clock.now_s() - began_s == pytest.approx(DEADLINE_S)


def test_the_power_that_the_board_took_is_returned() -> None:
    board, _, clock = rig(Turn(asks(4, "W", 9000, 2500), says("04 W 8000 2500 10")))
    assert write(board, clock, 0.9) == 0.8


def test_a_board_that_takes_more_than_it_was_told_is_a_fault() -> None:
    board, _, clock = rig(Turn(asks(4, "W", 1000, 2500), says("04 W 10000 2500 10")))
    with pytest.raises(FaultError, match="at most 1000"):
        write(board, clock, 0.1)


@pytest.mark.parametrize(
    ("power", "valid_for_s", "sent"),
    [
        (math.nan, 2.5, (0, 2500)),
        (-1.0, 2.5, (0, 2500)),
        (3.0, 60.0, (10_000, 2500)),
        (1.0, 0.0, (0, 1)),
        (1.0, -5.0, (0, 1)),
        (1.0, math.nan, (0, 1)),
        (0.33335, 1.0, (3334, 1000)),
    ],
)
def test_power_and_validity_are_bounded_before_they_are_sent(
    power: float, valid_for_s: float, sent: tuple[int, int]
) -> None:
    reply = says(f"04 W {sent[0]} {sent[1]} 10")
    board, line, clock = rig(Turn(asks(4, "W", *sent), reply))
    assert write(board, clock, power, valid_for_s) == sent[0] / 10_000
    assert line.finished


@pytest.mark.parametrize(("power", "valid_for_s"), [(math.inf, 2.5), (None, 2.5), (1.0, "2")])
def test_what_is_no_command_is_a_fault_and_sent_as_power_0(power, valid_for_s) -> None:
    board, line, clock = rig(Turn(asks(4, "W", 0, 1), says("04 W 0 1 10")))
    with pytest.raises(FaultError, match="expected a finite number"):
        write(board, clock, power, valid_for_s)
    assert line.finished


def test_an_unknown_output_is_refused_before_anything_is_sent() -> None:
    board, line, clock = rig()
    with pytest.raises(BoardConfigError, match="heater"):
        board.write({"cooler": 0.1}, 2.5, clock.now_s() + DEADLINE_S)
    assert line.finished


def test_a_read_back_that_differs_is_a_fault() -> None:
    board, _, clock = rig(
        Turn(asks(4, "W", 5000, 2500), says("04 W 5000 2500 10")),
        Turn(asks(5, "R"), says("05 R 5 32 3 1 7000 0 10")),
    )
    write(board, clock, 0.5)
    with pytest.raises(FaultError, match="expected 5000 of 10000, the board gives 7000"):
        read(board, clock)


def test_a_cut_by_the_dead_man_is_counted_once_and_is_no_fault() -> None:
    board, _, clock = rig(
        Turn(asks(4, "W", 5000, 2500), says("04 W 5000 2500 10")),
        Turn(asks(5, "R"), says("05 R 5 32 3 1 0 1 04")),
        Turn(asks(6, "R"), says("06 R 6 32 4 1 0 1 04")),
    )
    write(board, clock, 0.5)
    assert [read(board, clock), read(board, clock)] == [5.0, 6.0]
    assert board.health().counters["cuts"] == 1


def test_after_a_write_of_unknown_outcome_the_read_back_is_not_judged() -> None:
    silent = [Turn(asks(n, "W", 5000, 2500)) for n in (4, 5, 6)]
    board, _, clock = rig(*silent, Turn(asks(7, "R"), says("07 R 5 32 3 1 5000 0 10")))
    with pytest.raises(TransientError):
        write(board, clock, 0.5)
    assert read(board, clock) == 5.0


def test_a_reset_met_by_a_read_initialises_the_board_and_keeps_the_sample() -> None:
    board, line, clock = rig(
        Turn(asks(4, "R"), says("04 R 5 64 3 1 0 2 03")),
        Turn(asks(5, "H"), says("05 H thermodaq 1 1.0.0 7 8 03")),
        Turn(asks(6, "C", 0, 50, 10, 2500, 10_000), says(f"06 C {CONFIGURATION}")),
    )
    assert read(board, clock) == 5.0
    assert line.finished
    assert board.health().counters["resets"] == 1


def test_a_reset_met_by_a_write_takes_no_power() -> None:
    board, line, clock = rig(
        Turn(asks(4, "W", 5000, 2500), says("04 E 7")),
        Turn(asks(5, "H"), says("05 H thermodaq 1 1.0.0 7 8 03")),
        Turn(asks(6, "C", 0, 50, 10, 2500, 10_000), says(f"06 C {CONFIGURATION}")),
    )
    assert write(board, clock, 0.5) == 0.0
    assert line.finished


def test_a_board_that_takes_power_before_it_is_configured_is_configured_and_gave_none() -> None:
    board, line, clock = rig(
        Turn(asks(4, "W", 5000, 2500), says("04 W 5000 2500 03")),
        Turn(asks(5, "H"), says("05 H thermodaq 1 1.0.0 7 8 03")),
        Turn(asks(6, "C", 0, 50, 10, 2500, 10_000), says(f"06 C {CONFIGURATION}")),
    )
    assert write(board, clock, 0.5) == 0.0
    assert line.finished
    assert board.health().counters["resets"] == 1


def test_a_phase_angle_without_zero_crossings_is_a_degraded_board_and_says_why() -> None:
    clock = ManualClock(100.0)
    hello, configured = opening()[1], says("03 C 1 50 10 2500 10000")
    line = Transcript(
        clock,
        [
            opening()[0],
            hello,
            Turn(asks(3, "C", 1, 50, 10, 2500, 10_000), configured),
            Turn(asks(4, "R"), says("04 R 5 32 3 1 0 0 00")),
            Turn(asks(5, "R"), says("05 R 5 32 4 1 0 0 08")),
        ],
    )
    chosen = ThermoDaqSettings.model_validate({"port": "p", "output_mode": "phase-angle"})
    board = ThermoDaq(chosen, line, clock)
    board.open(clock.now_s() + 5.0)
    read(board, clock)
    without = board.health()
    read(board, clock)
    assert without.status == "degraded"
    assert "zero crossings" in (without.last_error or "")
    assert board.health().status == "ok"


def test_a_board_that_was_lost_is_not_read_before_it_has_been_opened_again() -> None:
    board, line, clock = rig(Turn(asks(4, "R"), b"<04 R 2", disconnects=True))
    with pytest.raises(LinkError):
        read(board, clock)
    with pytest.raises(LinkError, match="expected an open board"):
        read(board, clock)
    assert line.finished


def test_a_board_that_was_let_go_stays_so() -> None:
    board, _, clock = rig(Turn(asks(4, "W", 0, 1), says("04 W 0 1 00")))
    board.close()
    for _ in range(2):
        with pytest.raises(LinkError):
            read(board, clock)
        with pytest.raises(LinkError, match="it was let go"):
            board.open(clock.now_s() + 5.0)


def test_a_board_that_was_exchanged_for_another_is_the_wrong_device() -> None:
    board, _, clock = rig(
        Turn(asks(4, "R"), says("04 R 5 64 3 1 0 2 03")),
        Turn(asks(5, "H"), says("05 H thermodaq 1 1.0.0 9 1 03")),
        unit=7,
    )
    with pytest.raises(WrongDevice, match="expected unit 7, got 9"):
        read(board, clock)


def test_closing_writes_zero_and_lets_the_line_go() -> None:
    board, line, _ = rig(Turn(asks(4, "W", 0, 1), says("04 W 0 1 00")))
    board.close()
    assert line.finished
    assert line.closed


def test_a_line_that_disconnects_is_lost_and_closing_it_raises_nothing() -> None:
    board, line, clock = rig(Turn(asks(4, "R"), b"<04 R 2", disconnects=True))
    with pytest.raises(LinkError):
        read(board, clock)
    board.close()
    assert line.closed


def test_an_impossible_sum_is_no_reading() -> None:
    board, _, clock = rig(Turn(asks(4, "R"), says("04 R 32768 32 3 1 0 3 00")))
    with pytest.raises(TransientError, match="sum"):
        read(board, clock)


@pytest.mark.parametrize(
    "wrong",
    [
        {"dead_man_s": 0.1},
        {"dead_man_s": math.nan},
        {"mains_hz": 400},
        {"average_periods": 0},
        {"power_max": 1.5},
        {"output_mode": "pwm"},
        {"speed": 9600},
        {"port": ""},
    ],
)
def test_settings_out_of_range_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        ThermoDaqSettings.model_validate({"port": "/dev/ttyACM0", **wrong})
