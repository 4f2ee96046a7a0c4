"""What every driver is held to, whatever it drives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from thermoctl.errors import DriverError, LinkError, TransientError, WrongDevice
from thermoctl.ports import Board
from thermoctl.signals import RawSample
from thermoctl.testing.clock import ManualClock
from thermoctl.testing.lines import FaultyLink


@dataclass(slots=True)
class Rig:
    """A driver with everything a contract needs to test it.

    Parameters
    ----------
    board : Board
        Not yet opened.
    clock : ManualClock
        The clock the board was given.
    line : FaultyLink or None
        The line it was given; None for a board without one, whose line tests are skipped.
    power : callable or None
        Returns the power the HARDWARE gives now; None where nobody can look.
    input_name, output_name : str
        Channels of the board; `output_name` empty: it writes nowhere.
    settle_s : float
        Time after which the first sample is complete.
    deadline_s : float
        Time allowed for one read or write.
    """

    board: Board
    clock: ManualClock
    line: FaultyLink | None = None
    power: Callable[[], float] | None = None
    input_name: str = "temperature"
    output_name: str = "heater"
    settle_s: float = 1.0
    deadline_s: float = 0.2
    open_s: float = 5.0

    def opened(self) -> Rig:
        """Open the board, wait for its first sample, and return the rig."""
        self.board.open(self.clock.now_s() + self.open_s)
        self.clock.advance(self.settle_s)
        return self

    def read(self) -> Mapping[str, RawSample]:
        """Read within the deadline."""
        return self.board.read(self.clock.now_s() + self.deadline_s)

    def write(self, power: float, valid_for_s: float = 2.0) -> float:
        """Write within the deadline and return what was taken."""
        outputs = {self.output_name: power} if self.output_name else {}
        taken = self.board.write(outputs, valid_for_s, self.clock.now_s() + self.deadline_s)
        return taken.get(self.output_name, 0.0)


class DriverContract:
    """What every driver keeps; subclass it in a test and define `rig`."""

    def rig(self) -> Rig:
        """Return a new board with its clock, and its line where it has one."""
        raise NotImplementedError

    # -- helpers ---------------------------------------------------------------------------------

    def _with_line(self, fault: str) -> tuple[Rig, FaultyLink]:
        """Return an opened rig whose line has just got `fault`; skip where there is no line."""
        import pytest

        rig = self.rig().opened()
        if rig.line is None:
            pytest.skip("this board has no line that could fail")
        rig.line.fault = fault
        return rig, rig.line

    def _fails_in_time(self, rig: Rig, call: Callable[[], object]) -> BaseException:
        """Return the driver's error of `call`, checked to come by the deadline."""
        import pytest

        began_s = rig.clock.now_s()
        with pytest.raises(DriverError) as caught:
            call()
        took_s = rig.clock.now_s() - began_s
        assert took_s <= rig.deadline_s + 0.005, f"took {took_s:.3f} s of {rig.deadline_s} s"
        return caught.value

    # -- the clauses -----------------------------------------------------------------------------

    def test_construction_touches_nothing(self) -> None:
        rig = self.rig()
        assert rig.line is None or rig.line.written == 0

    def test_open_says_who_is_there_and_may_be_repeated(self) -> None:
        rig = self.rig()
        first = rig.board.open(rig.clock.now_s() + rig.open_s)
        assert first.kind
        assert rig.board.open(rig.clock.now_s() + rig.open_s) == first

    def test_opening_leaves_the_output_at_zero(self) -> None:
        rig = self.rig().opened()
        assert rig.power is None or rig.power() == 0.0

    def test_a_sample_carries_its_own_time_and_scale(self) -> None:
        rig = self.rig().opened()
        began_s = rig.clock.now_s()
        sample = rig.read()[rig.input_name]
        assert began_s - rig.settle_s <= sample.t_s <= rig.clock.now_s()
        assert 0.0 <= sample.counts < sample.full_scale

    def test_a_power_is_taken_and_reported(self) -> None:
        rig = self.rig().opened()
        taken = rig.write(0.5)
        assert taken == (0.0 if not rig.output_name else _near(0.5, 0.01))

    def test_a_power_beyond_the_range_is_clipped_and_the_clip_reported(self) -> None:
        rig = self.rig().opened()
        assert rig.write(7.0) <= 1.0
        assert rig.write(-3.0) == 0.0
        assert rig.write(math.nan) == 0.0

    def test_a_command_that_has_expired_gives_no_power(self) -> None:
        rig = self.rig().opened()
        rig.write(1.0, valid_for_s=0.0)
        rig.clock.advance(0.1)
        rig.read()
        assert rig.power is None or rig.power() == 0.0

    def test_the_output_falls_to_zero_when_no_command_follows(self) -> None:
        import pytest

        rig = self.rig().opened()
        if rig.power is None or not rig.board.capabilities.dead_man:
            pytest.skip("this board has no output that could be looked at")
        rig.write(1.0, valid_for_s=60.0)
        rig.clock.advance(0.2)
        rig.read()
        assert rig.power() > 0.5
        rig.clock.advance(3.0)
        rig.read()
        assert rig.power() == 0.0

    def test_closing_leaves_the_output_at_zero_and_may_be_repeated(self) -> None:
        rig = self.rig().opened()
        rig.write(1.0)
        rig.board.close()
        rig.board.close()
        assert rig.power is None or rig.power() == 0.0

    def test_a_board_that_was_never_opened_closes_too(self) -> None:
        self.rig().board.close()

    def test_a_closed_board_is_a_lost_link(self) -> None:
        rig = self.rig().opened()
        rig.board.close()
        assert isinstance(self._fails_in_time(rig, rig.read), LinkError)
        assert rig.board.health().status == "down"

    def test_health_is_ok_after_a_good_exchange(self) -> None:
        rig = self.rig().opened()
        rig.read()
        assert rig.board.health().status == "ok"

    def test_silence_is_a_passing_error_by_the_deadline(self) -> None:
        rig, _ = self._with_line("silent")
        assert isinstance(self._fails_in_time(rig, rig.read), TransientError)
        assert isinstance(self._fails_in_time(rig, lambda: rig.write(0.5)), TransientError)
        assert rig.board.health().status == "degraded"

    def test_garbage_is_a_passing_error_by_the_deadline(self) -> None:
        rig, _ = self._with_line("garbage")
        assert isinstance(self._fails_in_time(rig, rig.read), TransientError)

    def test_half_a_frame_is_a_passing_error_by_the_deadline(self) -> None:
        rig, _ = self._with_line("half")
        assert isinstance(self._fails_in_time(rig, rig.read), TransientError)

    def test_an_endless_stream_ends_by_the_deadline(self) -> None:
        rig, _ = self._with_line("endless")
        assert isinstance(self._fails_in_time(rig, rig.read), TransientError)

    def test_an_unplugged_board_is_a_lost_link(self) -> None:
        rig, _ = self._with_line("unplugged")
        assert isinstance(self._fails_in_time(rig, rig.read), LinkError)
        assert isinstance(self._fails_in_time(rig, lambda: rig.write(0.5)), LinkError)
        rig.board.close()
        assert rig.board.health().status == "down"

    def test_a_board_unplugged_in_the_middle_of_a_reply_is_a_lost_link(self) -> None:
        rig, _ = self._with_line("unplugged-mid-read")
        assert isinstance(self._fails_in_time(rig, rig.read), LinkError)

    def test_a_blocked_write_ends_by_the_deadline(self) -> None:
        rig, _ = self._with_line("stuck")
        self._fails_in_time(rig, lambda: rig.write(0.5))

    def test_it_works_again_after_the_line_has_recovered(self) -> None:
        rig, line = self._with_line("garbage")
        self._fails_in_time(rig, rig.read)
        line.fault = "healthy"
        rig.clock.advance(0.5)
        assert rig.input_name in rig.read()
        assert rig.write(0.25) == _near(0.25, 0.01)

    def test_another_device_is_refused(self) -> None:
        import pytest

        rig = self.rig()
        if rig.line is None:
            pytest.skip("this board has no line that another device could be on")
        rig.line.fault = "echo"
        with pytest.raises(WrongDevice):
            rig.board.open(rig.clock.now_s() + rig.open_s)

    def test_nobody_there_is_a_lost_link_by_the_deadline(self) -> None:
        import pytest

        rig = self.rig()
        if rig.line is None:
            pytest.skip("this board has no line that could be silent")
        rig.line.fault = "silent"
        with pytest.raises(LinkError):
            rig.board.open(rig.clock.now_s() + rig.open_s)
        assert rig.clock.now_s() <= rig.open_s + 0.1


def _near(value: float, tolerance: float) -> Any:
    import pytest

    return pytest.approx(value, abs=tolerance)
