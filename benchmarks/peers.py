"""Speed beside other packages and beside C: ``python benchmarks/peers.py [--rounds N] [--json]``.

Every round runs all contenders of a table one after the other, so that a slow moment of the machine
hits all alike; a ratio is taken within a round, and its median is printed with the least and the
greatest. Times are CPU times of one thread on one core. Before anything is timed contenders must
agree on what they compute; one that does not gets no ratio. See ``docs/benchmarks.md``.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
import peer_batches
import peer_filters

from thermoctl.quantities import Array

SIZES = (1, 2, 4)
FEW, SAMPLES = 20, 1000
T, R = 400, 1000
AGREEMENT = 1e-9

Work = Callable[[], tuple[Array, Array]]


@dataclass(frozen=True, slots=True)
class Line:
    """One peer beside ours; times in `unit`, one a round.

    `apart` is how far the two lie apart, at worst, relative to the largest of what they compute.
    """

    table: str
    n: int
    peer: str
    unit: str
    ours: list[float]
    theirs: list[float]
    apart: float

    @property
    def agrees(self) -> bool:
        """Whether both compute the same; false for NaN."""
        return self.apart <= AGREEMENT

    @property
    def ratios(self) -> list[float]:
        """Time of the peer over ours, round by round."""
        return [theirs / ours for ours, theirs in zip(self.ours, self.theirs, strict=True)]


@dataclass(frozen=True, slots=True)
class Goal:
    """What a median of ratios is to reach; `peers` are those it is asked of."""

    text: str
    tables: tuple[str, ...]
    peers: Callable[[str], bool]
    least: float


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a goal is met; `least_ratio` is the worst median, None where nothing was measured."""

    goal: str
    n: int
    met: bool
    least_ratio: float | None


GOALS = (
    Goal(
        "one update ahead of every pure Python peer",
        tuple(peer_filters.PEERS),
        lambda peer: peer not in peer_filters.COMPILED,
        1.0,
    ),
    Goal(
        "a batch 800 times as fast as filterpy with (26), looped",
        tuple(peer_batches.PEERS),
        lambda peer: peer.startswith("filterpy"),
        800.0,
    ),
    Goal(
        "a batch in at most 7 times the time of the loop in C",
        tuple(peer_batches.PEERS),
        lambda peer: peer == "C loop",
        1.0 / 7.0,
    ),
)


def on_one_thread() -> None:
    """Start again with one thread for linear algebra unless it is so, and stay on one core."""
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL")}
    if any(os.environ.get(name) != value for name, value in threads.items()):
        os.execve(sys.executable, [sys.executable, *sys.argv], os.environ | threads)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def seconds(work: Work) -> float:
    """Return the CPU time of `work`, without what the garbage collector would add by chance."""
    gc.disable()
    try:
        began = time.process_time()
        work()
        return time.process_time() - began
    finally:
        gc.enable()


def interleaved(works: Mapping[str, Work], rounds: int) -> dict[str, list[float]]:
    """Return the CPU times of each work in s, one a round; one round more warms up."""
    taken: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds + 1):
        for name, work in works.items():
            taken[name].append(seconds(work))
    return {name: times[1:] for name, times in taken.items()}


def apart(one: tuple[Array, ...], other: tuple[Array, ...]) -> float:
    """Return how far arrays lie apart at worst, relative to the largest number in each."""
    return max(
        float(np.abs(a - b).max() / np.abs(a).max()) for a, b in zip(one, other, strict=True)
    )


def present(makers: Mapping[str, Callable[[], Work]], absent: dict[str, str]) -> dict[str, Work]:
    """Return the contenders that can be made; note the others in `absent`."""
    made = {}
    for name, make in makers.items():
        try:
            made[name] = make()
        except ImportError as error:
            absent[name] = str(error)
    return made


def online(rounds: int, absent: dict[str, str]) -> Iterator[Line]:
    """Yield a line for each peer that learns from one sample at a time.

    They are compared after few samples, when the beginning still counts, and after all.
    """
    for table, peers in peer_filters.PEERS.items():
        contenders = {"ours": peer_filters.OURS[table], **present(peers, absent)}
        for n in SIZES:
            few, stream = (peer_filters.Stream.of(n, samples) for samples in (FEW, SAMPLES))
            works = {name: partial(run, stream) for name, run in contenders.items()}
            learned = {name: (*run(few), *run(stream)) for name, run in contenders.items()}
            us = {
                name: [1e6 * t / SAMPLES for t in times]
                for name, times in interleaved(works, rounds).items()
            }
            for name in list(works)[1:]:
                distance = apart(learned["ours"], learned[name])
                yield Line(table, n, name, "us", us["ours"], us[name], distance)


def batches(rounds: int, absent: dict[str, str]) -> Iterator[Line]:
    """Yield a line for each peer that runs many replications.

    A peer that ran only some of them is compared on these, and its time is scaled to all.
    """
    for table, peers in peer_batches.PEERS.items():
        for n in SIZES:
            rng = np.random.default_rng(n)
            y, phi = rng.normal(size=(T, R)), rng.normal(size=(T, R, n))
            makers = {name: partial(make, y, phi) for name, make in peers.items()}
            works = {"ours": peer_batches.OURS[table](y, phi), **present(makers, absent)}
            theta, P = works["ours"]()
            taken = interleaved(works, rounds)
            for name in list(works)[1:]:
                theirs = works[name]()
                ran = theirs[0].shape[1]
                yield Line(
                    table,
                    n,
                    name if ran == R else f"{name}, {ran} of {R} timed",
                    "ms",
                    [1e3 * t for t in taken["ours"]],
                    [1e3 * t * R / ran for t in taken[name]],
                    apart((theta[:, :ran], P[:, :ran]), theirs),
                )


def verdicts(lines: list[Line]) -> Iterator[Verdict]:
    """Yield what became of every goal, for each number of parameters."""
    for goal in GOALS:
        for n in SIZES:
            asked = [
                line
                for line in lines
                if line.n == n and line.table in goal.tables and goal.peers(line.peer)
            ]
            least = min((statistics.median(line.ratios) for line in asked), default=None)
            met = least is not None and least > goal.least and all(line.agrees for line in asked)
            yield Verdict(goal.text, n, met, least)


def spread(values: list[float], digits: int = 2) -> str:
    """Return the median of `values` with the least and the greatest."""
    middle, low, high = statistics.median(values), min(values), max(values)
    return f"{middle:9.{digits}f} ({low:.{digits}f} .. {high:.{digits}f})"


def machine() -> str:
    """Return what the figures depend on."""
    cores = f"{os.cpu_count()} cores, pinned to one"
    return f"Python {platform.python_version()}, NumPy {np.__version__}, {cores}, one thread"


def show(lines: Iterator[Line]) -> list[Line]:
    """Print the tables while they are measured; return their lines."""
    shown: list[Line] = []
    for line in lines:
        if not shown or (shown[-1].table, shown[-1].n) != (line.table, line.n):
            print(f"\n{line.table}, n={line.n}: ours {spread(line.ours).strip()} {line.unit}")
        if line.agrees:
            ratio = f"{spread(line.ratios)} times ours"
        else:
            ratio = f"  no ratio: it differs by {line.apart:.1e}"
        print(f"  {line.peer:36s}{spread(line.theirs):28s} {line.unit} {ratio}", flush=True)
        shown.append(line)
    return shown


def main() -> None:
    """Measure, print and judge."""
    parser = argparse.ArgumentParser(description="Speed beside other packages and beside C.")
    parser.add_argument("--rounds", type=int, default=9, help="rounds to measure, 9 by default")
    parser.add_argument("--json", action="store_true", help="print one JSON object instead")
    options = parser.parse_args()
    if options.rounds < 1:
        parser.error(f"--rounds must be at least 1, got {options.rounds}")
    on_one_thread()
    absent: dict[str, str] = {}

    def measured() -> Iterator[Line]:
        yield from online(options.rounds, absent)
        yield from batches(options.rounds, absent)

    if options.json:
        lines = list(measured())
    else:
        print(f"{machine()}; medians of {options.rounds} interleaved rounds with their range")
        lines = show(measured())
    judged = list(verdicts(lines))
    if options.json:
        found = {
            "machine": machine(),
            "lines": [asdict(line) | {"agrees": line.agrees} for line in lines],
            "goals": [asdict(each) for each in judged],
            "absent": absent,
        }
        print(json.dumps(found))
        return
    print()
    for each in judged:
        least = (
            "not measured" if each.least_ratio is None else f"least ratio {each.least_ratio:.3g}"
        )
        print(f"{'met' if each.met else 'NOT MET':8s}{each.goal}, n={each.n} ({least})")
    for name, why in absent.items():
        print(f"absent  {name}: {why}")


if __name__ == "__main__":
    main()
