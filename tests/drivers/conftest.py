"""The two boards that every test of the protocol runs against."""

from __future__ import annotations

import pytest

from thermoctl_drivers.thermodaq_board import BoardModel
from thermoctl_drivers.thermodaq_chip import Chip, missing


@pytest.fixture(params=["python", pytest.param("chip", marks=pytest.mark.hil)])
def thermodaq(request: pytest.FixtureRequest) -> BoardModel | Chip:
    """Return a board that has been powered for 0.1 s, with 3.105 V on its input."""
    if request.param == "chip" and (why := missing()):
        pytest.skip(why)
    board = BoardModel() if request.param == "python" else Chip()
    board.analog(3105.0)
    board.advance(0.1)
    return board
