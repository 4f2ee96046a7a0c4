"""The simulated microcontroller, or a visible reason why it is not there."""

from __future__ import annotations

import pytest

from thermoctl_drivers.thermodaq_chip import Chip, missing


@pytest.fixture
def chip() -> Chip:
    """Return a chip that has just been powered."""
    if why := missing():
        pytest.skip(why)
    board = Chip()
    board.advance(0.05)
    return board
