"""Commands that study a run: ``replay`` and ``reproduce experiment``."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import Progress

from thermoctl.app.options import DURATION, FILE, Commands, examples
from thermoctl.app.settings import load
from thermoctl.app.sim import profile, simulate
from thermoctl.model.arx import Arx
from thermoctl.signals import Cycle
from thermoctl.studies.csv_record import read_csv
from thermoctl.studies.experiment import Run, measure, run_from_cycles
from thermoctl.studies.experiment_figure import draw_experiment
from thermoctl.studies.figure import FORMATS, require_matplotlib
from thermoctl.studies.history_record import is_history, read_history_record
from thermoctl.studies.laws import EXAMPLES, LawSpec, parse_law, parse_order
from thermoctl.studies.present import (
    experiment_json,
    print_experiment,
    print_replay,
    replay_json,
)
from thermoctl.studies.record import ColumnError, Columns, Record, RecordError
from thermoctl.studies.replay import replay
from thermoctl.studies.replay_figure import draw_replay
from thermoctl.studies.words import duration

LONGEST_S = 172_800.0
"""Longest experiment: two days, half a minute of CPU time; all of it is held in memory."""

PLAIN_WIDTH = 120
"""Columns of a table that goes into a file or a pipe."""


class _Parsed(click.ParamType):  # type: ignore[type-arg]  # no parameter before click 8.2
    """A word that `parse` understands, or refuses with a ValueError that says why."""

    def __init__(self, name: str, parse: Callable[[str], Any]) -> None:
        self.name = name
        self._parse = parse

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not isinstance(value, str):
            return value
        try:
            return self._parse(value)
        except ValueError as problem:
            self.fail(str(problem), param, ctx)


def _figure_file(text: str) -> Path:
    """Return the path, if it names a format that can be drawn."""
    if Path(text).suffix.lower() not in FORMATS:
        raise ValueError(f"expected a file ending in {' or '.join(FORMATS)}, got {text!r}")
    return Path(text)


def _positive(text: str) -> float:
    """Return a number greater than zero."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise ValueError(f"expected a number greater than zero, got {text!r}")
    return value


def _bounded_duration(text: str) -> float:
    """Return a duration in s that an experiment may take."""
    duration_s = float(DURATION.convert(text, None, None))
    if duration_s > LONGEST_S:
        raise ValueError(f"expected at most {duration(LONGEST_S)}, got {text!r}")
    return duration_s


@click.command(
    "replay",
    epilog=examples(
        "thermoctl replay history.sqlite --loop tank",
        "thermoctl replay run.csv --order 1,1,1 --estimator ckf --estimator rls:0.99",
    ),
)
@click.argument("file", type=FILE)
@click.option("--time", "time_column", metavar="NAME", help="Column of the time, s or ISO 8601.")
@click.option("--input", "input_column", metavar="NAME", help="Column of the applied input.")
@click.option("--output", "output_column", metavar="NAME", help="Column of the temperature.")
@click.option("--loop", metavar="NAME", help="Which loop, where a history holds several.")
@click.option(
    "--order",
    type=_Parsed("n,m,d", parse_order),
    default="2,2,1",
    show_default=True,
    help="Past outputs, inputs, and delay in samples.",
)
@click.option(
    "--estimator",
    "laws",
    type=_Parsed("law", parse_law),
    multiple=True,
    default=("ckf", "nkf", "rls:0.98"),
    show_default=True,
    help=f"Once for each estimator; such as {EXAMPLES}.",
)
@click.option(
    "--R2",
    "noise",
    type=_Parsed("variance", _positive),
    help="Noise variance, in the unit of the output squared; estimated when not given.",
)
@click.option(
    "--P0",
    "start_variance",
    type=_Parsed("variance", _positive),
    default="100",
    show_default=True,
    help="Of every parameter at the start, in the scaled variables.",
)
@click.option("--keep-mean", is_flag=True, help="Neither remove the mean nor scale.")
@click.option(
    "--plot",
    type=_Parsed("file", _figure_file),
    multiple=True,
    help="Draw into a .png or .svg file; may be given twice.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def replay_command(
    file: Path,
    time_column: str | None,
    input_column: str | None,
    output_column: str | None,
    loop: str | None,
    order: Arx,
    laws: Sequence[LawSpec],
    noise: float | None,
    start_variance: float,
    keep_mean: bool,
    plot: Sequence[Path],
    as_json: bool,
) -> None:
    """Compare how well estimators would have foreseen a recorded FILE.

    FILE is CSV with a line of column names, or a history written by thermoctl.
    """
    if plot:
        require_matplotlib()
    record = _read(file, Columns(output_column, input_column, time_column), loop)
    result = replay(record, order, laws, R2=noise, P0=start_variance, keep_mean=keep_mean)
    if plot:
        _draw(plot, lambda: draw_replay(result, list(plot)))
    if as_json:
        _say(record.notes)
        _print_json(replay_json(result))
    else:
        print_replay(_console(), result)


def _read(file: Path, wanted: Columns, loop: str | None) -> Record:
    """Read the file as what it is."""
    try:
        if is_history(file):
            return read_history_record(file, wanted, loop)
        if loop is not None:
            raise RecordError(f"{file}: expected a history of thermoctl for --loop, got other text")
        return read_csv(file, wanted)
    except ColumnError as error:
        raise click.UsageError(str(error)) from error
    except PermissionError:
        raise
    except OSError as error:
        raise RecordError(f"{file}: expected a readable file, got: {error.strerror}") from error


@click.group("reproduce", cls=Commands)
def reproduce() -> None:
    """Repeat published work with this program."""


@reproduce.command("experiment")
@click.option(
    "--tc",
    "reference_time_s",
    type=_Parsed("seconds", _positive),
    help="Approach the set point with this time constant; the paper's law has none.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of all noise."
)
@click.option(
    "--duration",
    "duration_s",
    type=_Parsed("duration", _bounded_duration),
    default="30m",
    show_default=True,
    help=f"Simulated time, such as 90s, 30m or 2h; at most {duration(LONGEST_S)}.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default="experiment",
    show_default=True,
    help="Folder the figures go into.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
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
    run = _simulated(reference_time_s, duration_s, seed)
    measures = measure(run)
    _draw(files, lambda: draw_experiment(run, measures, title, files))
    if as_json:
        conditions = {"tc_s": reference_time_s, "seed": seed, "duration_s": duration_s}
        _print_json(experiment_json(measures, conditions, files))
    else:
        print_experiment(_console(), title, measures)


def _simulated(reference_time_s: float | None, duration_s: float, seed: int) -> Run:
    """Run the paper's experiment on the simulated rig, at full speed."""
    content = tomllib.loads(profile("ozbek2021").read_text(encoding="utf-8"))
    if reference_time_s is not None:
        for loop in content["loops"].values():
            law = loop["controller"]
            law = {"kind": law} if isinstance(law, str) else law
            loop["controller"] = {**law, "reference_time_s": reference_time_s}
    cycles = simulate(load(content), duration_s, seed)
    return run_from_cycles(_with_progress(cycles, duration_s))


def _with_progress(cycles: Iterable[Cycle], duration_s: float) -> Iterator[Cycle]:
    """Yield `cycles`; a terminal on stderr sees how far they are, and nothing is left of it."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("simulating", total=duration_s)
        for cycle in cycles:
            bar.update(task, completed=cycle.step.t_s)
            yield cycle


def _draw(files: Sequence[Path], draw: Callable[[], Iterable[Path]]) -> None:
    """Draw, and say on stderr which folder was made and what was written."""
    missing = dict.fromkeys(file.parent for file in files if not file.parent.exists())
    try:
        written = list(draw())
        _say(f"folder {folder} made" for folder in missing)
        _say(f"figure written to {path}" for path in written)
    except PermissionError:
        raise
    except OSError as error:
        raise RecordError(
            f"{error.filename}: expected a place for a figure, got: {error.strerror}"
        ) from error


def _say(messages: Iterable[str]) -> None:
    """Write messages to stderr, one a line."""
    for message in messages:
        click.echo(f"thermoctl: {message}", err=True)


def _print_json(content: Mapping[str, Any]) -> None:
    """Write one object to stdout."""
    click.echo(json.dumps(content, allow_nan=False, ensure_ascii=False))


def _console() -> Console:
    """Return where tables go: as wide as the terminal, or as a line in a file may be."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=PLAIN_WIDTH)
