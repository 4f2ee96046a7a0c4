"""Where a start takes up what the last run left: wishes and latches.

A restarted loop is off unless its configuration says ``resume = true``. What is edited in the
configuration since is a newer wish than what was stored, and counts as a first start. A record that
cannot be read is not the same as none: somebody may have switched the loop off, so it is off.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from thermoctl.app import plugins
from thermoctl.app.compose import started_as
from thermoctl.app.configuration.tables import LoopTable
from thermoctl.app.settings import Settings
from thermoctl.services.store import LatchStore, RunRecord, RunStore
from thermoctl.signals import Alarm, Cycle, Mode

Emit = Callable[..., None]
_HOW = "set resume = true, or edit mode, and start again"
_HOW_NOW = "thermoctl mode auto"


class Resumption:
    """What a start takes up, and what it leaves behind for the next one.

    Parameters
    ----------
    directory : Path
        The state folder.
    emit : callable
        Called as ``emit(name, loop, **fields)`` for what the operator should know.
    """

    def __init__(self, directory: Path, emit: Emit) -> None:
        self._runs = RunStore(directory)
        self._emit = emit
        self._stored: dict[str, RunRecord] = {}

    def settings(self, settings: Settings) -> Settings:
        """Return `settings` with modes, set points and laws this start begins with."""
        starts, loops = {}, {}
        for name, table in settings.loops.items():
            record, warning = self._runs.load(name)
            if warning is not None:
                self._emit("state.ignored", name, why=warning)
                starts[name] = self._unknown(name, table)
            else:
                starts[name] = self._start(name, table, record)
            loops[name] = self._exchanged(name, table, record)
        return started_as(settings.model_copy(update={"loops": loops}), starts)

    def _exchanged(self, name: str, table: LoopTable, record: RunRecord | None) -> LoopTable:
        """Return `table` with the laws as the operator had exchanged them, if so."""
        if record is None or not (table.resume and record.exchanged):
            return table
        if record.configured_laws != _laws(table):
            return table
        exchanged = table.model_copy(
            update={"controller": table.shadow, "shadow": table.controller}
        )
        self._emit("controller.resumed", name, controller=exchanged.controller.kind)
        return exchanged

    def _unknown(self, name: str, table: LoopTable) -> tuple[Mode, float]:
        """Return how a loop starts of which a record is there, but cannot be read: off."""
        if table.mode is not Mode.OFF:
            self._emit("loop.not_resumed", name, was="unknown", to_resume=_HOW_NOW)
        return Mode.OFF, table.setpoint_c

    def _start(self, name: str, table: LoopTable, record: RunRecord | None) -> tuple[Mode, float]:
        if record is None:
            return table.mode, table.setpoint_c
        setpoint_c = _setpoint(record, table)
        edited = record.configured_mode not in (None, table.mode)
        if (edited or table.resume) and setpoint_c != table.setpoint_c:
            self._emit(
                "setpoint.resumed", name, setpoint_c=setpoint_c, configured_c=table.setpoint_c
            )
        if edited:
            return table.mode, setpoint_c
        if table.resume:
            return Mode.OFF if record.mode is Mode.PROGRAM else record.mode, setpoint_c
        # Kept as it was: a start that only stays off is no wish to be off.
        self._stored[name] = _configured(RunRecord(Mode.OFF, table.setpoint_c), table)
        if record.mode is not Mode.OFF:
            self._emit("loop.not_resumed", name, was=record.mode.value, to_resume=_HOW)
        return Mode.OFF, table.setpoint_c

    def store(self, settings: Settings, cycles: Mapping[str, Cycle]) -> None:
        """Store what changed; a full or read-only disk is tried again at the next call."""
        for name, cycle in cycles.items():
            record = RunRecord(cycle.step.mode, cycle.step.setpoint_c)
            table = settings.loops[name]
            record = replace(
                _configured(record, table), exchanged=_in_shadow(table, cycle.step.controller)
            )
            if self._stored.get(name) != record:
                with contextlib.suppress(OSError):
                    self._runs.save(name, record)
                    self._stored[name] = record


def _setpoint(record: RunRecord, table: LoopTable) -> float:
    """Return the stored set point, unless the configured one is newer or excludes it."""
    low_c, high_c = table.setpoint_range_c
    edited = record.configured_setpoint_c not in (None, table.setpoint_c)
    stored = low_c <= record.setpoint_c <= high_c and not edited
    return record.setpoint_c if stored else table.setpoint_c


def _configured(record: RunRecord, table: LoopTable) -> RunRecord:
    return replace(
        record,
        configured_mode=table.mode,
        configured_setpoint_c=table.setpoint_c,
        configured_laws=_laws(table),
    )


def _laws(table: LoopTable) -> tuple[str, ...]:
    """Return the kinds in charge and in shadow, as configured."""
    return tuple(each.kind for each in (table.controller, table.shadow) if each is not None)


def _in_shadow(table: LoopTable, name: str) -> bool:
    """Return whether the law called `name` is the one that is configured as the shadow."""
    if table.shadow is None:
        return False
    law = plugins.find(plugins.CONTROLLERS, table.shadow.kind)
    return name == getattr(law, "name", table.shadow.kind)


def kept_latches(latches: LatchStore, settings: Settings, emit: Emit) -> dict[str, Alarm]:
    """Return the latches of earlier runs by loop; each is told of."""
    kept = {}
    for name in settings.loops:
        latch = latches.load(name)
        if latch is not None:
            kept[name] = Alarm(latch.code, latch.fault, 1, 0.0, latch.text, latched=True)
            emit("latch.kept", name, code=latch.code, text=latch.text)
    return kept
