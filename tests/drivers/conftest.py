"""The two boards that every test of the protocol runs against."""

from __future__ import annotations

import pytest

from thermoctl.errors import Unavailable
from thermoctl_drivers.thermodaq_board import BoardModel
from thermoctl_drivers.thermodaq_chip import Chip


@pytest.fixture(params=["python", pytest.param("chip", marks=pytest.mark.hil)])
def thermodaq(request: pytest.FixtureRequest) -> BoardModel | Chip:
    """Return a board that has been powered for 0.1 s, with 3.105 V on its input."""
    try:
        board = BoardModel() if request.param == "python" else Chip()
    except Unavailable as missing:
        pytest.skip(str(missing))
    board.analog(3105.0)
    board.advance(0.1)
    return board
