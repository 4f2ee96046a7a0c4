"""The command that studies a recorded run: ``replay``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from thermoctl.app.commands.options import FILE, Parsed, examples, positive_number
from thermoctl.app.commands.order_options import candidates_option, require_auto
from thermoctl.app.results import console, print_json, say, write_figures
from thermoctl.estimation import Order
from thermoctl.model.arx import Arx
from thermoctl.studies.csv_record import read_csv
from thermoctl.studies.figure import FORMATS, require_matplotlib
from thermoctl.studies.history_record import is_history, read_history_record
from thermoctl.studies.laws import EXAMPLES, LawSpec, parse_law, parse_order_or_auto
from thermoctl.studies.orders import USUAL, Weighing, weigh
from thermoctl.studies.present import print_replay, replay_json
from thermoctl.studies.record import ColumnError, Columns, Record, RecordError
from thermoctl.studies.replay import replay
from thermoctl.studies.replay_figure import draw_replay


def _figure_file(text: str) -> Path:
    """Return the path, if it names a format that can be drawn."""
    if Path(text).suffix.lower() not in FORMATS:
        raise ValueError(f"expected a file ending in {' or '.join(FORMATS)}, got {text!r}")
    return Path(text)


@click.command(
    "replay",
    epilog=examples(
        "thermoctl replay history.sqlite --loop tank",
        "thermoctl replay run.csv --order 1,1,1 --estimator ckf --estimator rls:0.99",
        "thermoctl replay run.csv --order auto --candidates 1-3,1-2,1-8",
    ),
)
@click.argument("file", type=FILE)
@click.option("--time", "time_column", metavar="NAME", help="Column of the time, s or ISO 8601.")
@click.option("--input", "input_column", metavar="NAME", help="Column of the applied input.")
@click.option("--output", "output_column", metavar="NAME", help="Column of the temperature.")
@click.option("--loop", metavar="NAME", help="Which loop, where a history holds several.")
@click.option(
    "--order",
    type=Parsed("n,m,d|auto", parse_order_or_auto),
    default="2,2,1",
    show_default=True,
    help="Past outputs, inputs, and delay in samples; auto: what the record speaks for.",
)
@candidates_option
@click.option(
    "--estimator",
    "laws",
    type=Parsed("law", parse_law),
    multiple=True,
    default=("ckf", "nkf", "rls:0.98"),
    show_default=True,
    help=f"Once for each estimator; such as {EXAMPLES}.",
)
@click.option(
    "--R2",
    "noise",
    type=Parsed("variance", positive_number),
    help="Noise variance, in the unit of the output squared; estimated when not given.",
)
@click.option(
    "--P0",
    "start_variance",
    type=Parsed("variance", positive_number),
    default="100",
    show_default=True,
    help="Of every parameter at the start, in the scaled variables.",
)
@click.option("--keep-mean", is_flag=True, help="Neither remove the mean nor scale.")
@click.option(
    "--plot",
    type=Parsed("file", _figure_file),
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
    order: Arx | None,
    candidates: Sequence[Order],
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
    require_auto(order, candidates)
    if plot:
        require_matplotlib()
    record = _read(file, Columns(output_column, input_column, time_column), loop)
    model: Arx | Weighing | None = order
    if model is None:
        model = weigh(record, candidates or USUAL, R2=noise, P0=start_variance, keep_mean=keep_mean)
    result = replay(record, model, laws, R2=noise, P0=start_variance, keep_mean=keep_mean)
    if plot:
        write_figures(plot, lambda: draw_replay(result, list(plot)))
    if as_json:
        say(record.notes)
        print_json(replay_json(result))
    else:
        print_replay(console(), result)


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
