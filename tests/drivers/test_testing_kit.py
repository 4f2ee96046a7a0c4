"""The public test kit keeps its own promises."""

from __future__ import annotations

import subprocess
import sys

import pytest

from thermoctl.errors import TransientError
from thermoctl.ports import Board, Link
from thermoctl.signals import RawSample
from thermoctl.testing import FaultyLink, ManualClock, ScriptedBoard, Transcript, Turn

KIT_WITHOUT_PYTEST = """
import sys
sys.modules["pytest"] = None
import thermoctl.testing
assert not any(name.startswith("thermoctl_drivers") for name in sys.modules)
"""


def test_the_kit_imports_without_pytest_and_without_any_driver() -> None:
    subprocess.run([sys.executable, "-c", KIT_WITHOUT_PYTEST], check=True, timeout=60)


def test_a_manual_clock_moves_only_forward() -> None:
    clock = ManualClock(3.0)
    clock.sleep_until(2.0)
    assert clock.now_s() == 3.0
    clock.advance(0.5)
    clock.sleep_until(4.0)
    assert clock.now_s() == 4.0
    with pytest.raises(ValueError, match="forward"):
        clock.advance(-1.0)


def test_a_scripted_board_plays_its_script_and_records_what_it_is_told() -> None:
    clock = ManualClock()
    own = {"temperature": RawSample(1.0, 2.0, 3.0)}
    script = (500.0, None, own, TransientError("noise"))
    scripted = ScriptedBoard(clock, script, (None, 0.25), takes_s=0.1)
    board: Board = scripted
    board.open(1.0)
    assert board.read(1.0)["temperature"] == RawSample(0.1, 500.0, 1024.0, 1)
    assert board.read(1.0) == {}
    assert board.read(1.0) == own
    for _ in range(2):  # the last item is repeated
        with pytest.raises(TransientError, match="noise"):
            board.read(1.0)
    assert board.write({"heater": 0.5}, 2.0, 9.0) == {"heater": 0.5}
    assert board.write({"heater": 0.7}, 2.0, 9.0) == {"heater": 0.25}
    assert scripted.power == 0.7
    assert [write.t_s for write in scripted.written] == pytest.approx([0.0, 0.5, 0.6])
    board.close()
    assert (board.health().status, scripted.closed) == ("down", 1)


def test_a_transcript_answers_after_its_delay_and_moves_the_clock_as_a_read_waits() -> None:
    clock = ManualClock()
    line: Link = Transcript(clock, [Turn(b"ask", b"answer", delay_s=0.3)])
    line.timeout = 0.2
    line.write(b"ask")
    assert line.read(6) == b""
    assert clock.now_s() == pytest.approx(0.2)
    assert line.read(6) == b"answer"
    assert clock.now_s() == pytest.approx(0.3)


def test_a_transcript_objects_to_what_was_not_expected() -> None:
    clock = ManualClock()
    line = Transcript(clock, [Turn(b"ask"), Turn(None, disconnects=True)])
    with pytest.raises(AssertionError, match="expected b'ask'"):
        line.write(b"tell")
    line.write(b"anything")
    with pytest.raises(OSError, match="Input/output"):
        line.read()


def test_a_read_that_could_block_for_ever_is_an_error_of_the_driver() -> None:
    line = Transcript(ManualClock(), [Turn(None, b"x")])
    line.write(b"ask")
    with pytest.raises(AssertionError, match="time-out"):
        line.read(1)


@pytest.mark.parametrize("fault", FaultyLink.FAULTS)
def test_every_fault_of_a_line_shows(fault: str) -> None:
    clock = ManualClock()
    line = FaultyLink(Transcript(clock, [Turn(None, b"a whole answer\n")]), clock)
    line.timeout = line.write_timeout = 0.1
    line.fault = fault
    try:
        line.write(b"ask")
        answer = b"".join(line.read(5) for _ in range(3))
    except OSError:
        answer = b""
    assert answer != b"a whole answer\n"
