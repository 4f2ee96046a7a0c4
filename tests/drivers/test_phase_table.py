"""The firmware's table of firing angles, solved again from the equation it stands for."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

HEADER = Path(__file__).parents[2] / "drivers/firmware/thermodaq/src/phase_table.h"


def power_at(angle: float) -> float:
    """Return the share of full power behind `angle`, a fraction of pi."""
    return 1.0 - angle + math.sin(2.0 * math.pi * angle) / (2.0 * math.pi)


def table() -> list[int]:
    entries = HEADER.read_text(encoding="ascii").partition("= {")[2]
    return [int(word) for word in re.findall(r"\d+", entries)]


def test_the_table_covers_zero_to_full_power_in_equal_steps() -> None:
    angles = table()
    assert len(angles) == 65
    assert (angles[0], angles[-1]) == (65535, 0)
    for step, angle in enumerate(angles):
        assert power_at(angle / 65536.0) == pytest.approx(step / 64.0, abs=5e-5)


def test_a_straight_line_between_entries_is_within_what_the_manual_promises() -> None:
    angles = table()
    worst = 0.0
    for tenthousandth in range(100, 10_001):
        place = tenthousandth * 64 / 10_000
        step = min(int(place), 63)
        angle = angles[step] + (angles[step + 1] - angles[step]) * (place - step)
        worst = max(worst, abs(power_at(angle / 65536.0) - tenthousandth / 10_000))
    assert worst < 0.006
