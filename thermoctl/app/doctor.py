"""What ``thermoctl doctor`` looks at: one finding each, with what to do about it.

Nothing is ever switched on: a board is told power 0, and only when no daemon is running. Every
board has the same deadline and a thread of its own, so that one that hangs holds up nobody.
"""

from __future__ import annotations

import importlib.metadata
import os
import re
import stat
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from pydantic import BaseModel

from thermoctl.app import serial_ports
from thermoctl.app.compose import board_builder, driver_of
from thermoctl.app.configuration.document import exposures
from thermoctl.app.daemon.daemon import state_for
from thermoctl.app.doubts import doubts
from thermoctl.app.parts import sensor_for
from thermoctl.app.runnable import runnable
from thermoctl.app.settings import ETC, Settings
from thermoctl.errors import ConfigError, DriverError, NotPermitted
from thermoctl.ports import Board, Clock
from thermoctl.runtime.clock import MonotonicClock
from thermoctl.services.places import runtime_dir, state_dir
from thermoctl.services.store import LatchStore
from thermoctl.signals import Quality, RawSample

OK, WARN, FAIL = "ok", "warn", "fail"

BOARD_S: Final = 2.0
"""How long all boards together have to answer."""
_GRACE_S = 0.3
_POLL_S = 0.05
_VALID_S = 1.0
_COARSEST_CLOCK_S = 1e-3
_YEARS = range(2025, 2100)
UNIT_FOLDERS: Final = tuple(
    Path(folder) / "systemd/system" for folder in ("/etc", "/run", "/usr/lib", "/lib")
)
_EXTRA = re.compile(r"^(?P<package>[\w.-]+).*extra\s*==\s*[\"'](?P<extra>\w+)[\"']")


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report: `status` is ``ok``, ``warn`` or ``fail``."""

    status: str
    check: str
    text: str


def examine(
    files: Sequence[Path], state: Path | None = None, clock: Clock | None = None
) -> list[Finding]:
    """Return what there is to say of this machine, in about two seconds at most.

    Parameters
    ----------
    files : sequence of Path
        Configuration files; the machine's when empty.
    state : Path, optional
        State folder from the command line.
    clock : Clock, optional
        What boards measure their deadlines with; the machine's monotonic one if not given.
    """
    files = list(files) or sorted(ETC.glob("*.toml"))
    settings, findings = _configuration(files)
    directory = state or (state_for(settings, None) if settings else state_dir())
    findings += _ports(settings)
    if settings is not None:
        findings += boards(settings, directory, clock or MonotonicClock())
        findings += latches(settings, directory)
    return [*findings, state_folder(directory), *clocks(), service(UNIT_FOLDERS), *_extras()]


# -- configuration and ports -----------------------------------------------------------------------


def _configuration(files: list[Path]) -> tuple[Settings | None, list[Finding]]:
    if not files:
        text = f"none given and none in {ETC}; begin one with: thermoctl config new -o FILE"
        return None, [Finding(WARN, "configuration", text)]
    warnings = [Finding(WARN, "configuration", text) for text in exposures(files)]
    try:
        settings = runnable(files)
    except ConfigError as error:
        wrong = [str(each) for each in getattr(error, "problems", ())] or str(error).splitlines()
        return None, [*warnings, *(Finding(FAIL, "configuration", line) for line in wrong)]
    names = ", ".join(map(str, files))
    warnings += [Finding(WARN, "configuration", str(doubt)) for doubt in doubts(settings)]
    return settings, [Finding(OK, "configuration", names), *warnings]


def _ports(settings: Settings | None) -> list[Finding]:
    found = serial_ports.present()
    needed = settings is not None and any(hasattr(b, "port") for b in settings.boards.values())
    status = WARN if needed and not found else OK
    text = ", ".join(found) or "no serial port found"
    return [
        Finding(status, "ports", f"{text}; is the board plugged in?" if status == WARN else text)
    ]


# -- boards ----------------------------------------------------------------------------------------


def boards(
    settings: Settings, directory: Path, clock: Clock, patience_s: float = BOARD_S
) -> list[Finding]:
    """Return what each board says, all asked at once; none while a daemon runs."""
    holder = serial_ports.daemon_holding(directory)
    if holder is not None:
        text = f"not asked: the daemon is running (process {holder})"
        return [Finding(OK, f"board {name}", text) for name in settings.boards]
    visits = [
        _Visit(name, each, settings, clock, patience_s) for name, each in settings.boards.items()
    ]
    for visit in visits:
        visit.start()
    until_s = time.monotonic() + patience_s + _GRACE_S
    return [
        finding
        for visit in visits
        for finding in visit.findings(max(0.0, until_s - time.monotonic()))
    ]


class _Visit:
    """Opens one board in a thread of its own, tells it power 0 and reads it once."""

    def __init__(
        self, name: str, board: BaseModel, settings: Settings, clock: Clock, patience_s: float
    ) -> None:
        self._check, self._name, self._board = f"board {name}", name, board
        self._settings, self._clock, self._patience_s = settings, clock, patience_s
        self._found: list[Finding] = []
        self._thread = threading.Thread(target=self._run, name=self._check, daemon=True)

    def start(self) -> None:
        """Look at the port, and begin when it is free."""
        port = getattr(self._board, "port", None)
        obstacle = None if port is None else serial_ports.obstacle(port)
        if obstacle is not None:
            self._found.append(Finding(FAIL, self._check, obstacle))
        else:
            self._thread.start()

    def findings(self, patience_s: float) -> list[Finding]:
        """Return what was found, once it is there or `patience_s` has passed."""
        if self._thread.ident is not None:
            self._thread.join(patience_s)
            if self._thread.is_alive():
                return [*self._found, self._failure(f"no answer within {self._patience_s:g} s")]
        return list(self._found)

    def _run(self) -> None:
        board: Board | None = None
        try:
            board = board_builder(self._board, self._clock)()
            self._found.extend(self._answers(board))
        except (DriverError, OSError) as error:
            self._found.append(self._failure(str(error)))
        except Exception as error:  # noqa: BLE001 - a driver from elsewhere may raise anything
            self._found.append(self._failure(f"{type(error).__name__} in the driver: {error}"))
        finally:
            if board is not None:
                board.close()

    def _failure(self, text: str) -> Finding:
        port = getattr(self._board, "port", None)
        user = None if port is None else serial_ports.used_by(port)
        advice = "check wiring, supply and kind" if user is None else f"{user}; end it first"
        return Finding(FAIL, self._check, f"{text}; {advice}")

    def _answers(self, board: Board) -> Iterator[Finding]:
        deadline_s = self._clock.now_s() + self._patience_s
        who = board.open(deadline_s)
        yield Finding(OK, self._check, f"{who.kind} {who.name}, version {who.version}")
        yield self._dead_man()
        outputs = {
            each.output: 0.0
            for table in self._settings.loops.values()
            for each in table.outputs
            if each.board == self._name
        }
        taken = board.write(outputs, _VALID_S, deadline_s) if outputs else {}
        for output, power in taken.items():
            status = OK if power == 0.0 else FAIL
            yield Finding(status, self._check, f"{output}: told power 0, took {power:g}")
        yield from self._temperatures(board, deadline_s)

    def _dead_man(self) -> Finding:
        if not driver_of(self._board).capabilities.dead_man:
            text = "no dead-man: an independent thermostat must be fitted"
            return Finding(WARN, self._check, text)
        after_s = getattr(self._board, "dead_man_s", None)
        when = "" if after_s is None else f" {after_s:g} s after the last command"
        return Finding(OK, self._check, f"dead-man: the board cuts the heater by itself{when}")

    def _temperatures(self, board: Board, deadline_s: float) -> Iterator[Finding]:
        """Yield one reading of every sensor that a loop has on this board."""
        samples = dict(board.read(deadline_s))
        while not samples and self._clock.now_s() < deadline_s - _POLL_S:
            self._clock.sleep_until(self._clock.now_s() + _POLL_S)  # the first burst takes a while
            samples = dict(board.read(deadline_s))
        for loop, table in self._settings.loops.items():
            for sensor in (table.sensor, table.second_sensor):
                if sensor is None or sensor.board != self._name:
                    continue
                name = sensor.input
                measurement = sensor_for(sensor).measure(samples.get(name))
                if measurement.quality is Quality.GOOD:
                    text = f"{name} of loop {loop}: {measurement.temperature_c:.2f} °C"
                    yield Finding(OK, self._check, text)
                else:
                    yield Finding(FAIL, self._check, _no_temperature(name, loop, samples))


def _no_temperature(name: str, loop: str, samples: dict[str, RawSample]) -> str:
    if name not in samples:
        heard = ", ".join(samples) or "nothing"
        return f"expected input {name!r} of loop {loop}, the board sent {heard}"
    raw = samples[name]
    share = raw.counts / raw.full_scale
    return f"{name} of loop {loop}: {share:.1%} of full scale is no temperature; check the sensor"


# -- the machine -----------------------------------------------------------------------------------


def state_folder(directory: Path) -> Finding:
    """Return whether `directory` can hold latches and history; nothing is made."""
    there = directory
    while not there.exists() and there != there.parent:
        there = there.parent
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        text = f"{directory}: user {os.geteuid()} cannot write there; chown it or give --state DIR"
        return Finding(FAIL, "state", text)
    if there == directory and directory.stat().st_mode & stat.S_IWOTH:
        text = f"{directory}: everybody may write to it; chmod o-w {directory}"
        return Finding(FAIL, "state", text)
    made = "" if there == directory else ", made at the first start"
    return Finding(OK, "state", f"{directory} can be written{made}")


def latches(settings: Settings, directory: Path) -> Iterator[Finding]:
    """Yield a failure for every latched loop; a warning where one may not look."""
    store = LatchStore(directory, runtime_dir())
    for name in settings.loops:
        try:
            store.check_readable(name)
        except NotPermitted as error:
            yield Finding(WARN, "latch", str(error))
            continue
        latch = store.load(name)
        if latch is not None:
            remedy = "remove the cause, then: thermoctl alarms ack"
            yield Finding(FAIL, "latch", f"loop {name}: {latch.code}, {latch.text}; {remedy}")


def clocks() -> Iterator[Finding]:
    """Yield what is to be said of the monotonic and of the wall clock."""
    resolution_s = time.get_clock_info("monotonic").resolution
    status = OK if resolution_s <= _COARSEST_CLOCK_S else FAIL
    yield Finding(status, "clock", f"monotonic, in steps of {resolution_s:.3g} s")
    yield wall_clock(datetime.now(UTC))


def wall_clock(now: datetime) -> Finding:
    """Return whether `now` can be the time of day."""
    text = now.isoformat(timespec="seconds")
    if now.year in _YEARS:
        return Finding(OK, "clock", f"wall clock {text}")
    return Finding(WARN, "clock", f"wall clock {text}: history would be misdated; set it")


def service(folders: Sequence[Path]) -> Finding:
    """Return whether a unit of the service manager is in one of `folders`."""
    for folder in folders:
        unit = folder / "thermoctl.service"
        if unit.is_file():
            return Finding(OK, "service", str(unit))
    return Finding(WARN, "service", "no systemd unit installed; docs/service.md says how")


def _extras() -> list[Finding]:
    """Return which optional extras are there, each with the packages that are missing."""
    missing: dict[str, list[str]] = {}
    for requirement in importlib.metadata.requires("thermoctl") or ():
        found = _EXTRA.match(requirement)
        if found is None or found["extra"] == "dev":
            continue
        absent = missing.setdefault(found["extra"], [])
        try:
            importlib.metadata.version(found["package"])
        except importlib.metadata.PackageNotFoundError:
            absent.append(found["package"])
    return [
        Finding(
            WARN, "extras", f"{extra} lacks {', '.join(absent)}; pip install thermoctl[{extra}]"
        )
        if absent
        else Finding(OK, "extras", f"{extra} is complete")
        for extra, absent in missing.items()
    ]
