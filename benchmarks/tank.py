"""Cost of the simulated tank and of its board, on one core.

Run with ``python benchmarks/tank.py``. Prints the median of repeated runs in microseconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median

import numpy as np

from thermoctl.plant.parameters import TankParameters
from thermoctl.plant.tank import Tank
from thermoctl_drivers.simulated import SimulatedBoard, SimulatedSettings

SECONDS = 2000
REPEATS = 7
SIZES = {"reference": (8.0, 1500.0), "smallest": (0.5, 50.0), "largest": (200.0, 5000.0)}


class SteppedClock:
    """Time that is set by hand."""

    t_s = 0.0

    def now_s(self) -> float:
        """Return the time that was set."""
        return self.t_s

    def sleep_until(self, t_s: float) -> None:
        """Set the time."""
        self.t_s = t_s


def tank_life(volume_l: float, heater_w: float) -> Callable[[], None]:
    """Return a run of a tank, one second at a time."""
    tank = Tank(TankParameters.scaled(volume_l, heater_w), np.random.default_rng(1))

    def live() -> None:
        for _ in range(SECONDS):
            tank.advance(1.0, 0.4)

    return live


def board_life(volume_l: float, heater_w: float, conversions: int) -> Callable[[], None]:
    """Return a run of a board, one read and one write a second."""
    settings = SimulatedSettings(volume_l=volume_l, heater_w=heater_w, conversions=conversions)
    clock = SteppedClock()
    board = SimulatedBoard(settings, None, clock)
    board.open(0.0)

    def live() -> None:
        for _ in range(SECONDS):
            clock.t_s += 1.0
            board.read(clock.t_s)
            board.write({"heater": 0.4}, 2.5, clock.t_s)

    return live


def median_us(live: Callable[[], None]) -> float:
    """Return the median CPU time of a simulated second in us."""
    spent = []
    for _ in range(REPEATS):
        started = time.process_time()
        live()
        spent.append(1e6 * (time.process_time() - started) / SECONDS)
    return median(spent)


def main() -> None:
    """Print the table."""
    print(f"us of CPU per simulated second, median of {REPEATS} runs of {SECONDS} s")
    for name, (volume_l, heater_w) in SIZES.items():
        tank_us = median_us(tank_life(volume_l, heater_w))
        print(f"{name:<10} {volume_l:5g} l {heater_w:5g} W  tank              {tank_us:6.1f}")
        for conversions in (1, 32):
            board_us = median_us(board_life(volume_l, heater_w, conversions))
            print(f"{'':<10} {'':5}   {'':5}    board, burst of {conversions:<2} {board_us:6.1f}")


if __name__ == "__main__":
    main()
