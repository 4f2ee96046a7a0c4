"""Runs every controller through every scenario on every plant, once each."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context, parent_process
from pathlib import Path

from thermoctl.regulator import Plan
from thermoctl.studies.compare.bounds import bounds
from thermoctl.studies.compare.plants import FLEETS, Plant, plant
from thermoctl.studies.compare.play import play
from thermoctl.studies.compare.scenarios import SCENARIOS, Scenario
from thermoctl.studies.compare.score import measured
from thermoctl.studies.compare.store import Result, Store

BOUND = "bound"
"""Stands for the controller in results that are bounds."""

_TOP = Path(__file__).parents[2]
_DECISIVE = (
    "quantities.py",
    "ranges.py",
    "model",
    "estimation",
    "control",
    "plant",
    "regulator",
    *(f"studies/compare/{name}.py" for name in ("baselines", "marlin", "play", "score", "stand")),
)
"""Source that decides what comes of a run: after a change to it, it is another program."""

_DECISIVE_FOR_BOUNDS = (
    "quantities.py",
    "ranges.py",
    "plant",
    *(f"studies/compare/{name}.py" for name in ("bounds", "labs", "linear", "riccati", "swift")),
)
"""Source that decides what the bounds are."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A controller that takes part.

    Parameters
    ----------
    name : str
        What it is called in tables.
    identity : str
        Its whole configuration in words, equal for equal ones.
    plan_for : callable
        Returns its regulator's parts for a plant; goes to other processes, so it must pickle.
    period_s : float
        Time between two samples.
    """

    name: str
    identity: str
    plan_for: Callable[[Plant], Plan]
    period_s: float = 1.0


@dataclass(frozen=True, slots=True)
class Job:
    """One run, or the bounds of runs.

    Parameters
    ----------
    contender : Contender or None
        Who controls; None: the bounds of that scenario on that plant.
    plant : Plant
        What is controlled.
    scenario : Scenario
        What happens.
    period_s : float
        Time between two samples.
    key : str
        What the result depends on, as a digest: configuration, plant, scenario, program.
    """

    contender: Contender | None
    plant: Plant
    scenario: Scenario
    period_s: float
    key: str

    @classmethod
    def of(
        cls, contender: Contender | None, plant: Plant, scenario: Scenario, period_s: float
    ) -> Job:
        """Return the job with its key."""
        who, source = (BOUND, _DECISIVE_FOR_BOUNDS)
        if contender is not None:
            who, source = contender.identity, _DECISIVE
        parts = [who, repr(plant), repr(scenario), period_s, program(source)]
        key = hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:32]
        return cls(contender, plant, scenario, period_s, key)


@cache
def program(parts: tuple[str, ...]) -> str:
    """Return a digest of the source under `parts` of the package."""
    digest = hashlib.sha256()
    for part in parts:
        below = _TOP / part
        for path in sorted(below.rglob("*.py")) if below.is_dir() else [below]:
            digest.update(f"{path.relative_to(_TOP)}\0".encode() + path.read_bytes())
    return digest.hexdigest()


def jobs_for(
    contenders: Sequence[Contender],
    fleets: Iterable[str],
    seeds: range,
    scenarios: Sequence[str] = (),
) -> list[Job]:
    """Return every run, seed by seed.

    So an interrupted comparison is one of fewer plants.

    Parameters
    ----------
    contenders : sequence of Contender
        Who takes part.
    fleets : iterable of str
        Names of fleets.
    seeds : range
        Plants of each fleet.
    scenarios : sequence of str
        Only these; every scenario of a fleet when empty.

    Raises
    ------
    FleetError
        There is no such fleet.
    """
    periods_s = dict.fromkeys(each.period_s for each in contenders)
    jobs = []
    for seed in seeds:
        for fleet in fleets:
            member = plant(fleet, seed)
            for name in FLEETS[fleet].scenarios:
                if scenarios and name not in scenarios:
                    continue
                scenario = SCENARIOS[name]
                jobs += [Job.of(None, member, scenario, period_s) for period_s in periods_s]
                jobs += [Job.of(each, member, scenario, each.period_s) for each in contenders]
    return jobs


def work(job: Job) -> Result:
    """Return what comes of one job."""
    contender, where, scenario = job.contender, job.plant, job.scenario
    names = (where.fleet, scenario.name, where.seed)
    if contender is None:
        return Result(job.key, BOUND, *names, bounds(where, scenario, job.period_s))
    trace = play(contender.plan_for(where), where, scenario)
    return Result(job.key, contender.name, *names, measured(trace), trace.failure)


def finished(jobs: Sequence[Job], store: Store, processes: int) -> Iterator[tuple[Job, Result]]:
    """Yield each job with its result; those in `store` come first.

    Whoever stops early keeps what is finished: results are stored before they are yielded, and
    runs that are under way are waited for and stored.

    Parameters
    ----------
    jobs : sequence of Job
        What is to be known.
    store : Store
        Where results are looked up and kept.
    processes : int
        How many runs at a time; 1: in this process.

    Raises
    ------
    StoreError
        A result cannot be kept.
    """
    missing = []
    for job in jobs:
        if job.key in store:
            yield job, store[job.key]
        else:
            missing.append(job)
    if processes == 1 or len(missing) < 2:
        for job in missing:
            store.add(work(job))
            yield job, store[job.key]
    else:
        yield from _in_processes(missing, store, processes)


def _in_processes(jobs: list[Job], store: Store, processes: int) -> Iterator[tuple[Job, Result]]:
    """Yield the results of `jobs` in the order in which they come."""
    # Started anew instead of forked: a fork would copy the threads' locks of whoever draws a bar.
    pool = ProcessPoolExecutor(processes, get_context("spawn"), initializer=_belong_to_parent)
    futures: dict[Future[Result], Job] = {}
    try:
        futures.update({pool.submit(work, job): job for job in jobs})
        for future in as_completed(futures):
            store.add(future.result())
            yield futures[future], future.result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for future, job in futures.items():
            ended = future.done() and not future.cancelled() and future.exception() is None
            if ended and job.key not in store:
                store.add(future.result())


def _belong_to_parent() -> None:
    """Leave interrupts from the keyboard to the process that gives out the work; end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, name="end-with-parent", daemon=True).start()


def _end_with_parent() -> None:
    """End this process as soon as its parent is gone, however that was killed."""
    parent = parent_process()
    if parent is not None:
        parent.join()  # the system closes the parent's end of a pipe, after SIGKILL too
        os._exit(1)  # SystemExit would end this thread alone; the main one waits for work for good
