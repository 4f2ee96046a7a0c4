"""Time one tick of the regulator, and a simulated hour with its plant.

Run with ``python benchmarks/tick.py``. Prints medians with the least and the greatest of several
runs; these depend on the machine, so nothing is judged by them.
"""

from __future__ import annotations

import io
import statistics
import time
from collections.abc import Callable
from contextlib import redirect_stdout

from thermoctl.app.cycle_record import as_line
from thermoctl.app.sim import bench_settings, profile, simulate

RUNS = 5
HOUR_S = 3600.0


def spread(values: list[float]) -> str:
    """Return the median of `values` with their range."""
    return f"{statistics.median(values):8.2f}  ({min(values):.2f} to {max(values):.2f})"


def ticks_us(name: str, *, shadow: bool) -> tuple[list[float], list[float]]:
    """Return medians of the CPU time of a step in us, once a run: in the first hour, from cold.

    And in the second one, at rest. With the law that the profile has in its shadow, or without.
    """
    settings = bench_settings(profile(name))
    if not shadow:
        alone = {
            loop: table.model_copy(update={"shadow": None})
            for loop, table in settings.loops.items()
        }
        settings = settings.model_copy(update={"loops": alone})
    first, second = [], []
    for _ in range(RUNS):
        taken = [cycle.tick_us for cycle in simulate(settings, 2.0 * HOUR_S)]
        half = len(taken) // 2
        first.append(statistics.median(taken[:half]))
        second.append(statistics.median(taken[half:]))
    return first, second


def seconds(work: Callable[[], None]) -> list[float]:
    """Return the CPU time of `work` in s, once a run."""
    taken = []
    for _ in range(RUNS):
        begin_s = time.process_time()
        work()
        taken.append(time.process_time() - begin_s)
    return taken


def hour() -> None:
    """Simulate an hour of the aquarium, shadow included."""
    for _ in simulate(bench_settings(), HOUR_S):
        pass


def hour_with_lines() -> None:
    """Simulate an hour of the aquarium and write every cycle as JSON."""
    with redirect_stdout(io.StringIO()):
        for cycle in simulate(bench_settings(), HOUR_S):
            print(as_line(cycle))


def main() -> None:
    """Print the table."""
    print(f"medians of {RUNS} runs, with their range")
    for name, shadow in (("aquarium", False), ("aquarium", True), ("ozbek2021", False)):
        cold, rest = ticks_us(name, shadow=shadow)
        beside = ", with a shadow" if shadow else ""
        print(f"regulator step, {name + beside:<28} us {spread(cold)}, from cold")
        print(f"{'':<44} us {spread(rest)}, at rest")
    print(f"simulated hour with plant                  s {spread(seconds(hour))}")
    print(f"simulated hour with plant and JSON lines   s {spread(seconds(hour_with_lines))}")


if __name__ == "__main__":
    main()
