"""The command line: ``thermoctl --sim`` and its sub-commands.

Data goes to stdout, messages to stderr. Each sub-command's module is imported only when it is
called, so that the daemon starts quickly and stays small.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import sys
from pathlib import Path
from typing import Any, Final

import click

from thermoctl import __version__
from thermoctl.app.options import DURATION, SPEED, state_option
from thermoctl.errors import ConfigError, ThermoctlError, Unavailable

EXIT_FAILED, EXIT_USAGE, EXIT_UNAVAILABLE, EXIT_PERMISSION, EXIT_CONFIG = 1, 2, 69, 77, 78

_COMMANDS: Final = {
    "run": "thermoctl.app.service_commands:run",
    "off": "thermoctl.app.off_command:off",
    "alarms": "thermoctl.app.service_commands:alarms",
    "history": "thermoctl.app.service_commands:history",
    "config": "thermoctl.app.config_commands:config",
    "drivers": "thermoctl.app.board_commands:drivers",
    "doctor": "thermoctl.app.board_commands:doctor",
    "simulate": "thermoctl.app.board_commands:simulate",
    "replay": "thermoctl.app.study_commands:replay_command",
    "reproduce": "thermoctl.app.study_commands:reproduce",
}


class _Lazy(click.Group):
    """A group whose commands are imported when they are asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        module, _, name = _COMMANDS[cmd_name].partition(":")
        command: click.Command = getattr(importlib.import_module(module), name)
        return command


@click.group(cls=_Lazy, invoke_without_command=True)
@click.version_option(__version__, prog_name="thermoctl")
@click.option("--sim", is_flag=True, help="Bench test on a simulated tank; needs no hardware.")
@click.option(
    "-c",
    "--config",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="With --sim: the configuration to try; the aquarium of Özbek (2021) if not given.",
)
@click.option(
    "--speed", type=SPEED, default=None, metavar="X|max", help="Simulated seconds a second."
)
@click.option("--duration", type=DURATION, default=math.inf, help="End after this: 10m, 1h, ...")
@click.option("--seed", type=click.IntRange(min=0), help="Seed of the simulation.")
@click.option("--no-history", is_flag=True, help="Do not record the bench test.")
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
    if ctx.invoked_subcommand is not None:
        if sim:
            raise click.UsageError("--sim stands alone, without a command")
        return
    if not sim:
        click.echo(ctx.get_help())
        return
    from thermoctl.app import bench
    from thermoctl.app import sim as simulation

    settings = simulation.bench_settings(config, seed)
    as_json = as_json or not sys.stdout.isatty()
    options = bench.BenchOptions(
        speed=speed if speed is not None else (math.inf if as_json else 60.0),
        duration_s=duration,
        as_json=as_json,
        history=None if no_history else bench.history_path(state),
    )
    bench.run_bench(settings, options)


def exit_code_of(error: BaseException) -> int:
    """Return the exit code that goes with an error."""
    match error:
        case ConfigError():
            return EXIT_CONFIG
        case Unavailable():
            return EXIT_UNAVAILABLE
        case PermissionError():
            return EXIT_PERMISSION
        case _:
            return EXIT_FAILED


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit; the entry point of the ``thermoctl`` command."""
    arguments = sys.argv[1:] if arguments is None else arguments
    # Matrices of a few rows gain nothing from threads, which cost memory and disturb deadlines.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        result = cli.main(args=arguments, prog_name="thermoctl", standalone_mode=False)
        code = result if isinstance(result, int) else 0
        sys.stdout.flush()
    except click.ClickException as error:
        error.show()
        code = error.exit_code
    except click.Abort:
        click.echo("thermoctl: interrupted", err=True)
        code = 130
    except (ThermoctlError, OSError) as error:
        code = exit_code_of(error)
        _tell(error, code, arguments)
    sys.exit(code)


def _tell(error: BaseException, code: int, arguments: list[str]) -> None:
    for line in str(error).splitlines() or [type(error).__name__]:
        click.echo(f"thermoctl: {line}", err=True)
    if "--json" in arguments:
        told: dict[str, Any] = {"kind": type(error).__name__, "text": str(error), "exit_code": code}
        if problems := getattr(error, "problems", ()):
            told["problems"] = [problem.as_json() for problem in problems]
        click.echo(json.dumps({"error": told}))


if __name__ == "__main__":
    main()
