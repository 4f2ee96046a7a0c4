"""Cost of the estimators: ``python benchmarks/estimators.py``.

Prints microseconds of one update for each law and number of parameters, of one update of an
identifier and of a Lainiotis bank, and milliseconds of 1,000 x 400 replications at once and as a
plain loop. Every figure is CPU time, the median over rounds with the smallest and the largest
beside it.
"""

from __future__ import annotations

import statistics
import time
import timeit
from collections.abc import Callable
from functools import partial
from itertools import product

import numpy as np

from thermoctl.estimation import (
    CorrectedKalman,
    Guarded,
    Identifier,
    LainiotisBank,
    Order,
    RandomWalkKalman,
    RecursiveLeastSquares,
    VariableForgetting,
    run_batch,
    start,
)
from thermoctl.model.arx import Arx, KnownGain, Structure
from thermoctl.ports import Estimator
from thermoctl.quantities import Array

LAWS: dict[str, Estimator] = {
    "rls": RecursiveLeastSquares(0.98),
    "vff": VariableForgetting(10.0),
    "vff joint": VariableForgetting(10.0, joint=True),
    "nkf": RandomWalkKalman(1e-4, 1.0),
    "ckf": CorrectedKalman(0.0, 1.0),
    "ckf capped": Guarded(CorrectedKalman(0.0, 1.0), covariance_max=1.0),
    "ckf robust": Guarded(CorrectedKalman(0.0, 1.0), 1.0, 0.1, True),
}


def show(
    name: str, call: Callable[[], object], unit: float, number: int, rounds: int = 15
) -> float:
    """Print and return the median time of `call` in `unit` seconds."""
    call()
    times = [
        t / number / unit for t in timeit.repeat(call, "pass", time.process_time, rounds, number)
    ]
    middle = statistics.median(times)
    print(f"{name:34s}{middle:9.2f}   {min(times):8.2f} .. {max(times):.2f}")
    return middle


def updates() -> None:
    """Time one online update of every law."""
    print("one update, us")
    rng = np.random.default_rng(1)
    for n in (1, 2, 4):
        for name, law in LAWS.items():
            belief, phi = start(n), rng.normal(size=n)
            for _ in range(200):
                belief = law.update(belief, rng.normal(size=n), float(rng.normal()))
            show(f"{name}, n={n}", partial(law.update, belief, phi, 0.5), 1e-6, 4000)


def identifiers() -> None:
    """Time one update of an identifier, regressor included."""
    print("identifier update, us")
    structures: tuple[Structure, ...] = (KnownGain(0.0449), Arx(1, 1), Arx(2, 2, 2, 25.0, 10.0))
    for structure in structures:
        identifier = Identifier(structure, LAWS["ckf capped"])
        belief = identifier.start()
        for t in range(50):
            belief = identifier.update(belief, 25.0 + 0.03 * t, 0.5)
        name = f"{type(structure).__name__}, {structure.parameters} parameters"
        show(name, partial(identifier.update, belief, 27.0, 0.5), 1e-6, 4000)


def lainiotis_banks() -> None:
    """Time one update of a bank of few candidates and of many."""
    print("Lainiotis bank update, us")
    for n, m, d in ((2, 2, 3), (4, 3, 20)):
        orders = [
            Order(*sizes) for sizes in product(range(1, n + 1), range(1, m + 1), range(1, d + 1))
        ]
        bank = LainiotisBank(orders)
        for t in range(50):
            bank = bank.update(0.03 * t, 0.5)
        show(f"LainiotisBank, {len(orders)} candidates", partial(bank.update, 1.6, 0.4), 1e-6, 1000)


def one_by_one(law: Estimator, y: Array, phi: Array) -> None:
    """Run `law` over the replications of `y`, shape (T, R), one after the other."""
    for r in range(y.shape[1]):
        belief = start(phi.shape[2])
        for regressor, output in zip(phi[:, r], y[:, r], strict=True):
            belief = law.update(belief, regressor, float(output))


def batches() -> None:
    """Time the corrected filter on 1,000 x 400 replications, at once and one by one."""
    print("corrected filter, 1,000 x 400 replications, ms")
    rng, law = np.random.default_rng(2), CorrectedKalman(0.0, 1.0)
    for n in (1, 2, 4):
        y, phi = rng.normal(size=(400, 1000)), rng.normal(size=(400, 1000, n))
        at_once = show(f"run_batch, n={n}", partial(run_batch, law, y, phi), 1e-3, 1, 9)
        loop = 50 * show(
            f"plain loop over 20 of them, n={n}",
            partial(one_by_one, law, y[:, :20], phi),
            1e-3,
            1,
            5,
        )
        print(f"{'':34s}{loop / at_once:9.0f}   times faster than the plain loop over 1,000")


if __name__ == "__main__":
    updates()
    identifiers()
    lainiotis_banks()
    batches()
