"""Answers calls: from the last cycles, or through the loop's queue.

The one place where a call becomes a request. It never touches a regulator: what is wanted goes the
way every request goes, and the reply waits for the cycle that granted or refused it.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, Protocol

from thermoctl import __version__
from thermoctl.app.cycle_record import cycle_record, iso_time, latch_row
from thermoctl.app.daemon.cycle_wire import details_of
from thermoctl.app.plugins import BadOption
from thermoctl.errors import ConfigError
from thermoctl.insight import Insight
from thermoctl.ports import Controller
from thermoctl.runtime.asked import Asked
from thermoctl.services.control_protocol import Call, CallError
from thermoctl.services.control_socket import Pending
from thermoctl.services.store import LatchStore
from thermoctl.signals import (
    Acknowledge,
    Alarm,
    ChooseController,
    ChooseShadow,
    Cycle,
    Load,
    ManualPower,
    Mode,
    Request,
    SetPoint,
)

_PERIODS: Final = 2.0
_SPARE_S: Final = 2.0
_MODES: Final = (Mode.OFF, Mode.MANUAL, Mode.AUTO)


def _no_law(loop: str, kind: str) -> Controller:
    """Refuse: nobody here knows how laws are built."""
    raise ConfigError(f"expected a daemon that can build laws, got {kind!r} for {loop!r}")


class Asks(Protocol):
    """The part of the loop that a clerk knows."""

    def ask(self, request: Request, loop: str | None = None) -> Asked:
        """Put a request into the loop's queue."""


class Clerk:
    """Answers calls in the thread of the control socket, and never waits.

    Parameters
    ----------
    loop : Asks
        Takes requests.
    seen : mapping
        The last cycle of every loop; the loop's thread goes on writing it.
    periods_s : mapping
        Period of every loop there is, in s.
    latches : LatchStore
        Where latches are kept.
    state : Path
        The state folder, by which a client knows which daemon it talks to.
    now_s : callable
        The loop's time in s.
    wall_clock : callable
        Seconds since 1970 UTC.
    insight : callable
        What is told of a loop by name, None where nothing is.
    law : callable
        Returns the law of a kind for a loop, both by name; raises `ConfigError` where none fits.
    """

    def __init__(
        self,
        loop: Asks,
        seen: Mapping[str, Cycle],
        periods_s: Mapping[str, float],
        latches: LatchStore,
        state: Path,
        now_s: Callable[[], float],
        wall_clock: Callable[[], float] = time.time,
        *,
        insight: Callable[[str], Insight | None] = lambda loop: None,
        law: Callable[[str, str], Controller] = _no_law,
    ) -> None:
        self._loop, self._seen, self._periods_s = loop, seen, dict(periods_s)
        self._latches, self._state = latches, state
        self._now_s, self._wall_clock = now_s, wall_clock
        self._insight, self._law = insight, law
        self.patience_s = _PERIODS * max(self._periods_s.values()) + _SPARE_S

    def answer(self, call: Call) -> Mapping[str, Any] | Pending:
        """Return the reply to `call`, or what will have it once the loop has answered.

        Raises
        ------
        CallError
            It names no loop, key or mode that there is.
        """
        match call.do:
            case "status":
                return self._status(call)
            case "get":
                return self._get(call)
            case "alarms":
                return {"alarms": [row for name in self._meant(call) for row in self._rows(name)]}
            case "ack":
                return self._acknowledge(call)
            case "watch":
                return {"loops": self._meant(call)}
            case _:
                return self._request(call)

    def record(self, cycle: Cycle) -> Mapping[str, Any]:
        """Return what a watching client is told of a finished cycle."""
        return cycle_record(cycle)

    def details(self, cycle: Cycle) -> Mapping[str, Any]:
        """Return the rest of a cycle, for a client that asked for details."""
        return details_of(cycle, self._insight(cycle.loop))

    # -- which loop ------------------------------------------------------------------------------

    def _meant(self, call: Call) -> list[str]:
        """Return the loops a call is about: the one it names, else all."""
        return list(self._periods_s) if call.loop is None else [self._one(call)]

    def _one(self, call: Call) -> str:
        """Return the loop a call is about: the one it names, else the only one."""
        names = list(self._periods_s)
        if call.loop in names:
            return str(call.loop)
        if call.loop is None and len(names) == 1:
            return names[0]
        raise CallError("no_loop", f"a loop of {', '.join(names)}", call.loop or "none")

    # -- what is ---------------------------------------------------------------------------------

    def _status(self, call: Call) -> Mapping[str, Any]:
        meant = self._meant(call)
        records = [self._record_now(name) for name in meant if name in self._seen]
        return {
            "version": __version__,
            "pid": os.getpid(),
            "state_directory": str(self._state.absolute()),
            "patience_s": self.patience_s,
            "waiting": [name for name in meant if name not in self._seen],
            "loops": records,
        }

    def _record_now(self, name: str) -> dict[str, Any]:
        cycle = self._seen[name]
        age_s = round(max(0.0, self._now_s() - cycle.step.t_s), 3)
        beside = {"age_s": age_s, "period_s": self._periods_s[name], "missed": cycle.missed}
        return {**cycle_record(cycle), **beside, "insight": self._told(name)}

    def _told(self, name: str) -> dict[str, Any] | None:
        """Return what is told of the plant beside its last cycle, with times of the wall clock."""
        insight = self._insight(name)
        if insight is None:
            return None
        began_utc_s = self._wall_clock() - self._now_s()
        told = dict(insight.as_json())
        for rows, key in ((told["changes"], "t_s"), (told["drifts"], "since_s")):
            for row in rows:
                row["at"] = iso_time(began_utc_s + row[key])
        return told

    def _get(self, call: Call) -> Mapping[str, Any]:
        name = self._one(call)
        if name not in self._seen:
            raise CallError("no_cycle", text=f"{name} has not finished a cycle yet")
        record = self._record_now(name)
        if call.argument not in record:
            raise CallError("unknown_key", f"a key of {', '.join(record)}", call.argument)
        return {"loop": name, "key": call.argument, "value": record[str(call.argument)]}

    def _rows(self, name: str) -> list[dict[str, Any]]:
        cycle = self._seen.get(name)
        if cycle is not None:
            return [self._row(name, each) for each in cycle.step.alarms]
        kept = self._latches.load(name)  # a loop that has not begun yet has not forgotten
        return [] if kept is None else [latch_row(name, kept)]

    def _row(self, name: str, alarm: Alarm) -> dict[str, Any]:
        return {
            "loop": name,
            "code": alarm.code,
            "fault": alarm.fault,
            "priority": alarm.priority,
            "since": self._since(name, alarm),
            "active": alarm.active,
            "latched": alarm.latched,
            "acknowledged": alarm.acknowledged,
            "text": alarm.text,
        }

    def _since(self, name: str, alarm: Alarm) -> str | None:
        """Return when an alarm began; a latch may be older than this process."""
        since_utc_s = self._wall_clock() - (self._now_s() - alarm.since_s)
        if alarm.latched:
            kept = self._latches.load(name)
            if kept is not None and kept.code == alarm.code:
                since_utc_s = kept.since_utc_s
        return iso_time(since_utc_s)

    # -- what is wanted --------------------------------------------------------------------------

    def _request(self, call: Call) -> Pending:
        name = self._one(call)
        request, content = self._wish(call, name)
        asked = self._loop.ask(request, name)
        return self._once_settled(asked, lambda: {"loop": name, **content})

    def _wish(self, call: Call, name: str) -> tuple[Request, dict[str, Any]]:
        """Return the request of a call, and what its reply says when it is granted."""
        match call.do, call.argument, call.also:
            case "set", float(value_c), None:
                return SetPoint(value_c), {"setpoint_c": value_c}
            case "set", float(value_c), float(rate):
                return SetPoint(value_c, rate), {"setpoint_c": value_c, "rate_k_per_min": rate}
            case "load", float(power), float(duration_s):
                return Load(power, duration_s), {"power": power, "duration_s": duration_s}
            case "output", float(power), None:
                self._require_manual(name)
                return ManualPower(power), {"power": power}
            case "mode", str(word), None:
                if word not in _MODES:
                    raise CallError("bad_value", f"a mode of {', '.join(_MODES)}", word)
                return Mode(word), {"mode": word}
            case "controller", str(word), None:
                return ChooseController(word), {"controller": word}
            case "shadow", "none", None:
                return ChooseShadow(None), {"shadow": None}
            case "shadow", str(word), None:
                return ChooseShadow(self._cast(name, word)), {"shadow": word}
            case _:
                raise CallError("unknown_call", "a call that this daemon knows", call.do)

    def _cast(self, loop: str, kind: str) -> Controller:
        """Return the law that a loop would have in its shadow."""
        try:
            return self._law(loop, kind)
        except BadOption as error:
            unknown = error.path == ("kind",)  # a word that was typed, no key of a file
            raise CallError("bad_value", text=error.text if unknown else str(error)) from error
        except ConfigError as error:
            raise CallError("bad_value", text=str(error)) from error

    def _require_manual(self, name: str) -> None:
        """Refuse a power that would be kept, and then forgotten when mode manual begins."""
        cycle = self._seen.get(name)
        if cycle is None or cycle.step.mode is not Mode.MANUAL:
            mode = "no mode yet" if cycle is None else cycle.step.mode.value
            raise CallError("not_manual", f"{name} in mode manual before its output is set", mode)

    def _acknowledge(self, call: Call) -> Pending:
        meant = self._meant(call)
        rows = [row for name in meant for row in self._rows(name)]
        rows = [row for row in rows if call.argument in (None, row["code"])]
        code = None if call.argument is None else str(call.argument)
        asked = self._loop.ask(Acknowledge(code), None if call.loop is None else meant[0])
        freed = {row["loop"] for row in rows if row["latched"]}

        def content() -> Mapping[str, Any] | None:
            still = [name for name in freed if self._latches.exists(name)]
            if any(not self._latched(name) for name in still):
                return None  # the file goes in a thread of its own; said when a power cut keeps it
            return {"acknowledged": rows}

        return self._once_settled(asked, content)

    def _latched(self, name: str) -> bool:
        cycle = self._seen.get(name)
        return cycle is not None and any(alarm.latched for alarm in cycle.step.alarms)

    def _once_settled(
        self, asked: Asked, content: Callable[[], Mapping[str, Any] | None]
    ) -> Pending:
        """Return what waits for the loop, and takes the request back when that lasts too long."""
        until_s = self._now_s() + self.patience_s

        def pending() -> Mapping[str, Any] | None:
            if asked.settled and asked.refusal is not None:
                raise CallError("refused", text=asked.refusal)
            found = content() if asked.settled else None
            if found is None and self._now_s() > until_s:
                withdrawn = asked.withdraw()
                fate = "it was taken back" if withdrawn else "it may have been granted"
                text = f"the loop gave no answer within {self.patience_s:g} s; {fate}"
                raise CallError("no_answer", text=text)
            return found

        return pending
