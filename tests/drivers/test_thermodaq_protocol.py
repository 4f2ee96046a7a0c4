"""What the board answers, on the firmware in a simulated chip and on the board in Python alike."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from thermoctl_drivers import thermodaq_frames as frames
from thermoctl_drivers.thermodaq_board import BoardModel
from thermoctl_drivers.thermodaq_chip import Chip
from thermoctl_drivers.thermodaq_frames import Cut, Flag, Refusal

Board = BoardModel | Chip

DOCUMENT = Path(__file__).parents[2] / "docs" / "drivers" / "thermodaq.md"
REPLY_S = 0.02
CONFIGURE = (0, 50, 2, 2500, 10_000)


def exchange(board: Board, line: bytes) -> bytes:
    """Send `line` and return whatever comes back within 20 ms."""
    board.send(line)
    board.advance(REPLY_S)
    return board.receive()


def ask(board: Board, letter: str, *arguments: int) -> frames.Reply:
    """Return the one reply to a good request."""
    reply = frames.decode(exchange(board, frames.request(0x2A, letter, *arguments)))
    assert reply.sequence == 0x2A
    return reply


def reading(board: Board) -> frames.Reading:
    return frames.reading(ask(board, "R"))


def on_time(board: Board, seconds: float) -> float:
    """Return the share of `seconds` during which the heater pin is high."""
    before_s = board.on_s
    board.advance(seconds)
    return (board.on_s - before_s) / seconds


def documented_sessions() -> list[list[str]]:
    text = DOCUMENT.read_text(encoding="utf-8")
    blocks = re.findall(r"```text\n(.*?)```", text, flags=re.DOTALL)
    return [block.splitlines() for block in blocks if block.startswith(">")]


def without_what_varies(line: str) -> str:
    """Return a reply with sample counter, age and checksum blanked where it is one to `R`."""
    return re.sub(r"^(<.. R \d+ \d+) \d+ \d+ (.*)\*.*$", r"\1 . . \2", line)


def test_the_document_shows_what_the_board_really_sends(thermodaq: Board) -> None:
    sessions = documented_sessions()
    assert [len(session) for session in sessions] == [11, 9, 19]
    for line in (line for session in sessions for line in session):
        if line == "--- reset":
            thermodaq.reset()
            thermodaq.advance(0.1)
        elif line.startswith("---"):
            thermodaq.advance(int(line.split()[1]) / 1000.0)
        elif line.startswith(">"):
            came = exchange(thermodaq, line.encode() + b"\n").decode()
        else:
            frames.decode(line.encode())  # even the reply that varies has a good checksum
            assert without_what_varies(came.rstrip("\n")) == without_what_varies(line)


def test_the_document_names_every_flag_reason_and_cut() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    for flag in Flag:
        assert f"| `{flag:02X}` |" in text
    for number in (*Refusal, *Cut):
        assert f"| {number:d} |" in text


def test_the_worked_checksum_is_right() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    for length, body in enumerate((b"0", b"01", b"01 ", b"01 H"), start=1):
        assert len(body) == length
        assert f"`{frames.checksum(body):04X}`" in text
    assert frames.checksum(b"123456789") == 0x29B1
    assert frames.request(1, "H").hex(" ").upper() in text


def test_the_power_of_a_board_that_has_just_started_is_zero_and_flagged(thermodaq: Board) -> None:
    state = reading(thermodaq)
    assert (state.power, state.cut) == (0, Cut.RESET)
    assert state.flags == Flag.RESET | Flag.UNCONFIGURED
    assert thermodaq.on_s == 0.0


def test_hello_clears_the_reset_flag_and_still_shows_it(thermodaq: Board) -> None:
    assert Flag.RESET in frames.hello(ask(thermodaq, "H")).flags
    assert Flag.RESET not in frames.hello(ask(thermodaq, "H")).flags


def test_power_is_refused_before_a_configuration_and_zero_is_not(thermodaq: Board) -> None:
    assert frames.refusal(ask(thermodaq, "W", 1, 2500)) == "7 unconfigured"
    assert ask(thermodaq, "W", 0, 2500).letter == "W"


@pytest.mark.parametrize("power", [100, 3333, 9800, 10_000])
def test_bursts_are_whole_cycles_in_the_commanded_share(thermodaq: Board, power: int) -> None:
    ask(thermodaq, "C", *CONFIGURE)
    ask(thermodaq, "W", power, 2500)
    thermodaq.advance(0.1)
    before_s = thermodaq.on_s
    for _ in range(2):
        ask(thermodaq, "W", power, 2500)
        thermodaq.advance(2.0 - REPLY_S)
    cycles = (thermodaq.on_s - before_s) / 0.02
    assert cycles == pytest.approx(200 * power / 10_000, abs=1.05)


def test_the_dead_man_cuts_and_says_so(thermodaq: Board) -> None:
    ask(thermodaq, "C", *CONFIGURE)
    ask(thermodaq, "W", 10_000, 60_000)
    sent_s = thermodaq.t_s
    assert on_time(thermodaq, 2.4) > 0.98
    thermodaq.advance(0.2)
    assert thermodaq.off_since_s - sent_s == pytest.approx(2.5, abs=REPLY_S)
    state = reading(thermodaq)
    assert (state.power, state.cut) == (0, Cut.DEAD_MAN)
    assert Flag.CUT in state.flags
    assert on_time(thermodaq, 1.0) == 0.0


def test_a_command_expires_by_its_own_validity(thermodaq: Board) -> None:
    ask(thermodaq, "C", *CONFIGURE)
    ask(thermodaq, "W", 10_000, 300)
    sent_s = thermodaq.t_s
    thermodaq.advance(0.5)
    assert thermodaq.off_since_s - sent_s == pytest.approx(0.3, abs=REPLY_S)


def test_only_an_output_command_re_arms_the_dead_man(thermodaq: Board) -> None:
    ask(thermodaq, "C", *CONFIGURE)
    ask(thermodaq, "W", 10_000, 500)
    for _ in range(12):
        reading(thermodaq)
        ask(thermodaq, "H")
        exchange(thermodaq, frames.request(1, "W", 10_000))  # refused: an argument is missing
        exchange(thermodaq, b">01 W 10000 2500*0000\n")  # refused: its checksum is wrong
    assert reading(thermodaq).cut == Cut.DEAD_MAN


def test_configuring_switches_off(thermodaq: Board) -> None:
    ask(thermodaq, "C", *CONFIGURE)
    ask(thermodaq, "W", 10_000, 2500)
    assert on_time(thermodaq, 0.2) > 0.8
    ask(thermodaq, "C", *CONFIGURE)
    assert on_time(thermodaq, 0.2) == 0.0
    assert reading(thermodaq).cut == Cut.CONFIGURED


@pytest.mark.parametrize(
    "arguments",
    [
        (2, 50, 2, 2500, 10_000),
        (0, 55, 2, 2500, 10_000),
        (0, 50, 0, 2500, 10_000),
        (0, 50, 51, 2500, 10_000),
        (0, 50, 2, 199, 10_000),
        (0, 50, 2, 10_001, 10_000),
        (0, 50, 2, 2500, 10_001),
    ],
)
def test_a_configuration_out_of_range_changes_nothing(
    thermodaq: Board, arguments: tuple[int, ...]
) -> None:
    ask(thermodaq, "C", *CONFIGURE)
    ask(thermodaq, "W", 7000, 2500)
    assert frames.refusal(ask(thermodaq, "C", *arguments)) == "6 range"
    assert reading(thermodaq).power == 7000


def test_garbage_never_changes_the_output(thermodaq: Board) -> None:
    rng = np.random.default_rng(7)
    good = frames.request(0x11, "W", 10_000, 2500)
    ask(thermodaq, "C", *CONFIGURE)
    for _ in range(40):
        damaged = bytearray(good)
        for place in rng.integers(0, len(good) - 1, size=2):
            damaged[place] ^= 1 << int(rng.integers(0, 7))
        noise = b"" if bytes(damaged) == good else bytes(damaged)
        exchange(thermodaq, rng.bytes(30) + noise)
    thermodaq.advance(0.1)
    thermodaq.receive()
    assert reading(thermodaq).power == 0
    assert thermodaq.on_s == 0.0


def test_an_endless_line_is_bounded_and_the_next_one_understood(thermodaq: Board) -> None:
    thermodaq.send(b">" + b"7" * 3000)
    thermodaq.advance(0.4)
    assert frames.decode(thermodaq.receive()) == frames.Reply(None, "E", ("1",))
    assert reading(thermodaq).count == 64


def test_a_start_character_begins_a_line_anew(thermodaq: Board) -> None:
    assert frames.decode(exchange(thermodaq, b">01 W 10" + frames.request(5, "R"))).sequence == 5


def test_samples_are_counted_and_their_age_is_that_of_the_middle(thermodaq: Board) -> None:
    ask(thermodaq, "C", 0, 50, 10, 2500, 0)
    thermodaq.advance(0.25)
    first = reading(thermodaq)
    thermodaq.advance(1.0 - REPLY_S)
    second = reading(thermodaq)
    assert second.sequence - first.sequence == 5
    assert first.count == 320
    assert abs(second.age_ms - first.age_ms) <= 2
    assert first.age_ms == pytest.approx(100 + 50 + 20, abs=25)


@pytest.mark.parametrize("mains_hz", [50, 60])
def test_a_burst_over_whole_periods_is_blind_to_the_mains(thermodaq: Board, mains_hz: int) -> None:
    ask(thermodaq, "C", 0, mains_hz, 2, 2500, 0)
    volts = []
    for _ in range(30):
        thermodaq.analog(3106.5, noise_mv=2.0, pickup_mv=150.0, mains_hz=float(mains_hz))
        thermodaq.advance(0.1)
        state = reading(thermodaq)
        volts.append(state.total / state.count * 5.0 / 1024.0)
    assert np.std(volts) < 0.002  # 0.15 V of pickup has gone
    assert np.mean(volts) == pytest.approx(3.1065 - 0.5 * 5.0 / 1024.0, abs=0.0015)


@pytest.mark.parametrize("millivolts", [0.0, 12.0, 2981.5, 3106.5, 4999.0])
def test_counts_follow_the_voltage(thermodaq: Board, millivolts: float) -> None:
    ask(thermodaq, "C", *CONFIGURE)
    thermodaq.analog(millivolts)
    thermodaq.advance(0.1)
    state = reading(thermodaq)
    assert state.total / state.count == pytest.approx(millivolts * 1024.0 / 5000.0, abs=1.01)


def test_a_reset_switches_off_and_is_flagged(thermodaq: Board) -> None:
    ask(thermodaq, "H")
    ask(thermodaq, "C", *CONFIGURE)
    ask(thermodaq, "W", 10_000, 2500)
    assert on_time(thermodaq, 0.2) > 0.8
    thermodaq.reset()
    assert on_time(thermodaq, 0.2) == 0.0
    assert Flag.RESET in reading(thermodaq).flags


def test_the_unit_number_survives_a_reset(thermodaq: Board) -> None:
    assert ask(thermodaq, "U", 4711).fields == ("4711",)
    thermodaq.reset()
    thermodaq.advance(0.1)
    assert frames.hello(ask(thermodaq, "H")).unit == 4711
