"""The simulated microcontroller, or a visible reason why it is not there."""

from __future__ import annotations

import pytest

from thermoctl.errors import Unavailable
from thermoctl_drivers.thermodaq_chip import Chip


@pytest.fixture
def chip() -> Chip:
    """Return a chip that has just been powered."""
    try:
        board = Chip()
    except Unavailable as missing:
        pytest.skip(str(missing))
    board.advance(0.05)
    return board
