"""Time one sample of the adaptive controller's bank, and a simulated hour with it.

Run with ``python benchmarks/adaptive.py``. Prints medians with the least and the greatest of some
runs; these depend on the machine, so nothing is judged by them.
"""

from __future__ import annotations

import math
import statistics
import time

import numpy as np

from thermoctl.app.settings import load
from thermoctl.app.sim import profile, simulate
from thermoctl.control.adaptive import Adaptive
from thermoctl.estimation import start
from thermoctl.ports import Situation

RUNS = 7
SAMPLES = 3000
WARM_UP = 400
HOUR_S = 3600.0
NOTHING, EMPTY = start(1), np.empty(0)


def spread(values: list[float]) -> str:
    """Return the median of `values` with their range."""
    return f"{statistics.median(values):8.2f}  ({min(values):.2f} to {max(values):.2f})"


def sample_us(seed: int) -> tuple[list[float], list[float]]:
    """Return the time of each observe and decide in us, and of what is told of them."""
    law, rng = Adaptive(), np.random.default_rng(seed)
    belief, power, heat, water_c, sensor_c = law.start(), 0.0, 0.0, 25.0, 25.0
    control, words = [], []
    for _ in range(SAMPLES):
        y_c = sensor_c + 0.01 * float(rng.standard_normal())
        now = Situation(0.0, 1.0, y_c, 37.5, power, NOTHING, EMPTY, EMPTY, y_c)
        begin = time.perf_counter()
        belief = law.observe(belief, now)
        belief, power = law.decide(belief, now)
        middle = time.perf_counter()
        law.beliefs(belief, now)
        control.append(1e6 * (middle - begin))
        words.append(1e6 * (time.perf_counter() - middle))
        heat += (1.0 - math.exp(-1.0 / 14.0)) * (power - heat)
        water_c += 0.036 * heat - 0.009
        sensor_c += (1.0 - math.exp(-1.0 / 6.0)) * (water_c - sensor_c)
    return control, words


def hour() -> tuple[float, float]:
    """Return CPU seconds of a simulated hour without a shadow, and the median tick in us."""
    document = load(profile("aquarium")).model_dump()
    document["loops"]["tank"] |= {"controller": {"kind": "adaptive"}, "shadow": None}
    settings = load(document)
    begin_s = time.process_time()
    ticks = [cycle.tick_us for cycle in simulate(settings, HOUR_S)]
    return time.process_time() - begin_s, statistics.median(ticks)


def main() -> None:
    """Print the table."""
    runs = [sample_us(seed) for seed in range(RUNS)]
    hours = [hour() for _ in range(RUNS)]
    print(f"medians of {RUNS} runs, with their range")
    rows = {
        "observe and decide, warm-up             us": [
            statistics.median(control[:WARM_UP]) for control, _ in runs
        ],
        "observe and decide, regulation          us": [
            statistics.median(control[WARM_UP:]) for control, _ in runs
        ],
        "beliefs                                 us": [
            statistics.median(words) for _, words in runs
        ],
        "regulator step                          us": [tick_us for _, tick_us in hours],
        "simulated hour with plant                s": [hour_s for hour_s, _ in hours],
    }
    for name, values in rows.items():
        print(f"{name} {spread(values)}")


if __name__ == "__main__":
    main()
