"""What is wrong now, and what was and nobody has acknowledged."""

from __future__ import annotations

from dataclasses import replace

from thermoctl.signals import Alarm


class AlarmRegister:
    """Alarms by code; a row leaves when it is neither active nor unacknowledged."""

    def __init__(self) -> None:
        self._rows: dict[str, Alarm] = {}
        self._listed: tuple[Alarm, ...] | None = ()

    def rows(self) -> tuple[Alarm, ...]:
        """Return every alarm, the most urgent and oldest first."""
        if self._listed is None:
            order = sorted(self._rows.values(), key=lambda row: (row.priority, row.since_s))
            self._listed = tuple(order)
        return self._listed

    def set(self, alarm: Alarm) -> bool:
        """Make `alarm` active; return whether it was not. One that was keeps its time.

        It may have become more urgent, a latch most of all; what has been acknowledged was the less
        urgent one then.
        """
        row = self._rows.get(alarm.code)
        if row is not None and row.active:
            latches = alarm.latched and not row.latched
            if latches or alarm.priority < row.priority:
                latched = alarm.latched or row.latched
                self._put(replace(alarm, since_s=row.since_s, latched=latched))
            return False
        self._put(alarm)
        return True

    def clear(self, code: str) -> bool:
        """Say that `code` is over; return whether it was active. A latched row stays."""
        row = self._rows.get(code)
        if row is None or not row.active or row.latched:
            return False
        if row.acknowledged:
            self._drop(code)
        else:
            self._put(replace(row, active=False))
        return True

    def acknowledge(self, code: str | None) -> tuple[str, ...]:
        """Acknowledge `code`, or all, latches too; return the codes it met."""
        met = [row for row in self._rows.values() if code in (None, row.code)]
        for row in met:
            if row.latched or not row.active:
                self._drop(row.code)
            else:
                self._put(replace(row, acknowledged=True))
        return tuple(row.code for row in met if row.latched or not row.acknowledged)

    def latched(self) -> tuple[Alarm, ...]:
        """Return the alarms that hold the heater off until they are acknowledged."""
        return tuple(row for row in self._rows.values() if row.latched)

    def _put(self, row: Alarm) -> None:
        self._rows[row.code] = row
        self._listed = None

    def _drop(self, code: str) -> None:
        del self._rows[code]
        self._listed = None
