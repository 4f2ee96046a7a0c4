"""``thermoctl run``: the daemon.

The control loop has a thread of its own and shares no lock with anything that does I/O. The main
thread waits for signals, and stores what must survive a restart.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import threading
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from thermoctl import __version__
from thermoctl.app.compose import loop_for
from thermoctl.app.daemon.clerk import Clerk
from thermoctl.app.daemon.insight_watch import InsightService, insights_for
from thermoctl.app.daemon.order_service import order_service
from thermoctl.app.daemon.resuming import Resumption, kept_latches
from thermoctl.app.doubts import doubts
from thermoctl.app.parts import law_of_kind
from thermoctl.app.settings import Settings, default_files, load_all
from thermoctl.errors import ConfigError
from thermoctl.runtime.clock import MonotonicClock
from thermoctl.services.control_place import ControlPlace
from thermoctl.services.control_socket import ControlSocket
from thermoctl.services.history.schema import RunInfo
from thermoctl.services.history.writer import HistoryWriter
from thermoctl.services.journal import Journal, sink_for
from thermoctl.services.latches import LatchKeeper
from thermoctl.services.learned import LearnedStore, ModelKeeper, remembered_models
from thermoctl.services.lock import STOP_IT, DaemonLock, device_lock_path
from thermoctl.services.notify import Notifier, watchdog_interval_s
from thermoctl.services.places import make_private, runtime_dir, state_dir
from thermoctl.services.store import LatchStore
from thermoctl.signals import Acknowledge, Cycle, Event, SetPoint

SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
_TURN_S = 0.2
_STOP_S = 1.5
_STATUS_EVERY = 10


def state_for(settings: Settings, given: Path | None) -> Path:
    """Return the state folder: the option, the configuration's, or the usual one."""
    configured = settings.service.state_directory
    return given or (Path(configured) if configured else state_dir())


def locks_of(settings: Settings, state: Path, remedy: str = STOP_IT) -> list[DaemonLock]:
    """Return the locks of who drives these boards: state folder and ports."""
    run_directory = make_private(runtime_dir())
    ports = [board.port for board in settings.boards.values() if hasattr(board, "port")]
    devices = [DaemonLock(device_lock_path(run_directory, port), remedy) for port in ports]
    return [DaemonLock(state / "daemon.lock", remedy), *devices]


@dataclass(slots=True)
class _Seen:
    """The last cycle of every loop, written by the loop's thread and read by the main one."""

    cycles: dict[str, Cycle] = field(default_factory=dict)


class Daemon:
    """One run of the daemon.

    Parameters
    ----------
    files : sequence of Path
        Configuration files; the machine's when empty.
    state : Path, optional
        State folder from the command line.
    socket : Path, optional
        Where to listen for clients; in the runtime folder when not given.

    Raises
    ------
    ConfigError
        The configuration is bad; nothing has been switched on.
    Unavailable
        Another daemon holds the state folder or a device; or `socket` is too long a path, or in
        no folder.
    """

    def __init__(
        self, files: Sequence[Path], state: Path | None = None, socket: Path | None = None
    ) -> None:
        self._files = list(files) or default_files()
        settings = load_all(self._files)
        _require_patient_watchdog(settings)
        self._settings = settings
        directory = make_private(state_for(settings, state))
        self._locks = locks_of(settings, directory)
        self._journal = Journal(sink_for())
        self._notifier = Notifier()
        self._latches = LatchStore(directory, make_private(runtime_dir()))
        self._seen = _Seen()
        self._clock = MonotonicClock()
        self._history = _history(settings, directory, self._journal.emit)
        self._resumption = Resumption(directory, self._emit)
        learned = LearnedStore(directory)
        self._models = ModelKeeper(learned, self._clock.now_s)
        self._loop = loop_for(
            self._resumption.settings(settings),
            self._clock,
            self._publish,
            latched=kept_latches(self._latches, settings, self._emit),
            remembered=remembered_models(learned, settings.loops, self._emit),
            completed=self._completed,
        )
        self._keeper = LatchKeeper(
            self._latches, self._acknowledged_on_disk, report=self._journal.emit
        )
        self._orders = order_service(settings.loops, self._emit)
        self._insight = InsightService(insights_for(settings.loops), self._emit)
        self._clients = self._control_socket(directory, socket)
        self._off = self._failed = self._ready = False
        self._status_at = 0
        self._unreached: list[str] = []
        self._ending = self._reloading = False
        # A service reloads at a hang-up; who started it by hand and closed the terminal is gone.
        self._on_terminal = os.isatty(0)

    def _control_socket(self, state: Path, given: Path | None) -> ControlSocket:
        place = ControlPlace.of_daemon(given)
        periods_s = {name: table.period_s for name, table in self._settings.loops.items()}
        clerk = Clerk(
            self._loop,
            self._seen.cycles,
            periods_s,
            self._latches,
            state,
            self._clock.now_s,
            insight=self._insight.insight,
            law=lambda name, kind: law_of_kind(self._settings.loops[name], kind),
        )
        return ControlSocket(place, clerk, self._emit)

    # -- running ---------------------------------------------------------------------------------

    def run(self) -> bool:
        """Run until a signal ends it; return whether no output can be on."""
        for number in SIGNALS:
            signal.signal(number, self._note_signal)
        with contextlib.ExitStack() as stack:
            for lock in self._locks:
                stack.enter_context(lock)
            self._journal.start()
            stack.callback(self._journal.close)
            self._keeper.start()
            stack.callback(self._keeper.close)
            if self._history is not None:
                self._history.start()
                stack.callback(self._history.close)
            if self._orders is not None:
                self._orders.start()
                stack.callback(self._orders.close)
            self._insight.start()
            stack.callback(self._insight.close)
            self._clients.start()
            stack.callback(self._clients.close)
            self._emit("loop.started", None, loops=list(self._settings.loops), version=__version__)
            for doubt in doubts(self._settings):
                self._emit(doubt.event, doubt.loop, key=doubt.key, text=doubt.text)
            gc.freeze()  # what is loaded now stays: no collection needs to look at it again
            control = threading.Thread(target=self._control, name="control", daemon=True)
            control.start()
            try:
                self._attend(control)
            finally:  # whatever ends this thread, the other one ends with power 0
                self._stop()
                self._notifier.stopping()
                control.join(_STOP_S)
                self._say_the_rest()
                self._emit("loop.stopped", None, **self._ends())
            self._resumption.store(self._settings, dict(self._seen.cycles))
            self._models.store(dict(self._seen.cycles), at_end=True)
        return self._off and not self._failed

    def _control(self) -> None:
        try:
            self._loop.run()
        except BaseException as error:  # noqa: BLE001 - a thread ends in silence, this one must not
            self._failed = True
            text = f"{type(error).__name__}: {error}"
            self._emit("loop.failed", None, error=text, trace=traceback.format_exc())
        finally:
            self._unreached = [each.name for each in self._loop.boards if each.board is None]
            self._off = self._loop.shut_down()

    def _ends(self) -> dict[str, object]:
        """Return what is known of the heaters at the end; a board not reached confirms nothing."""
        return {
            "power_0_confirmed": self._off and not self._unreached,
            "output_may_be_on": not self._off,
            "unreached": self._unreached,
        }

    def _stop(self) -> None:
        """End the loop after the cycle that is under way; called by a signal handler, too."""
        self._ending = True
        self._loop.stop()
        self._clock.interrupt()

    def _say_the_rest(self) -> None:
        """Hand on what was reported after the last published cycle."""
        for event in self._loop.take_events():
            self._emit(event.name, None, **event.fields)

    def _attend(self, control: threading.Thread) -> None:
        """Look after signals and the disk until the control thread has ended."""
        while control.is_alive() and not self._ending:
            control.join(_TURN_S)
            if self._reloading:
                self._reloading = False
                self._reload()
            self._resumption.store(self._settings, dict(self._seen.cycles))
            self._models.store(dict(self._seen.cycles))

    def _note_signal(self, number: int, frame: object) -> None:
        """Only set flags: this runs in the middle of whatever the main thread is doing.

        A handler, and not a blocked signal that is waited for: libraries start threads of their
        own that block nothing, and the kernel would end the process through one of them.
        """
        if number == signal.SIGHUP and not self._on_terminal:
            self._reloading = True
        else:
            self._stop()

    # -- called by the loop's thread ---------------------------------------------------------------

    def _publish(self, cycle: Cycle) -> None:
        latched = next((alarm for alarm in cycle.step.alarms if alarm.latched), None)
        if latched is None:
            self._keeper.cleared(cycle.loop)
        else:
            self._keeper.latched(cycle.loop, latched)
        self._seen.cycles[cycle.loop] = cycle
        for event in cycle.step.events:
            self._journal.emit(event, cycle.loop)
        if self._history is not None:
            self._history.publish(cycle)
        if self._orders is not None:
            self._orders.publish(cycle)
        self._insight.publish(cycle)
        self._clients.publish(cycle)

    def _completed(self) -> None:
        """Tell the service manager: ready after the first cycle, alive after every one."""
        if not self._ready:
            self._ready = True
            self._notifier.ready()
        self._notifier.watchdog()
        if self._seen.cycles and self._loop.cycles >= self._status_at:
            self._status_at = self._loop.cycles + _STATUS_EVERY
            self._notifier.status(", ".join(_words(each) for each in self._seen.cycles.values()))

    def _acknowledged_on_disk(self, loop: str) -> None:
        self._loop.ask(Acknowledge(), loop)

    # -- the configuration again -------------------------------------------------------------------

    def _reload(self) -> None:
        """Read the files again: all or nothing, and never a limit that a restart should set."""
        self._notifier.reloading()
        try:
            fresh = load_all(self._files)
            setpoints = {f"loops.{name}.setpoint_c": name for name in self._settings.loops}
            changed = _changed_keys(self._settings, fresh)
            beyond = [key for key in changed if key not in setpoints]
            if beyond:
                raise ConfigError(f"a restart is needed to change {', '.join(beyond)}")
        except Exception as error:  # noqa: BLE001 - whatever a file can do, control goes on
            self._emit("config.refused", None, why=str(error) or type(error).__name__)
        else:
            for name in (setpoints[key] for key in changed):
                self._loop.ask(SetPoint(fresh.loops[name].setpoint_c), name)
            self._settings = fresh
            self._emit("config.loaded", None, changed=changed)
        self._notifier.ready()

    def _emit(self, name: str, loop: str | None, **fields: object) -> None:
        event = Event(self._clock.now_s(), name, fields)
        self._journal.emit(event, loop)
        if self._history is not None:
            self._history.publish_event(event, loop)


def _history(
    settings: Settings, directory: Path, report: Callable[..., None]
) -> HistoryWriter | None:
    """Return what writes the history; None where none is kept."""
    if not settings.history.enabled:
        return None
    run = RunInfo(__version__, settings.as_json())
    return HistoryWriter(directory / settings.history.file, run, report=report)


def _require_patient_watchdog(settings: Settings) -> None:
    """Refuse a service manager that would kill us between two healthy cycles."""
    patience_s = watchdog_interval_s()
    for name, table in settings.loops.items():
        if patience_s is not None and patience_s < 2.0 * table.period_s:
            raise ConfigError(
                f"loops.{name}.period_s: {table.period_s:g} needs WatchdogSec of at least "
                f"{2.0 * table.period_s:g} s in the unit, got {patience_s:g} s"
            )


def _words(cycle: Cycle) -> str:
    step = cycle.step
    return (
        f"{cycle.loop} {step.measurement.temperature_c:.2f} °C, set {step.setpoint_c:.2f} °C, "
        f"power {100.0 * step.command.power:.1f} %, {step.mode} {step.state}"
    )


def _changed_keys(before: Settings, after: Settings) -> list[str]:
    """Return the dotted keys whose values differ."""
    old, new = _flat(before.model_dump(mode="json")), _flat(after.model_dump(mode="json"))
    return sorted(key for key in old.keys() | new.keys() if old.get(key) != new.get(key))


def _flat(tree: dict[str, object], prefix: str = "") -> dict[str, object]:
    flat: dict[str, object] = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat
