"""The command line: ``thermoctl --sim`` and its sub-commands.

Data goes to stdout, messages to stderr. Each sub-command's module is imported only when it is
called, so that the daemon starts quickly and stays small.
"""

from __future__ import annotations

import importlib
import math
import os
import sys
from pathlib import Path
from typing import Final

import click
from click.core import ParameterSource

from thermoctl import __version__
from thermoctl.app.commands.endings import EXPECTED, flush, prepare_streams, tell
from thermoctl.app.commands.options import DURATION, FILE, SPEED, Commands, examples, state_option

_COMMANDS: Final = {
    "run": "thermoctl.app.commands.service:run",
    "off": "thermoctl.app.commands.off:off",
    "status": "thermoctl.app.commands.control:status",
    "get": "thermoctl.app.commands.control:get",
    "set": "thermoctl.app.commands.control:set_command",
    "mode": "thermoctl.app.commands.control:mode",
    "output": "thermoctl.app.commands.control:output",
    "load": "thermoctl.app.commands.control:load",
    "controller": "thermoctl.app.commands.control:controller",
    "shadow": "thermoctl.app.commands.control:shadow",
    "watch": "thermoctl.app.commands.control:watch",
    "alarms": "thermoctl.app.commands.alarms:alarms",
    "history": "thermoctl.app.commands.service:history",
    "config": "thermoctl.app.commands.config:config",
    "drivers": "thermoctl.app.commands.boards:drivers",
    "doctor": "thermoctl.app.commands.boards:doctor",
    "simulate": "thermoctl.app.commands.boards:simulate",
    "tune": "thermoctl.app.commands.tune:tune_command",
    "forget": "thermoctl.app.commands.forget:forget",
    "replay": "thermoctl.app.commands.replay:replay_command",
    "reproduce": "thermoctl.app.commands.reproduce:reproduce",
    "compare": "thermoctl.app.commands.compare:compare",
}


class _Lazy(Commands):
    """A group whose commands are imported when they are asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        module, _, name = _COMMANDS[cmd_name].partition(":")
        command: click.Command = getattr(importlib.import_module(module), name)
        return command


_EXAMPLES: Final = examples(
    "thermoctl --sim",
    "thermoctl --sim -c tank.toml --speed max --duration 1h --json",
)


@click.group(cls=_Lazy, invoke_without_command=True, epilog=_EXAMPLES)
@click.version_option(__version__, prog_name="thermoctl")
@click.option(
    "--sim",
    is_flag=True,
    help="Bench test on a simulated tank; needs no hardware. 60 simulated seconds a second on a "
    "terminal, else as fast as it goes.",
)
@click.option(
    "-c",
    "--config",
    type=FILE,
    metavar="FILE",
    help="With --sim: the configuration to try; the aquarium of Özbek (2021) if not given.",
)
@click.option(
    "--speed",
    type=SPEED,
    metavar="X|max",
    help="With --sim: simulated seconds a second, up to 1e6.",
)
@click.option("--duration", type=DURATION, default=math.inf, help="End after this: 10m, 1h, ...")
@click.option("--seed", type=click.IntRange(min=0), help="Seed of the simulation.")
@click.option(
    "--no-history",
    is_flag=True,
    help="Do not record the bench test in sim.sqlite of the state folder.",
)
@state_option
@click.option("--json", "as_json", is_flag=True, help="JSON lines, also on a terminal.")
@click.pass_context
def cli(
    ctx: click.Context,
    sim: bool,
    config: Path | None,
    speed: float | None,
    duration: float,
    seed: int | None,
    no_history: bool,
    state: Path | None,
    as_json: bool,
) -> None:
    """Hold a temperature; identify the plant online, with error bars."""
    if ctx.invoked_subcommand is not None and sim:
        raise click.UsageError("expected --sim without a command", ctx)
    if not sim:
        _refuse_options_of_sim(ctx)
        if ctx.invoked_subcommand is None:
            click.echo(ctx.get_help())
        return
    from thermoctl.app import bench
    from thermoctl.app import sim as simulation
    from thermoctl.app.settings import load

    given = load(config or simulation.default_profile())
    for name, tank in simulation.stand_ins(given).items():
        tank_words = f"{tank.volume_l:.3g} l heated with {tank.heater_w:.0f} W"
        click.echo(f"thermoctl: {tank_words} are simulated in place of board {name}", err=True)
    settings = simulation.bench_settings(given, seed)
    as_json = as_json or not sys.stdout.isatty()
    options = bench.BenchOptions(
        speed=speed if speed is not None else (math.inf if as_json else 60.0),
        duration_s=duration,
        as_json=as_json,
        history=None if no_history else bench.history_path(state),
    )
    bench.run_bench(settings, options)


def _refuse_options_of_sim(ctx: click.Context) -> None:
    """Refuse what would be ignored: options before a command, and options without --sim."""
    for option in ctx.command.params:
        name = str(option.name)
        if ctx.get_parameter_source(name) not in (None, ParameterSource.DEFAULT):
            written = " or ".join(option.opts)
            command = ctx.invoked_subcommand
            behind = f"; those of {command} stand behind it" if command else ""
            raise click.UsageError(f"expected {written} only with --sim{behind}", ctx)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit; the entry point of the ``thermoctl`` command."""
    arguments = sys.argv[1:] if arguments is None else arguments
    prepare_streams()
    # Matrices of a few rows gain nothing from threads, which cost memory and disturb deadlines.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        result = cli.main(args=arguments, prog_name="thermoctl", standalone_mode=False)
        code = result if isinstance(result, int) else 0
        flush()
    except EXPECTED as error:
        code = tell(error, arguments)
    sys.exit(code)


if __name__ == "__main__":
    main()
