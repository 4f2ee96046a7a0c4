"""``thermoctl compare``: controllers on the same plants, against computed bounds."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click

from thermoctl.app import plugins
from thermoctl.app.commands.endings import EXIT_FAILED, terminable
from thermoctl.app.commands.options import FILE, Parsed, examples, json_option
from thermoctl.app.configuration.bases import Options
from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.parts import plan_for
from thermoctl.app.plugins import BadOption
from thermoctl.app.results import (
    console,
    make_folder,
    print_json,
    say,
    watched,
    write_figures,
)
from thermoctl.app.settings import load
from thermoctl.app.sim import profile
from thermoctl.errors import ConfigError, Refused, Unavailable
from thermoctl.plant.parameters import TankParameters
from thermoctl.quantities import WATER_J_PER_L_K
from thermoctl.regulator import Plan
from thermoctl.studies.compare.baselines import BASELINES, options_for, require
from thermoctl.studies.compare.figure import MOST_DRAWN, draw_comparison
from thermoctl.studies.compare.plants import FLEETS, Plant, Usage, plant
from thermoctl.studies.compare.present import as_json as lines_as_json
from thermoctl.studies.compare.present import misses, print_table
from thermoctl.studies.compare.run import Contender, Job, finished, jobs_for
from thermoctl.studies.compare.scenarios import SCENARIOS, SETPOINT
from thermoctl.studies.compare.store import Result, Store
from thermoctl.studies.compare.summary import Line, summarise
from thermoctl.studies.figure import FORMATS

RESULTS, FIGURE = "results.jsonl", "compare"
USUAL = ("adaptive", "self-tuning-mv:reference_time_s=60", "simple-pid", "marlin-mpc", "on-off")
"""Who takes part when nobody is named; only those of them that are installed."""

_SEEDS, _QUICK_SEEDS = 20, 4


def known_kinds() -> tuple[str, ...]:
    """Return the kinds of controllers that can take part."""
    return tuple(sorted({*plugins.kinds(plugins.CONTROLLERS), *BASELINES}))


def contender(
    text: str, table: LoopTable, *, nameplate: bool = False, fitted: bool = True
) -> Contender:
    """Return the controller of `text`: a kind, or ``kind:option=value,...``.

    Values are written as in TOML.

    Parameters
    ----------
    text : str
        Kind and options.
    table : LoopTable
        The loop it works in: limits, model, estimator and period.
    nameplate : bool
        Tell the model of every loop the gain that litres and watts of its plant make.
    fitted : bool
        Give a loop the limits and the gain that its fleet is used with, where it has some.

    Raises
    ------
    BadOption
        There is no such kind or option, or its value is bad.
    Unavailable
        It is a baseline whose package is not installed.
    """
    kind, _, rest = text.partition(":")
    if kind not in known_kinds():
        raise BadOption(f"no controller is called {kind!r}{plugins.nearest(kind, known_kinds())}")
    if kind in BASELINES:
        require(kind)
    options = _options(text, rest)
    law = Options.model_validate({"kind": kind, **options})
    own = table.model_copy(update={"controller": law, "shadow": None})
    build = partial(_plan, own, nameplate=nameplate, fitted=fitted)
    build(plant("rig", 0))  # so that a bad option is told before anything is run
    identity = json.dumps(
        [own.model_dump(mode="json"), nameplate, fitted, _origin(kind)], sort_keys=True
    )
    return Contender(text, identity, build, table.period_s)


def _options(text: str, written: str) -> dict[str, Any]:
    """Return the options behind the colon."""
    try:
        return dict(tomllib.loads(f"options = {{{written}}}")["options"])
    except tomllib.TOMLDecodeError as error:
        raise BadOption(f"expected kind:option=value,... as in TOML, got {text!r}") from error


def _origin(kind: str) -> str:
    """Return the package a controller comes from, with its version."""
    declared = plugins.kinds(plugins.CONTROLLERS).get(kind)
    package = None if declared is None else declared.dist
    return "" if package is None else f"{package.name} {package.version}"


def _plan(table: LoopTable, where: Plant, *, nameplate: bool, fitted: bool) -> Plan:
    """Return the parts of a regulator for one plant."""
    if fitted:
        table = _fitted(table, where.usage)
    tank = where.parameters
    if nameplate and isinstance(tank, TankParameters):
        table = _told(table, tank.element.rated_w / (WATER_J_PER_L_K * tank.vessel.volume_l))
    kind = table.controller.kind
    if kind not in BASELINES:
        return plan_for(table)
    ordered = options_for(kind, where, nameplate=nameplate)
    law = plugins.build(BASELINES[kind], {**ordered, **table.controller.options})
    stand_in = table.model_copy(update={"controller": Options(kind="on-off"), "shadow": None})
    return replace(plan_for(stand_in), controller=law)


def _fitted(table: LoopTable, usage: Usage) -> LoopTable:
    """Return the loop as `usage` has it; what that leaves open is as it was.

    Litres are those of the configured watts alone.
    """
    own = {
        "setpoint_c": usage.held_c,
        "setpoint_max_c": usage.setpoint_max_c,
        "trip_above_c": usage.trip_above_c,
        "heater_w": usage.heater_w,
    }
    told: dict[str, Any] = {name: each for name, each in own.items() if each is not None}
    if "heater_w" in told:
        told["volume_l"] = None
    table = table.model_copy(update=told)
    return table if usage.gain_k_per_s is None else _told(table, usage.gain_k_per_s)


def _told(table: LoopTable, gain_k_per_s: float) -> LoopTable:
    """Return the loop with a model that is told its gain."""
    model = table.model.model_copy(update={"gain_k_per_s": gain_k_per_s})
    return table.model_copy(update={"model": model})


def _name(what: str, known: Sequence[str]) -> Parsed:
    """Return the type of an option that takes one of some names, and tells them to who errs."""

    def named(text: str) -> str:
        if text not in known:
            raise ValueError(f"expected one of {', '.join(known)}, got {text!r}")
        return text

    return Parsed(what, named)


@click.command(
    "compare",
    epilog=examples(
        "thermoctl compare --quick",
        "thermoctl compare --controller on-off:hysteresis_k=0.2 --controller simple-pid",
        "thermoctl compare --fleet sizes --fleet lags --seeds 36 --out fleets",
    ),
)
@click.option(
    "--controller",
    "texts",
    multiple=True,
    metavar="KIND[:OPTION=VALUE,...]",
    help="Once for each; options as in TOML. When not given, those that are installed of "
    + ", ".join(USUAL),
)
@click.option(
    "-c",
    "--config",
    type=FILE,
    metavar="FILE",
    help="Where limits, model and estimator come from; the aquarium when not given, with the "
    "limits and the gain of a lab for a lab.",
)
@click.option(
    "--fleet",
    "fleets",
    type=_name("fleet", tuple(FLEETS)),
    multiple=True,
    default=("rig",),
    show_default=True,
    help="Once for each: " + "; ".join(f"{name} ({each.text})" for name, each in FLEETS.items()),
)
@click.option(
    "--scenario",
    "scenarios",
    type=_name("scenario", tuple(SCENARIOS)),
    multiple=True,
    help="Only these; all of a fleet when not given.",
)
@click.option(
    "--seeds", type=click.IntRange(min=1), help=f"Plants of each fleet; {_SEEDS} when not given."
)
@click.option(
    "--first-seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Of the first plant: from another one on, plants that nobody has looked at.",
)
@click.option("--quick", is_flag=True, help=f"Only {_QUICK_SEEDS} plants: a minute or so.")
@click.option(
    "--nameplate", is_flag=True, help="Tell every model the gain that its litres and watts make."
)
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    help="Runs at a time; as many as there are processors when not given.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default="compare",
    show_default=True,
    help="Folder of results and figure; what is there is not run again.",
)
@click.option(
    "--check",
    is_flag=True,
    help="Exit 1 when the first controller misses a goal; the others are there to compare with.",
)
@json_option
def compare(
    texts: Sequence[str],
    config: Path | None,
    fleets: Sequence[str],
    scenarios: Sequence[str],
    seeds: int | None,
    first_seed: int,
    quick: bool,
    nameplate: bool,
    jobs: int | None,
    out: Path,
    check: bool,
    as_json: bool,
) -> int:
    """Compare controllers on the same simulated plants, as ratios to bounds.

    Every controller meets the same plants, mishaps and noise, and is judged on the true temperature
    of the water. Ctrl-C and SIGTERM keep what is finished.
    """
    if quick and seeds is not None:
        raise click.UsageError("expected --quick or --seeds, got both")
    count = seeds or (_QUICK_SEEDS if quick else _SEEDS)
    contenders = _contenders(texts, config, fleets, nameplate=nameplate)
    names = list(dict.fromkeys(each.name for each in contenders))
    met = range(first_seed, first_seed + count)
    planned = jobs_for(contenders, dict.fromkeys(fleets), met, scenarios)
    if not planned:
        raise click.UsageError(f"expected a scenario of {', '.join(fleets)}, got none of them")
    make_folder(out)
    store = Store(out / RESULTS)
    with terminable():
        results = _played(planned, store, jobs or os.cpu_count() or 1)
    lines = summarise(results, names)
    _draw(lines, names, out)
    if as_json:
        conditions = {"seeds": count, "first_seed": first_seed, "nameplate": nameplate}
        told = {**conditions, "results": str(store.path)}
        print_json({"lines": lines_as_json(lines), "conditions": told})
    else:
        print_table(console(), lines, names)
    missed = misses(lines, names[0]) if check else []
    say(missed)
    return EXIT_FAILED if missed else 0


def _contenders(
    texts: Sequence[str], config: Path | None, fleets: Sequence[str], *, nameplate: bool
) -> list[Contender]:
    """Return who takes part; say who is missing of the usual ones."""
    _, table = load(config or profile("aquarium")).loop()
    fitted = config is None
    for fleet in dict.fromkeys(fleets):
        _check_setpoints(table, fleet, fitted=fitted)
    made = partial(contender, table=table, nameplate=nameplate, fitted=fitted)
    if texts:
        try:
            return [made(text) for text in dict.fromkeys(texts)]
        except BadOption as wrong:  # typed, and in no file
            raise click.BadParameter(str(wrong), param_hint="--controller") from wrong
    there = []
    for text in USUAL:
        try:
            if text.partition(":")[0] not in known_kinds():
                raise Unavailable(f"no controller {text} is installed")
            there.append(made(text))
        except Unavailable as missing:
            say([f"{missing}; it is left out"])
    return there


def _check_setpoints(table: LoopTable, fleet: str, *, fitted: bool) -> None:
    """Refuse a loop in which the set points of a fleet's scenarios may not be asked for."""
    usage = FLEETS[fleet].usage
    steps = [
        each.amount or 0.0
        for name in FLEETS[fleet].scenarios
        for each in SCENARIOS[name].happenings
        if each.name == SETPOINT
    ]
    limits = plan_for(_fitted(table, usage) if fitted else table).limits
    try:
        for step_k in (0.0, *steps):
            limits.accept_setpoint(usage.held_c + step_k)
    except Refused as refusal:
        raise ConfigError(f"this loop cannot be compared: {refusal}") from refusal


def _played(planned: Sequence[Job], store: Store, processes: int) -> list[Result]:
    """Return every result; a terminal on stderr sees how far they are."""
    if store.passed_over:
        say([f"{store.path}: expected a result in every line, passed over {store.passed_over}"])
    results = []
    counted = enumerate(finished(planned, store, processes), start=1)
    try:
        for _, (_, result) in watched(counted, "comparing", len(planned), lambda item: item[0]):
            results.append(result)
    except KeyboardInterrupt as interrupt:
        kept = sum(job.key in store for job in planned)
        text = f"{kept} of {len(planned)} runs are in {store.path}"
        say([f"{text}; the same command goes on from there"])
        raise click.Abort from interrupt
    return results


def _draw(lines: Sequence[Line], names: Sequence[str], out: Path) -> None:
    """Draw the figure, or say why there is none: the table is there anyway."""
    files = [out / f"{FIGURE}{kind}" for kind in FORMATS]
    try:
        write_figures(files, lambda: draw_comparison(lines, names, files))
        if len(names) > MOST_DRAWN:
            say([f"the figure shows {MOST_DRAWN} of {len(names)} controllers, the table all"])
    except Unavailable as missing:
        say([str(missing)])
