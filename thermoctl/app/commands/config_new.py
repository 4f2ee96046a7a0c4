"""``thermoctl config new``: a few questions, then a commented configuration."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import click

from thermoctl.app import plugins
from thermoctl.app.commands.options import FILE, examples
from thermoctl.app.compose import ACCEPTANCE, wiring_errors
from thermoctl.app.configuration.device_tables import SensorTable
from thermoctl.app.configuration.document import BadConfiguration, Document, Problem
from thermoctl.app.configuration.toml_text import toml_value
from thermoctl.app.doubts import HEADROOM_K, NO_HARDWARE, Doubt, doubts
from thermoctl.app.parts import sensor_for
from thermoctl.app.reach import reach_c
from thermoctl.app.settings import settings_in
from thermoctl.control.adaptive import Adaptive
from thermoctl.errors import ConfigError, Refused

_USUAL_TRIP_K, _LEAST_TRIP_K = 20.0, 2.0  # how far a trip that nobody named is from the set point
_NEAR_BOILING_C, _BOILING_C = 95.0, 100.0
_CURVES = list(SensorTable.model_json_schema()["properties"]["curve"]["enum"])
_RESISTIVE = ("pt100", "pt1000", "ntc")
"""Boards behind which nothing can be heated by mistake."""
_NEVER_GUESSED: Final = ("port", "volume_l", "heater_w")
"""What only somebody who has seen a real board can know."""


class _Finite(click.FloatRange):
    """A number in a range; unlike its base it refuses NaN and infinity, which no range refuses."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return `value` as a number in the range."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"expected a finite number, got {value}", param, ctx)
        return float(number)


_NUMBER, _POSITIVE = _Finite(), _Finite(min=0.0, min_open=True)
_WATER = _Finite(max=_BOILING_C, max_open=True)
_TAKEN = "expected a file that is not there yet, got {}; --force replaces it"


@dataclass(frozen=True, slots=True)
class Answers:
    """What a configuration is made of; a port or pull-up may be None."""

    kind: str
    port: str | None
    sensor: str
    pull_up_ohm: float | None
    volume_l: float
    heater_w: float
    setpoint_c: float
    trip_above_c: float
    mode: str
    resume: bool
    accept_no_dead_man: bool

    @property
    def setpoint_max_c(self) -> float:
        """Highest set point: a tenth of the way back from the trip, but with headroom."""
        room_k = max(0.1 * (self.trip_above_c - self.setpoint_c), HEADROOM_K)
        downwards = round(self.trip_above_c - room_k - 0.005 + 1e-8, 2)
        return max(downwards, self.setpoint_c)


@click.command(
    epilog=examples(
        "thermoctl config new -o tank.toml",
        "thermoctl config new --yes --setpoint-c 40 --trip-above-c 55",
        "thermoctl config new --yes --kind thermodaq --port /dev/thermodaq --volume-l 8 "
        "--heater-w 1500",
    )
)
@click.option("-o", "--out", type=FILE, help="File; stdout if not given.")
@click.option("--force", is_flag=True, help="Replace a file that is there.")
@click.option(
    "--yes",
    is_flag=True,
    help="Ask nothing: take the default where none is given; a real board needs --port, "
    "--volume-l and --heater-w.",
)
@click.option("--kind", help="Kind of the board; `thermoctl drivers` lists them.")
@click.option("--port", help="Serial device of the board.")
@click.option("--sensor", type=click.Choice(_CURVES), help="What measures.")
@click.option("--pull-up-ohm", type=_POSITIVE, help="Resistor a pt100, pt1000 or ntc is read with.")
@click.option("--volume-l", type=_POSITIVE, help="Water in the tank, in litres.")
@click.option("--heater-w", type=_POSITIVE, help="Rated power of the heater, in W.")
@click.option("--setpoint-c", type=_NUMBER, help="Temperature to hold, in degC.")
@click.option("--trip-above-c", type=_NUMBER, help="Off until acknowledged above this, in degC.")
@click.option("--mode", type=click.Choice(["off", "auto"]), help="Mode at the first start.")
@click.option("--resume/--no-resume", default=None, help="Whether a restart goes on.")
@click.option("--accept-no-dead-man", is_flag=True, help="An independent thermostat is fitted.")
def new(out: Path | None, force: bool, yes: bool, **given: Any) -> None:
    """Ask a few questions and write a commented configuration."""
    if out is not None and out.exists() and not force:
        raise Refused(_TAKEN.format(out))
    answers = _answers(_Interview(given, yes))
    text = commented(answers)
    for warning in _checked(text):
        click.echo(f"thermoctl: {warning}", err=True)
    if out is None:
        click.echo(text, nl=False)
        return
    _write(out, text, force)
    click.echo(f"{out} written; try it with: thermoctl --sim -c {out}", err=True)
    if answers.mode == "off":
        click.echo("once it runs, its loop is off until: thermoctl mode auto", err=True)


class _Interview:
    """Answers from options, else from the person, else the defaults."""

    def __init__(self, given: dict[str, Any], yes: bool) -> None:
        self._given, self._yes = given, yes

    def ask(self, name: str, question: str, default: Any, kind: Any = None) -> Any:
        """Return the answer called `name`."""
        value = self._given.get(name)
        if value is not None:
            return value
        if self._yes:
            return default
        try:
            if kind is bool:
                return click.confirm(question, default=default, err=True)
            return click.prompt(question, default=default, type=kind, err=True)
        except click.Abort as abort:
            if not isinstance(abort.__context__, EOFError):
                raise
            click.echo(err=True)  # the question stands on this line
            text = "expected an answer, got the end of input; with --yes nothing is asked"
            raise click.UsageError(text, click.get_current_context(silent=True)) from abort

    def refuse_to_guess(self, kind: str) -> None:
        """Raise `click.UsageError` where a real board would be described by nobody."""
        known = ("volume_l", "heater_w", *plugins.find(plugins.DRIVERS, kind).Settings.model_fields)
        missing = [each for each in _NEVER_GUESSED if each in known and self._given[each] is None]
        if self._yes and missing:
            wanted = ", ".join(map(_option, missing))
            text = f"expected {wanted} for {kind!r}, a real board, got --yes, which does not guess"
            raise click.UsageError(text, click.get_current_context(silent=True))


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _answers(interview: _Interview) -> Answers:
    ask = interview.ask
    kinds = list(plugins.kinds(plugins.DRIVERS))
    first = "simulated" if "simulated" in kinds else kinds[0]
    kind = ask("kind", "Board", first, click.Choice(kinds))
    port, real = None, kind not in NO_HARDWARE
    if real:
        interview.refuse_to_guess(kind)
    if "port" in plugins.find(plugins.DRIVERS, kind).Settings.model_fields:
        port = ask("port", "Serial device", f"/dev/{kind}", str)
    sensor = ask("sensor", "Sensor", "lm335", click.Choice(_CURVES))
    pull_up_ohm = None
    if sensor in _RESISTIVE:
        usual_ohm = 1_000.0 if sensor == "pt100" else 10_000.0
        pull_up_ohm = ask("pull_up_ohm", "Resistor it is read with, in ohm", usual_ohm, _POSITIVE)
    usual = (None, None) if real else (8.0, 1500.0)
    volume_l = ask("volume_l", "Water in the tank, in litres", usual[0], _POSITIVE)
    heater_w = ask("heater_w", "Rated power of the heater, in W", usual[1], _POSITIVE)
    setpoint_c = ask("setpoint_c", "Temperature to hold, in degC", 37.5, _WATER)
    trip_c = ask("trip_above_c", "Heater off until acknowledged above, in degC", *_trip(setpoint_c))
    if not trip_c > setpoint_c:
        raise ConfigError(
            f"expected --trip-above-c above the set point of {setpoint_c:g} degC, got {trip_c:g}"
        )
    first_mode = "off" if real else "auto"  # what heats is switched on by somebody who is there
    mode = ask("mode", "Mode at the first start", first_mode, click.Choice(["off", "auto"]))
    resume = ask("resume", "Go on after a restart", mode == "auto" and not real, bool)
    return Answers(
        kind=kind,
        port=port,
        sensor=sensor,
        pull_up_ohm=pull_up_ohm,
        volume_l=volume_l,
        heater_w=heater_w,
        setpoint_c=setpoint_c,
        trip_above_c=trip_c,
        mode=mode,
        resume=resume,
        accept_no_dead_man=bool(interview.ask("accept_no_dead_man", "", False)),
    )


def _trip(setpoint_c: float) -> tuple[float, _Finite]:
    """Return the usual trip above a set point and what may be answered: water boils at 100."""
    usual_c = max(min(setpoint_c + _USUAL_TRIP_K, _NEAR_BOILING_C), setpoint_c + _LEAST_TRIP_K)
    if setpoint_c >= _BOILING_C:  # given as an option: then it is no water
        return usual_c, _Finite(min=setpoint_c, min_open=True)
    return min(usual_c, _BOILING_C), _Finite(setpoint_c, _BOILING_C, min_open=True)


def commented(answers: Answers) -> str:
    """Return a configuration with a comment on every choice."""
    return "\n".join(
        (
            "# A configuration of thermoctl: `thermoctl config check -c FILE` checks it,",
            "# `thermoctl --sim -c FILE` tries it, `thermoctl run -c FILE` runs it.",
            "",
            *_board_lines(answers),
            "",
            *_loop_lines(answers),
            *_service_lines(answers),
            "",
        )
    )


def _board_lines(answers: Answers) -> list[str]:
    lines = ["[boards.daq]", _line("kind", answers.kind, f"thermoctl drivers show {answers.kind}")]
    known = plugins.find(plugins.DRIVERS, answers.kind).Settings.model_fields
    if answers.port is not None:
        lines.append(_line("port", answers.port))
    if "volume_l" in known:
        lines.append(_line("volume_l", answers.volume_l))
    if "heater_w" in known:
        lines.append(_line("heater_w", answers.heater_w))
    return lines


def _loop_lines(answers: Answers) -> list[str]:
    stage = plugins.find(plugins.DRIVERS, answers.kind).Settings.model_fields.get("power_stage")
    pull_up = [] if answers.pull_up_ohm is None else [_line("pull_up_ohm", answers.pull_up_ohm)]
    return [
        "[loops.tank]",
        _line("setpoint_c", answers.setpoint_c, "degC to hold"),
        _line("trip_above_c", answers.trip_above_c, "heater off above this until acknowledged"),
        *_trip_below_lines(answers),
        _line("heater_w", answers.heater_w, "rated power; so that watts and litres are told"),
        _line("volume_l", answers.volume_l, "that it warms; if it does not, that is told soon"),
        _line("setpoint_max_c", answers.setpoint_max_c, "no set point above this is accepted"),
        _line("period_s", 1.0, "one sample, one power, once a second"),
        _line("mode", answers.mode, "at the first start: off, manual or auto"),
        _line("resume", answers.resume, "go on after a restart; otherwise the loop starts off"),
        "",
        "[loops.tank.sensor]",
        _line("board", "daq"),
        _line("curve", answers.sensor),
        *pull_up,
        "",
        "[loops.tank.actuator]",
        _line("board", "daq"),
        _line("law", "linear" if stage is None else stage.default, "how power becomes drive"),
        "",
        "[loops.tank.controller]",
        _line("kind", "adaptive", "learns gain, loss and lag by itself"),
        _line("calmness", Adaptive().calmness, "0.2 is brisk, 0.8 calm"),
        "",
        "[loops.tank.model]",
        _line("structure", "known-gain", "the gain is that of heater_w and volume_l"),
        "",
        "[loops.tank.estimator]",
        _line("kind", "ckf", "the corrected Kalman filter"),
        _line("R1", 1e-8, "lets the pole follow a loss that changes over minutes"),
        _line("R2", 0.1, "K^2; well above the noise, for the lag that the model does not have"),
    ]


def _trip_below_lines(answers: Answers) -> list[str]:
    """Return the lower trip, unless the sensor would call that a broken wire anyway."""
    trip_below_c = min(0.0, answers.setpoint_c - _USUAL_TRIP_K)
    table = SensorTable.model_validate(
        {"board": "daq", "curve": answers.sensor, "pull_up_ohm": answers.pull_up_ohm}
    )
    coldest_c, _ = reach_c(sensor_for(table))
    return [_line("trip_below_c", trip_below_c, "and below this")] * (trip_below_c > coldest_c)


def _service_lines(answers: Answers) -> list[str]:
    if plugins.find(plugins.DRIVERS, answers.kind).capabilities.dead_man:
        return []
    warning = "the board cannot cut its heater by itself: fit a thermostat"
    accepted = _line("accept_no_dead_man", answers.accept_no_dead_man, warning)
    return ["", "[service]", accepted]


def _line(key: str, value: Any, comment: str = "") -> str:
    setting = f"{key} = {toml_value(value)}"
    return f"{setting:<27} # {comment}" if comment else setting


def _checked(text: str) -> list[Doubt]:
    """Load what is to be written; raise `BadConfiguration` when the answers do not go together."""
    document = Document(tomllib.loads(text), "answers")
    try:
        settings = settings_in(document)
        wrong = [document.problem(*each) for each in wiring_errors(settings)]
        if wrong:
            raise BadConfiguration(wrong)
    except BadConfiguration as error:
        raise BadConfiguration([_as_answer(each) for each in error.problems]) from error
    return doubts(settings)


def _as_answer(problem: Problem) -> Problem:
    """Return `problem` with the option it came from, in place of a key that nobody has written."""
    last = problem.key[-1] if problem.key else ""
    name = {"curve": "sensor", "daq": "kind"}.get(last, last)
    asked = {each.name for each in new.params}
    key = (_option(name),) if name in asked else problem.key
    text = problem.text.replace(ACCEPTANCE, _option("accept_no_dead_man"))
    return replace(problem, key=key, text=text)


def _write(out: Path, text: str, force: bool) -> None:
    """Write `text`; without `force` never over a file that came meanwhile, nor half of it."""
    try:
        stream = out.open("w" if force else "x", encoding="utf-8")
    except FileExistsError as error:
        raise Refused(_TAKEN.format(out)) from error
    try:
        with stream:
            stream.write(text)
    except OSError as error:  # a disk that is full
        if not force:
            out.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror, str(out)) from error
