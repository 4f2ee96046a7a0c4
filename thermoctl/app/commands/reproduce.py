"""Commands that repeat published work: studies of papers, and the experiment.

A paper's study is found in `PAPERS` and imported when it is asked for. One mechanism runs them all:
whatever satisfies `thermoctl.studies.papers.study.Study` gets a progress bar, a table or JSON, a
page of figures, and keeps what is finished when it is interrupted.
"""

from __future__ import annotations

import importlib
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, TypeVar

import click

from thermoctl.app.commands.endings import EXIT_INTERRUPTED
from thermoctl.app.commands.options import DURATION, FILE, Commands, Parsed, positive_number
from thermoctl.app.results import (
    console,
    make_folder,
    print_json,
    say,
    watched,
    write_figures,
)
from thermoctl.app.settings import load
from thermoctl.app.sim import profile, simulate
from thermoctl.studies.experiment import Run, measure, run_from_cycles
from thermoctl.studies.experiment_figure import draw_experiment
from thermoctl.studies.figure import FORMATS, require_matplotlib
from thermoctl.studies.papers.present import outcome_json, print_outcome
from thermoctl.studies.papers.study import Outcome, Study
from thermoctl.studies.present import experiment_json, print_experiment
from thermoctl.studies.words import duration

F = TypeVar("F", bound=Callable[..., None])

LONGEST_S: Final = 172_800.0
"""Longest experiment: two days, half a minute of CPU time; all of it is held in memory."""

MOST_REPLICATIONS: Final = 100_000
"""Most replications of a study: its means are known to a third of a per cent by then."""


@dataclass(frozen=True, slots=True)
class Paper:
    """Where the study of a paper stands, and others of that paper by their option.

    Parameters
    ----------
    place : str
        Class that satisfies `Study`, called with `seed` and perhaps `replications`.
    words : str
        What the study shows, as a sentence.
    others : mapping
        Option, such as ``--control``, to the paper whose study it chooses instead.
    """

    place: str
    words: str
    others: Mapping[str, Paper] = field(default_factory=dict)

    def study(self, **settings: int) -> Study:
        """Return the study with these settings, and its own defaults for the rest."""
        module, _, name = self.place.partition(":")
        study: Study = getattr(importlib.import_module(module), name)(**settings)
        return study


PAPERS: Final = {
    "ozbek2021": Paper(
        "thermoctl.studies.papers.ozbek2021:Ozbek2021",
        "Follow a parameter that jumps, with seven estimators, as O21 did.",
        {
            "--control": Paper(
                "thermoctl.studies.papers.control27:Control27",
                "Close the loop of (27) instead, over plants that change and one at rest.",
            )
        },
    ),
    "bicer2017": Paper(
        "thermoctl.studies.papers.bicer2017:Bicer2017",
        "Follow a drug through two compartments with a wrong model, as BO17 did.",
    ),
    "lainiotis": Paper(
        "thermoctl.studies.papers.lainiotis:Lainiotis",
        "Tell order and delay from samples, with the filter bank of ALF.",
    ),
}
"""Studies by the name of their command."""

_PAPER_HELP: Final = """Prints what all runs give as a table, and draws the paper's figures from the
first of them. Ctrl-C keeps what is finished."""


class _Reproduce(Commands):
    """A group that makes the command of a paper when it is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*PAPERS, *super().list_commands(ctx)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in PAPERS:
            return paper_command(cmd_name, PAPERS[cmd_name])
        return super().get_command(ctx, cmd_name)


@click.group("reproduce", cls=_Reproduce)
def reproduce() -> None:
    """Repeat published work with this program."""


# -- options ---------------------------------------------------------------------------------------

_seed_option = click.option(
    "--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of all noise."
)
_json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


def _out_option(folder: str) -> Callable[[F], F]:
    """Return ``--out``, into `folder` unless another is given."""
    return click.option(
        "--out",
        type=FILE,
        metavar="DIR",
        default=folder,
        show_default=True,
        help="Folder the figures go into.",
    )


def _replications_option(paper: Paper) -> Callable[[F], F]:
    """Return ``--replications``; which count is taken without it, the studies say."""
    counts = [f"{paper.study().replications:,} if not given"]
    counts += [f"{o.study().replications:,} with {option}" for option, o in paper.others.items()]
    return click.option(
        "--replications",
        type=click.IntRange(1, MOST_REPLICATIONS),
        help=f"Independent runs to average over; {', '.join(counts)}.",
    )


# -- a paper's study -------------------------------------------------------------------------------


def paper_command(name: str, paper: Paper) -> click.Command:
    """Return the command that runs the study of `paper`, or that of another option."""
    others = {option.strip("-").replace("-", "_"): option for option in paper.others}

    def run(replications: int | None, seed: int, out: Path, as_json: bool, **flags: bool) -> None:
        wanted = [flag for flag in others if flags[flag]]
        if len(wanted) > 1:
            raise click.UsageError(f"expected at most one of {', '.join(paper.others)}")
        chosen = paper.others[others[wanted[0]]] if wanted else paper
        given = {} if replications is None else {"replications": replications}
        stem = "-".join((name, *wanted))
        files = [out / f"{stem}{kind}" for kind in FORMATS]
        _reproduce(chosen.study(seed=seed, **given), files, as_json)

    for option, other in reversed(list(paper.others.items())):
        run = click.option(option, is_flag=True, help=other.words)(run)
    return click.command(name, help=f"{paper.words}\n\n{_PAPER_HELP}")(
        _replications_option(paper)(_seed_option(_out_option(name)(_json_option(run))))
    )


def _reproduce(study: Study, files: list[Path], as_json: bool) -> None:
    """Run `study`, show what came of it, and exit 130 where it was interrupted."""
    require_matplotlib()
    make_folder(files[0].parent)
    outcome, whole = _run(study)
    if not whole:
        say([f"interrupted: {outcome.replications:,} of {study.replications:,} runs are finished"])
    if not as_json:
        print_outcome(console(), study, outcome)
    drawn: list[Path] = []
    try:
        write_figures(files, lambda: study.draw(outcome, files))
        drawn = files
    finally:  # a disk that is full must not cost what was computed
        if as_json:
            print_json(outcome_json(study, outcome, drawn))
    if not whole:
        click.get_current_context().exit(EXIT_INTERRUPTED)


def _run(study: Study) -> tuple[Outcome, bool]:
    """Return the last outcome, and whether it is the whole."""
    outcome: Outcome | None = None
    outcomes = watched(study.run(), "replicating", study.replications, lambda o: o.replications)
    try:
        for outcome in outcomes:  # noqa: B007 - the last one is kept, whatever ends the loop
            pass
    except KeyboardInterrupt:
        if outcome is None:
            raise
        return outcome, False
    if outcome is None:
        raise RuntimeError(f"{type(study).__name__} found nothing")
    return outcome, True


# -- the experiment --------------------------------------------------------------------------------


def _bounded_duration(text: str) -> float:
    """Return a duration in s that an experiment may take."""
    duration_s = float(DURATION.convert(text, None, None))
    if duration_s > LONGEST_S:
        raise ValueError(f"expected at most {duration(LONGEST_S)}, got {text!r}")
    return duration_s


@reproduce.command("experiment")
@click.option(
    "--tc",
    "reference_time_s",
    type=Parsed("seconds", positive_number),
    help="Approach the set point with this time constant; the paper's law has none.",
)
@_seed_option
@click.option(
    "--duration",
    "duration_s",
    type=Parsed("duration", _bounded_duration),
    default="30m",
    show_default=True,
    help=f"Simulated time, such as 90s, 30m or 2h; at most {duration(LONGEST_S)}.",
)
@_out_option("experiment")
@_json_option
def experiment_command(
    reference_time_s: float | None, seed: int, duration_s: float, out: Path, as_json: bool
) -> None:
    """Heat the simulated aquarium from 25 to 37.5 °C, as O21 did.

    Draws counterparts of its Figures 20 to 22: output, input and the estimate of a(t).
    """
    require_matplotlib()
    title, stem = "The law of O21, equation (27), as printed", "experiment"
    if reference_time_s is not None:
        title = f"The law of O21 with a reference time constant of {reference_time_s:g} s"
        stem = f"experiment-tc{reference_time_s:g}"
    files = [out / f"{stem}{kind}" for kind in FORMATS]
    make_folder(out)
    run = _simulated(reference_time_s, duration_s, seed)
    measures = measure(run)
    write_figures(files, lambda: draw_experiment(run, measures, title, files))
    if as_json:
        conditions = {"tc_s": reference_time_s, "seed": seed, "duration_s": duration_s}
        print_json(experiment_json(measures, conditions, files))
    else:
        print_experiment(console(), title, measures)


def _simulated(reference_time_s: float | None, duration_s: float, seed: int) -> Run:
    """Run the paper's experiment on the simulated rig, at full speed."""
    content = tomllib.loads(profile("ozbek2021").read_text(encoding="utf-8"))
    if reference_time_s is not None:
        for loop in content["loops"].values():
            law = loop["controller"]
            law = {"kind": law} if isinstance(law, str) else law
            loop["controller"] = {**law, "reference_time_s": reference_time_s}
    cycles = simulate(load(content), duration_s, seed)
    timed = watched(cycles, "simulating", duration_s, lambda cycle: cycle.step.t_s)
    return run_from_cycles(timed)
