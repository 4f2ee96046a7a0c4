"""The dry-run board beyond the contract: what it reads, and that it takes no power."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from thermoctl.errors import BoardConfigError, FaultError
from thermoctl.model.sensor import LM335, Sensor
from thermoctl.testing import ManualClock
from thermoctl_drivers.null import NullBoard, NullSettings


def opened(**settings: object) -> tuple[NullBoard, ManualClock]:
    clock = ManualClock(5.0)
    board = NullBoard(NullSettings.model_validate(settings), None, clock)
    board.open(10.0)
    return board, clock


@pytest.mark.parametrize("temperature_c", [-40.0, 0.0, 37.5, 99.0])
def test_a_constant_temperature_is_read_through_the_sensor_curve(temperature_c: float) -> None:
    board, _ = opened(temperature_c=temperature_c)
    measured = Sensor(LM335, 5.0).measure(board.read(10.0)["temperature"])
    assert measured.temperature_c == pytest.approx(temperature_c, abs=0.005)


def test_injected_counts_are_read_and_none_is_no_answer() -> None:
    board, clock = opened(counts=100.0, full_scale=1024.0)
    assert board.read(10.0)["temperature"].counts == 100.0
    board.inject(1023.0)
    clock.advance(1.0)
    sample = board.read(10.0)["temperature"]
    assert (sample.counts, sample.t_s, sample.sequence) == (1023.0, 6.0, 2)
    board.inject(None)
    assert board.read(10.0) == {}


@pytest.mark.parametrize("counts", [-1.0, 1024.0, math.nan])
def test_counts_that_no_converter_could_show_are_refused(counts: float) -> None:
    board, _ = opened(counts=1.0, full_scale=1024.0)
    with pytest.raises(BoardConfigError, match="1024"):
        board.inject(counts)
    with pytest.raises(ValidationError):
        NullSettings(counts=counts, full_scale=1024.0)


def test_no_power_is_ever_taken() -> None:
    board, _ = opened()
    assert board.write({"heater": 1.0}, 2.5, 10.0) == {"heater": 0.0}
    with pytest.raises(BoardConfigError, match="heater"):
        board.write({"cooler": 1.0}, 2.5, 10.0)


@pytest.mark.parametrize("power", [None, "1", math.inf, True])
def test_a_dry_run_refuses_what_a_board_refuses(power) -> None:
    board, _ = opened()
    with pytest.raises(FaultError, match="heater: expected a finite number"):
        board.write({"heater": power}, 2.5, 10.0)
