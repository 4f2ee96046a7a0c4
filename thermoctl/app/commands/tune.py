"""``thermoctl tune``: commissioning, bounded, with a report.

Runs one loop through a test signal (`thermoctl.app.tuning.trial`) and tells what that teaches
(`thermoctl.studies.tuning`). By the time anything is computed the run is over, and power 0 written.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import click

from thermoctl.app.commands.endings import EXIT_FAILED, EXIT_INTERRUPTED
from thermoctl.app.commands.options import (
    DURATION,
    Parsed,
    config_option,
    examples,
    json_option,
    positive_number,
    state_option,
)
from thermoctl.app.commands.order_options import candidates_option, require_auto
from thermoctl.app.commands.service import settings_of
from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.parts import plan_for
from thermoctl.app.results import console, make_folder, print_json, say
from thermoctl.app.settings import Settings, load_all
from thermoctl.app.sim import bench_settings, default_profile, stand_ins
from thermoctl.app.tuning.report import Report
from thermoctl.app.tuning.run import Ran, run_on_board, run_simulated
from thermoctl.app.tuning.trial import Ending, Outcome, plan
from thermoctl.errors import ConfigError, Refused
from thermoctl.estimation import Order
from thermoctl.model.arx import Arx
from thermoctl.studies.excitation import Excitation
from thermoctl.studies.laws import parse_order_or_auto
from thermoctl.studies.orders import USUAL
from thermoctl.studies.present import print_lines
from thermoctl.studies.record import RecordError
from thermoctl.studies.tuning import needed, tune
from thermoctl.studies.words import counted, duration

LONGEST_S: Final = 172_800.0
"""Longest run: two days; all of it is held in memory."""


def _powers(text: str) -> tuple[float, float]:
    """Return two powers, as fractions or in per cent."""
    try:
        low, high = (_power(word.strip()) for word in text.split(","))
    except ValueError:
        low, high = 1.0, 0.0
    if not 0.0 <= low < high <= 1.0:
        raise ValueError(
            f"expected two powers LO,HI from 0 to 1, the first one lower, such as 0,0.6 or"
            f" 0%,60%; got {text!r}"
        )
    return low, high


def _power(word: str) -> float:
    return float(word.removesuffix("%")) / (100.0 if word.endswith("%") else 1.0)


@click.command(
    "tune",
    epilog=examples(
        "thermoctl tune --sim",
        "thermoctl tune -c tank.toml --power 0,0.6 --band 3 --duration 30m",
    ),
)
@config_option
@click.option("--sim", is_flag=True, help="On a simulated tank, at full speed; no hardware.")
@click.option("--loop", metavar="NAME", help="Which loop; the first one when not given.")
@click.option(
    "--order",
    type=Parsed("n,m,d|auto", parse_order_or_auto),
    default="auto",
    show_default=True,
    help="Past outputs, inputs, and delay in samples; auto: what the run speaks for.",
)
@candidates_option
@click.option(
    "--power",
    "powers",
    type=Parsed("LO,HI", _powers),
    help="The two powers of the test signal; 0 and the loop's power_max when not given.",
)
@click.option(
    "--band",
    "band_k",
    type=Parsed("kelvin", positive_number),
    default="2",
    show_default=True,
    help="Width of the band below the set point in which the signal is given.",
)
@click.option(
    "--duration",
    "duration_s",
    type=DURATION,
    default="20m",
    show_default=True,
    help="Of the whole run, heating up included.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    help="Of the test signal, and of a simulation.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default="tune",
    show_default=True,
    help="Folder of the report and the recorded run.",
)
@click.option("--yes", is_flag=True, help="Heat without asking first.")
@state_option
@json_option
def tune_command(**options: Any) -> int:
    """Learn a loop's order and plant from a test signal, and suggest a model for it.

    Heats the loop to a band below its set point and gives two powers in turns there, with every
    limit of the loop in force. Ends with power 0, however it ends.
    """
    asked = _Asked(**options)
    require_auto(asked.order, asked.candidates)
    settings = _settings(asked)
    name, excitation = _planned(settings, asked)
    if not (asked.sim or asked.yes or sys.stdin.isatty()):
        raise click.UsageError(
            "expected --yes, or a terminal to ask on, before a board heats",
            click.get_current_context(),
        )
    if asked.sim:
        make_folder(asked.out)
        ran = run_simulated(settings, name, excitation)
    else:

        def consent() -> None:
            _consent(settings, name, excitation, asked)
            make_folder(asked.out)

        ran = run_on_board(settings, name, excitation, asked.state, consent)
    report = _learnt(settings, name, excitation, asked, ran)
    _tell(report, asked)
    return _code(ran[0])


@dataclass(frozen=True, slots=True)
class _Asked:
    """What the command line says."""

    configs: Sequence[Path]
    sim: bool
    loop: str | None
    order: Arx | None
    candidates: Sequence[Order]
    powers: tuple[float, float] | None
    band_k: float
    duration_s: float
    seed: int
    out: Path
    yes: bool
    state: Path | None
    as_json: bool

    @property
    def orders(self) -> Sequence[Order]:
        """The order that is given, or the candidates to weigh."""
        if self.order is not None:
            return (Order(self.order.n, self.order.m, self.order.delay),)
        return self.candidates or USUAL


def _settings(asked: _Asked) -> Settings:
    """Return the configuration; for a simulation, with a tank in place of every board."""
    if not asked.sim:
        return settings_of(asked.configs)
    given = load_all(list(asked.configs) or [default_profile()])
    say(
        f"{tank.volume_l:.3g} l heated with {tank.heater_w:.0f} W are simulated in place of board"
        f" {name}"
        for name, tank in stand_ins(given).items()
    )
    return bench_settings(given, asked.seed)


def _planned(settings: Settings, asked: _Asked) -> tuple[str, Excitation]:
    """Return the loop and the test signal; a signal it has no room for is wrong usage."""
    name, table = settings.loop(asked.loop)
    try:
        _require_heater(name, table)
        if asked.duration_s > LONGEST_S:
            raise ConfigError(f"expected at most {duration(LONGEST_S)}, got {asked.duration_s:g} s")
        excitation = plan(settings, name, asked.powers, asked.band_k, asked.duration_s, asked.seed)
        least_s = needed(asked.orders) * settings.loop(name)[1].period_s
        if asked.duration_s < least_s:
            raise ConfigError(
                f"expected a duration of at least {least_s:g} s for orders that look back so far,"
                f" got {asked.duration_s:g} s"
            )
        return name, excitation
    except ConfigError as problem:
        raise click.UsageError(str(problem), click.get_current_context()) from problem


def _require_heater(name: str, table: LoopTable) -> None:
    """Raise `ConfigError` for a loop that cannot be heated to a band: nothing would be learnt."""
    if table.leads is not None:
        raise ConfigError(
            f"expected a loop with a heater of its own, got {name!r}, which leads"
            f" {table.leads.loop!r}"
        )
    if plan_for(table).limits.power_cools:
        raise ConfigError(f"expected a loop that heats, got {name!r}, which only cools")


def _consent(settings: Settings, name: str, excitation: Excitation, asked: _Asked) -> None:
    """Ask before a real board heats; raise `Refused` when the answer is no."""
    if asked.yes:
        return
    outputs = settings.loop(name)[1].outputs
    board = outputs[0].board if outputs else "none"
    place = getattr(settings.boards.get(board), "port", None)
    click.echo(
        f"Loop {name} will heat through board {board}{f' at {place}' if place else ''}:"
        f" {100 * excitation.low:g} and {100 * excitation.high:g} % of full power, up to"
        f" {excitation.top_c:g} degC, and past it only by heat that is under way by then,"
        f" for at most {duration(excitation.duration_s)}.",
        err=True,
    )
    if not click.confirm("Begin?", err=True):
        raise Refused("nothing was switched on")


def _learnt(
    settings: Settings, name: str, excitation: Excitation, asked: _Asked, ran: Ran
) -> Report:
    """Return the report of a run; too few samples teach nothing, and that is told."""
    outcome, collector = ran
    table = settings.loop(name)[1]
    record = tuning = None
    why, least = "", needed(asked.orders)
    try:
        record = collector.finish()
        if len(record.t_s) >= least:
            tuning = tune(record, asked.orders, table.setpoint_c)
        else:
            why = _too_few(len(record.t_s), least)
    except RecordError as problem:  # its source is the run that is being told of
        told = str(problem).removeprefix(f"{collector.source}: ")
        why = told if record is not None else _too_few(0, least)
    dead_man_s = _dead_man_s(settings, table)
    return Report(name, table, asked.sim, excitation, outcome, record, tuning, why, dead_man_s)


def _too_few(samples: int, least: int) -> str:
    """Return why a run that has ended early teaches nothing."""
    came = "without a good reading" if not samples else f"after {counted(samples, 'good reading')}"
    return f"the run ended {came}; these orders need at least {least:,} without a gap"


def _dead_man_s(settings: Settings, table: LoopTable) -> float | None:
    """Return the dead-man time of the board that heats, None where it has no such setting."""
    board = settings.boards.get(getattr(table.actuator, "board", ""))
    value: object = getattr(board, "dead_man_s", None)
    return float(value) if isinstance(value, int | float) else None


def _tell(report: Report, asked: _Asked) -> None:
    """Print and write the report; if one fails, the other must not cost what a run has taught."""
    try:
        if asked.as_json:
            print_json(report.as_json(asked.out))
        else:
            print_lines(console(), report.lines())
    finally:
        say(f"{path} written" for path in report.write(asked.out))


def _code(outcome: Outcome) -> int:
    if outcome.ending is Ending.FAULT or not outcome.off_confirmed:
        return EXIT_FAILED
    return EXIT_INTERRUPTED if outcome.ending is Ending.INTERRUPTED else 0
